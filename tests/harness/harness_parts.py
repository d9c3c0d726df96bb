"""Parts made of Python functions whose coupled behaviour is known in closed form."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
from scipy.linalg import expm

from harness import CallablePart, Port

SIGMA0 = 1e5  # N/m
DAMPING = np.sqrt(1e5) + 0.4  # N s/m


def mass(name: str = "mass", m: float = 1.0, v0: float = 0.0, every: int = 1) -> CallablePart:
    """A free mass, exact for a force that is held during the step. State: x, v."""

    def advance(t: float, h: float, u: np.ndarray, x: np.ndarray) -> list[float]:
        a = -u[0] / m
        return [x[0] + h * x[1] + 0.5 * h * h * a, x[1] + h * a]

    return CallablePart(
        name,
        lambda t, u, x: x,
        [Port("F", "N")],
        [Port("x", "m"), Port("v", "m/s")],
        advance=advance,
        state=[0.0, v0],
        dependencies={"x": (), "v": ()},
        every=every,
    )


def bristle(name: str = "bristle") -> CallablePart:
    """A bristle that sticks: F = sigma0 z + c v with z' = v. The force reads the velocity directly."""
    return CallablePart(
        name,
        lambda t, u, x: SIGMA0 * x[0] + DAMPING * u[0],
        [Port("v", "m/s")],
        [Port("F", "N")],
        advance=lambda t, h, u, x: x + h * u[0],
        state=[0.0],
    )


def linear(
    name: str,
    A: np.ndarray,
    B: np.ndarray,
    C: np.ndarray,
    D: np.ndarray,
    inputs: Iterable[str],
    outputs: Iterable[str],
    state: Iterable[float],
) -> CallablePart:
    """x' = A x + B u, y = C x + D u, exact for inputs that are held during the step."""
    n, k = B.shape
    inputs, outputs = tuple(inputs), tuple(outputs)

    @cache
    def transition(h: float) -> np.ndarray:
        block = np.zeros((n + k, n + k))
        block[:n, :n], block[:n, n:] = A * h, B * h
        return expm(block)[:n]

    def advance(t: float, h: float, u: np.ndarray, x: np.ndarray) -> np.ndarray:
        return transition(h) @ np.concatenate([x, u])

    reads = {y: [u for j, u in enumerate(inputs) if D[i, j]] for i, y in enumerate(outputs)}
    return CallablePart(
        name, lambda t, u, x: C @ x + D @ u, inputs, outputs, advance=advance, state=list(state), dependencies=reads
    )


def memoryless(name: str, inputs: Iterable[str], outputs: Iterable[str], **options: object) -> CallablePart:
    """Every output is the sum of all inputs."""
    outputs = tuple(outputs)
    return CallablePart(name, lambda t, u, x: [sum(u)] * len(outputs), inputs, outputs, **options)  # type: ignore[arg-type]


def plant(name: str, inputs: Iterable[str] = ("u",), outputs: Iterable[str] = ("y",)) -> CallablePart:
    """The output is the integral of the sum of the inputs."""
    outputs = tuple(outputs)
    return CallablePart(
        name,
        lambda t, u, x: [x[0]] * len(outputs),
        inputs,
        outputs,
        advance=lambda t, h, u, x: x + h * sum(u),
        state=[0.0],
        dependencies={output: () for output in outputs},
    )
