"""Configuration of the servo of an axis: its law, sensors and filters, and the plant that it moves."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from math import atan, exp, pi, sqrt
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi

from friction_fmus.axis.position_map import PositionMap
from friction_fmus.blocks.arithmetic import evaluate, is_known
from friction_fmus.blocks.axis_units import Words, words_of
from friction_fmus.blocks.catalogue import find
from friction_fmus.conditions.chain import second_order

Array: TypeAlias = NDArray[np.float64]

BUTTERWORTH: Final = sqrt(0.5)  # damping ratio of a low-pass filter of order 2


@dataclass(frozen=True)
class LowPass:
    """Low-pass filter of the measured velocity: order, 1 or 2 (Butterworth), and frequency of -3 dB [Hz]."""

    order: int
    cutoff: float

    @property
    def tau(self) -> float:
        """Time constant of order 1 in the block Differentiator [s]; 0 for order 2."""
        return 1.0 / (2.0 * pi * self.cutoff) if self.order == 1 else 0.0

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the block SecondOrderFilter for order 2."""
        return {"f": self.cutoff, "zeta": BUTTERWORTH, "low": 1.0, "band": 0.0, "high": 0.0}


@dataclass(frozen=True)
class Notch:
    """Notch filter of the force command: centre [Hz], damping ratio of the poles, gain at the centre."""

    frequency: float
    damping: float
    depth: float = 0.0

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the block SecondOrderFilter."""
        return {"f": self.frequency, "zeta": self.damping, "low": 1.0, "band": self.depth, "high": 1.0}


@dataclass(frozen=True)
class CurrentLoop:
    """Lag of order 1 from a held command to the force, by the trapezoidal rule: time constant, sample time [s]."""

    tau: float
    Ts: float

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the block SecondOrderFilter, of which a pole and a zero cancel."""
        f = atan(0.5 * self.Ts / self.tau) / (pi * self.Ts)
        return {"f": f, "zeta": 1.0, "low": 1.0, "band": 0.5, "high": 0.0}


def coefficients(own: LowPass | Notch | CurrentLoop, Ts: float) -> tuple[Array, Array]:
    """Return numerator and denominator in powers of 1/z, as the blocks of the simulation have them."""
    if isinstance(own, LowPass) and own.order == 1:
        keep = exp(-Ts / own.tau)
        return np.array([1.0 - keep, 0.0]), np.array([1.0, -keep])
    return second_order(**own.parameters, Ts=Ts)


def filtered(own: LowPass | Notch | CurrentLoop | None, values: Array, Ts: float) -> Array:
    """Return values of shape (n,) behind a filter, which begins as if the first one had always been there."""
    if own is None:
        return values
    b, a = coefficients(own, Ts)
    found, _ = lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])
    return np.asarray(found, dtype=np.float64)


@dataclass(frozen=True)
class FlexibleLoad:
    """Part of the moved mass that a spring connects with the motor."""

    share: float  # part of the moved mass
    frequency: float  # antiresonance of the drive, sqrt(k / m2) [rad/s]
    damping: float  # damping ratio of the load on its spring
    friction: float  # part of the friction that acts on it
    found: float = 0.0  # moved mass with which it was found [kg]; 0 if it was not found in a record

    def parameters(self, mass: float) -> dict[str, float]:
        """Return masses, stiffness and damping of `TwoMass`, of this mass together."""
        m2 = self.share * mass
        k, d = m2 * self.frequency**2, 2.0 * m2 * self.damping * self.frequency
        return {"m1": mass - m2, "m2": m2, "k": k, "d": d}

    @property
    def resonance(self) -> float:
        """Resonance of the free drive [Hz]."""
        return self.frequency / (2.0 * pi * sqrt(1.0 - self.share))


SHARES: Final = ("a_drive", "a_external")  # coefficients of the load


@dataclass(frozen=True)
class AxisPlant:
    """Identified mass and friction of an axis."""

    friction: str  # friction block, or its file
    values: Mapping[str, float]
    """Parameters of the friction block; if it has no parameter Fv, this is the coefficient of a viscous friction beside
    it [N.s/m]."""
    mass: float  # moved mass [kg]
    offset: float = 0.0  # constant force that the drive needs in addition to friction [N]
    position: PositionMap | None = None  # force that depends on position
    load: FlexibleLoad | None = None  # part of the mass, behind a spring
    terms: Mapping[str, float] = field(default_factory=dict)
    """Gravity of an arm, G_sin and G_cos [N.m], and a_drive and a_external, the friction over the transmitted force;
    the parameter Fn0 of the block is then its friction without load, and `position` the gravity."""

    @property
    def loaded(self) -> bool:
        """Whether the friction grows with the transmitted force."""
        return any(self.terms.get(name) for name in SHARES)

    @property
    def stiffness(self) -> float:
        """Contact stiffness at rest, as the file of the block states it [N/m]; 0 if rigid."""
        friction = find(self.friction).about.friction
        if friction is None or not is_known(friction.stiffness, self.values):
            return 0.0
        return float(evaluate(friction.stiffness, self.values))


