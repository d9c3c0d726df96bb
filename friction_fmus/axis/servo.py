"""The servo of an axis as it is configured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

GAINS: Final[Mapping[str, tuple[str, ...]]] = {"CascadePPI": ("kp", "kv", "ki"), "PID": ("Kp", "Kd", "Ki")}
"""Law of the servo -> names of its gains."""


@dataclass(frozen=True)
class Servo:
    """The servo of an axis: its feedback, its sensor and its limit.

    Attributes
    ----------
    law : str
        "CascadePPI" or "PID".
    gains : mapping of str to float
        Its gains, see `GAINS`.
    Ts : float
        Sampling period [s].
    force_limit : float
        Largest force of either sign [N].
    window : int
        The velocity is (x[k] - x[k - window]) / (window Ts).
    quantum : float
        Grid of the position measurement [m]; 0: none.
    velocity_feedforward : bool
        Whether the measured servo is given the reference velocity.
    mass : float or None
        Moved mass [kg], where the record has no drive force to identify it from.
    """

    law: str
    gains: Mapping[str, float]
    Ts: float
    force_limit: float
    window: int = 2
    quantum: float = 0.0
    velocity_feedforward: bool = False
    mass: float | None = None

    @property
    def pid(self) -> tuple[float, float, float]:
        """The same feedback as PID: Kp [N/m], Kd [N.s/m], Ki [N/(m.s)]."""
        first, second, third = (self.gains[name] for name in GAINS[self.law])
        return (first, second, third) if self.law == "PID" else (second * first + third, second, third * first)
