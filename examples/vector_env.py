"""A servo axis with LuGre friction as a vector environment of Gymnasium: follow a target that jumps.

An action is a force relative to the largest one, and an observation is the position, the velocity and the target. The
mass and the friction of each axis change with each episode.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from friction_fmus import System

STEP, STEPS = 1e-4, 20  # communication step [s], and how many of them an action lasts
LENGTH = 250  # actions of an episode
FORCE = 20.0  # largest force [N]
REACH = 0.05  # largest distance of the target [m]
RANGES = {"mass.m": (0.5, 2.0), "friction.Fc": (0.5, 1.4)}

Arrays = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]


class AxisEnv(VectorEnv[Any, Any, Any]):
    """Axes that are stepped together; an axis whose episode has ended begins the next one with its next action."""

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012, as Gymnasium has it

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.single_action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)
        self.single_observation_space = spaces.Box(-np.inf, np.inf, (3,), np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
        self._system = System({"mass": "Mass", "friction": "LuGre"}, wires, {"mass.F_drive": 0.0})
        self._batch = self._system.batch(
            num_envs,
            inputs=["mass.F_drive"],
            outputs=["mass.x", "mass.v"],
            start={name: np.full(num_envs, low) for name, (low, _) in RANGES.items()},
            step=STEP,
        )
        self._targets = np.zeros(num_envs)
        self._ended = np.ones(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin an episode of each axis."""
        super().reset(seed=seed)
        self._begin(np.arange(self.num_envs))
        return self._observed(), {}

    def step(self, actions: NDArray[np.float64]) -> Arrays:
        """Let the forces act. An axis that cannot be stepped, as its action is NaN, ends its episode."""
        begun = self._ended.copy()
        self._batch.step(FORCE * np.clip(actions, -1.0, 1.0), STEPS)
        failures = {axis: error for axis, error in self._batch.failures.items() if not begun[axis]}
        self._begin(np.flatnonzero(begun))  # their actions are ignored
        rewards = np.where(begun, 0.0, -np.abs(self._batch.values[:, 0] - self._targets) / REACH)
        terminated = np.isin(np.arange(self.num_envs), [*failures])
        truncated = self._batch.time > (LENGTH - 0.5) * STEPS * STEP
        self._ended = terminated | truncated
        return self._observed(), rewards, terminated, truncated, {"failures": failures}

    def close(self, **_: Any) -> None:
        """Free the axes."""
        self._batch.close()
        self._system.close()

    def _begin(self, axes: NDArray[np.int64]) -> None:
        drawn = {name: self.np_random.uniform(*bounds, axes.size) for name, bounds in RANGES.items()}
        self._batch.reset(axes, start=drawn)
        self._targets[axes] = self.np_random.uniform(-REACH, REACH, axes.size)
        self._ended[axes] = False

    def _observed(self) -> NDArray[np.float64]:
        return np.column_stack([self._batch.values, self._targets])


def main() -> None:
    """Let a PD controller follow the targets, and print the mean reward of an action."""
    axes = AxisEnv(100)
    seen, _ = axes.reset(seed=1)
    total = 0.0
    for _ in range(LENGTH):
        force = 400.0 * (seen[:, 2] - seen[:, 0]) - 30.0 * seen[:, 1]
        seen, rewards, _, _, _ = axes.step(force[:, None] / FORCE)
        total += float(rewards.mean()) / LENGTH
    axes.close()
    print(f"mean reward of an action: {total:.3f}")


if __name__ == "__main__":
    main()