@dataclass(frozen=True)
class Compensator:
    """Compensator in the servo: block, name of its force output, and parameters of the block."""

    model: str
    output: str = "u"
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Trajectory:
    """Reference that the axis follows, its initial state, and disturbances."""

    reference: Path  # FMU that outputs the reference
    samples: int  # length in samples of the servo
    x0: float
    v0: float
    """Initial position and velocity of the axis [m, m/s]."""
    _: KW_ONLY
    motion: bool = False  # whether the servo receives the reference velocity and acceleration
    inertia: float | None = None  # mass of this acceleration feedforward [kg]; None for the mass of the axis
    viscous: float = 0.0  # feedforward of the reference velocity beside it [N.s/m], which CascadePPI has
    offset: float = 0.0  # constant force added to the output of the servo [N]
    rotary: bool = False  # whether the axis is rotary
    load: float = 0.0  # constant force on the axis that the servo does not know [N]
    noise: Path | None = None
    """FMU whose output r is noise of standard deviation 1 at the samples of the servo; needed if the position of the
    servo is noisy."""
    injected: NDArray[np.float64] | None = field(default=None, compare=False)
    """Force added to the output of the servo from outside, for a loop without compensator [N]."""
    table: PositionMap | None = None  # force over position that is compensated along the reference

    @property
    def words(self) -> Words:
        """Nouns and units of the axis."""
        return words_of(self.rotary)


GAINS: Final[Mapping[str, tuple[str, ...]]] = {"CascadePPI": ("kp", "kv", "ki"), "PID": ("Kp", "Kd", "Ki")}
"""Names of the gains of each servo law."""

GAIN_UNITS: Final[Mapping[str, str]] = {
    **{"kp": "1/s", "kv": "{Ns_m}", "ki": "{N_m}"},
    **{"Kp": "{N_m}", "Kd": "{Ns_m}", "Ki": "{N_ms}"},
}
"""Units of the gains as templates for `Words.fill`."""


LOGGED_FORCES: Final = ("command", "actual")
"""What the column of a drive force may contain: the command, or the force behind delay and current loop."""


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
    velocity_filter : LowPass or None
        Low-pass filter behind the velocity over `window`.
    notch : Notch or None
        Notch filter of the force command, which also filters the force of compensators.
    coulomb_feedforward, viscous_feedforward : float
        Friction feedforward of the drive: force in the direction of the reference velocity [N], and factor of that
        velocity [N.s/m].
    current_loop : float
        Bandwidth of the current loop, a low-pass filter of order 1 between command and force [Hz]; 0 for none.
    logged_force : str
        One of `LOGGED_FORCES`, what the column of the force contains; empty if unknown.
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
    velocity_filter: LowPass | None = None
    notch: Notch | None = None
    coulomb_feedforward: float = 0.0
    viscous_feedforward: float = 0.0
    current_loop: float = 0.0
    logged_force: str = ""

    @property
    def features(self) -> dict[str, str]:
        """Entries of ``[servo]`` for what not every servo has, as TOML."""
        lowpass, notch = self.velocity_filter, self.notch
        given = {"velocity_feedforward": "true"} if self.velocity_feedforward else {}
        for name in ("inertia_feedforward", "coulomb_feedforward", "viscous_feedforward"):
            given |= {name: f"{getattr(self, name):.5g}"} if getattr(self, name) else {}
        if lowpass is not None:
            given["velocity_filter"] = f"{{ order = {lowpass.order}, cutoff = {lowpass.cutoff:.4g} }}"
        if notch is not None:
            own = f"frequency = {notch.frequency:.4g}, damping = {notch.damping:.3g}, depth = {notch.depth:.3g}"
            given["notch"] = f"{{ {own} }}"
        given |= {"current_loop": f"{self.current_loop:.4g}"} if self.current_loop else {}
        given |= {"logged_force": f'"{self.logged_force}"'} if self.logged_force else {}
        return given | ({"delay": f"{self.delay}"} if self.delay else {})

    @property
    def lag(self) -> float:
        """Time constant of the current loop [s]; 0 for none."""
        return 0.5 / (pi * self.current_loop) if self.current_loop else 0.0

    @property
    def friction(self) -> Compensator | None:
        """Friction feedforward of the drive as a law; None without one."""
        Fc, Fv = self.coulomb_feedforward, self.viscous_feedforward
        return Compensator("StaticFeedforward", "u", {"Fc": Fc, "Fs": Fc, "Fv": Fv, "m": 0.0}) if Fc or Fv else None

    @property
    def pid(self) -> tuple[float, float, float]:
        """Gains of the same feedback in PID form: Kp [N/m], Kd [N.s/m], Ki [N/(m.s)]."""
        first, second, third = (self.gains[name] for name in GAINS[self.law])
        return (first, second, third) if self.law == "PID" else (second * first + third, second, third * first)
