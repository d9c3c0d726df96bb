"""Configuration of the servo of an axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

GAINS: Final[Mapping[str, tuple[str, ...]]] = {"CascadePPI": ("kp", "kv", "ki"), "PID": ("Kp", "Kd", "Ki")}
"""Names of the gains of each servo law."""


@dataclass(frozen=True)
class Servo:
    """Servo of an axis: feedback law, sensors and force limit.

    For a rotary axis, read m as rad, N as N.m and kg as kg.m2.

    Attributes
    ----------
    law : str
        Feedback law, ``CascadePPI`` or ``PID``.
    gains : mapping of str to float
        Gains of the law: kp [1/s], kv [N.s/m] and ki [N/m] of ``CascadePPI``; Kp [N/m], Kd [N.s/m] and Ki [N/(m.s)] of
        ``PID``.
    Ts : float
        Sample time [s].
    force_limit : float
        Largest force in either direction [N].
    window : int
        Number of samples over which the velocity is computed: (x[k] - x[k - window]) / (window Ts).
    quantum : float
        Resolution of the position measurement [m]; 0 if it is exact.
    velocity_feedforward : bool
        Whether the measured servo received the reference velocity.
    inertia_feedforward : float
        Mass with which the measured servo multiplied the reference acceleration [kg]; 0 for none.
    mass : float or None
        Moved mass [kg]; needed if the record has no drive force to identify it from.
    delay : int
        Number of samples by which the force of the drive lags the command.
    noise : float
        Standard deviation of the noise of the measured position, in addition to its resolution [m].
    """

    law: str
    gains: Mapping[str, float]
    Ts: float
    force_limit: float
    window: int = 2
    quantum: float = 0.0
    velocity_feedforward: bool = False
    inertia_feedforward: float = 0.0
    mass: float | None = None
    delay: int = 0
    noise: float = 0.0

    @property
    def pid(self) -> tuple[float, float, float]:
        """Gains of the same feedback in PID form: Kp [N/m], Kd [N.s/m], Ki [N/(m.s)]."""
        first, second, third = (self.gains[name] for name in GAINS[self.law])
        return (first, second, third) if self.law == "PID" else (second * first + third, second, third * first)
