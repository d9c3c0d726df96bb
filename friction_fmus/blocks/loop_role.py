"""The role of a block in a control loop, for the doctor: plant, sensor, filter, drive or law."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from friction_fmus.blocks.arithmetic import names_in
from friction_fmus.blocks.contact import Friction, friction_of
from friction_fmus.blocks.macros import table
from friction_fmus.errors import FrictionError


@dataclass(frozen=True)
class Plant:
    """A mass, optionally with a spring and a damper to the ground, in terms of the block's variables."""

    forces: tuple[str, ...]  # inputs for applied forces
    friction: tuple[str, ...]
    """Inputs for friction forces, of which the first connected one counts; empty if the block contains its own
    friction."""
    mass: str  # mass [kg], an expression of the parameters
    damping: str = ""
    stiffness: str = ""
    """Parameters; empty if there are none."""
    flexible: tuple[str, ...] = ()
    """For a motor and a load connected by a spring: both masses, stiffness and damping; else empty."""
    belt: str = ""  # parameter with the speed of the ground; empty if the ground is at rest
    support: str = ""  # input with the speed of the other end of spring and damper; empty if it is at rest


@dataclass(frozen=True)
class Sensor:
    """A block between a plant and its laws that measures or estimates signals."""

    quantum: str = ""  # resolution of the measured position, an expression; empty if it is not quantised
    velocity: str = ""
    window: str = "1"
    smoothing: str = "0"
    """Output with a velocity from position differences, their distance in samples, and the time constant of a
    subsequent filter."""


@dataclass(frozen=True)
class Actuator:
    """An actuator: expressions of its limits [N], time constant and delay [s]."""

    low: str
    high: str
    lag: str = "0"
    delay: str = "0"


@dataclass(frozen=True)
class Cogging:
    """A cogging force: parameter with the pitch, vectors with amplitudes and phases; empty for a table."""

    pitch: str = ""
    amplitude: str = ""
    phase: str = ""


@dataclass(frozen=True)
class Loop:
    """A law or controller in a control loop; strings are expressions of its parameters."""

    gains: Mapping[str, str] = field(default_factory=dict)
    """Gains of its position loop in PID form: Kp, Kd and optionally Ki, db (error below which the integral is held), m
    (mass of its inertia feedforward), reversal (factor of the integral at a reversal) and turned (friction in the
    integral that changes its sign there). Empty if it closes no position loop."""
    friction: Friction | None = None  # the friction that it compensates
    measured: bool = False  # whether it computes friction from the measured velocity, otherwise from the reference
    at_rest: bool = False  # whether it computes friction from the measured velocity and also compensates it at rest
    inertia: str = ""  # mass of an inertia feedforward for the position loop of another law; empty if there is none
    linear: Mapping[str, float] | None = None
    """Parameter values at which its equations are linearised for the poles of the loop; None if it does not affect
    them."""
    filter: str = ""
    """For a controller in C: the function of `friction_fmus.doctor.roles` that returns its part of the loop."""
    estimates: bool = False
    """Whether it estimates the force without a friction model, so that the poles of the loop include the estimator."""
    hunts: bool = True  # whether its integral action, if any, causes hunting with static friction
    amplifies: str = ""  # gain from its input f to its output in small motions; 1 if empty
    adapts: tuple[str, ...] = ()
    """Rate of an adaptation [N/m] and the damping [N.s/m] that must stabilise it; empty if it does not adapt."""
    rules: tuple[str, ...] = ()  # names of further rules, see `friction_fmus.doctor.roles`
    shapes: bool = False
    """Whether it shapes the reference of a law by the inverse of the gains Kp, Kd, Ki in its parameters."""

    def __post_init__(self) -> None:
        for text in (*self.gains.values(), self.inertia, self.amplifies, *self.adapts):
            if text:
                names_in(text)


@dataclass(frozen=True)
class InLoop:
    """The role of a block in a control loop: at most one of the following, and optionally its own friction."""

    friction: Friction | None = None  # friction of a friction model, or of a plant that contains its own friction
    plant: Plant | None = None
    sensor: Sensor | None = None
    drive: Actuator | None = None
    cogging: Cogging | None = None
    law: Loop | None = None
    biquad: tuple[str, ...] | None = None  # for a sampled filter of second order: f, zeta, low, band, high
    """The role."""

    @property
    def known(self) -> bool:
        """Whether the doctor knows the block."""
        return any(part is not None for part in vars(self).values())


_KINDS = (
    *("FORCES", "FRICTION", "MASS", "DAMPER", "SPRING", "FLEXIBLE", "BELT", "SUPPORT"),
    *("SENSOR", "QUANTUM", "VELOCITY", "DRIVE", "LAG", "DELAY", "COGGING"),
    *("LAW", "INERTIA", "FILTER", "RULES", "BIQUAD"),
)


def in_loop(code: str) -> InLoop:
    """Return the role that the macros CONTACT and IN_LOOP of a C file declare."""
    friction = friction_of(code)
    rows = dict(table(code, "IN_LOOP", _KINDS))
    try:
        if "MASS" in rows:
            return InLoop(friction, plant=_plant(rows))
        if "SENSOR" in rows:
            return InLoop(sensor=Sensor(*rows.get("QUANTUM", ("",)), *rows.get("VELOCITY", ())))
        if "DRIVE" in rows:
            return InLoop(drive=Actuator(*rows["DRIVE"], *rows.get("LAG", ("0",)), *rows.get("DELAY", ("0",))))
        if "COGGING" in rows:
            return InLoop(cogging=Cogging(*rows["COGGING"]))
        if "BIQUAD" in rows:
            return InLoop(biquad=rows["BIQUAD"])
        if "LAW" in rows:
            return InLoop(law=_law(rows, friction))
    except (TypeError, ValueError) as error:
        raise FrictionError(f"IN_LOOP has a row with too few or too many arguments: {rows}") from error
    if rows:
        raise FrictionError("IN_LOOP has no row MASS, SENSOR, DRIVE, COGGING, BIQUAD or LAW; add the role of the block")
    return InLoop(friction)


Rows = Mapping[str, tuple[str, ...]]


def _plant(rows: Rows) -> Plant:
    keys = ("MASS", "DAMPER", "SPRING", "BELT", "SUPPORT")
    (mass,), (damper,), (spring,), (belt,), (support,) = (rows.get(key, ("",)) for key in keys)
    flexible = rows.get("FLEXIBLE", ())
    return Plant(rows["FORCES"], rows.get("FRICTION", ()), mass, damper, spring, flexible, belt, support)


def _law(rows: Rows, friction: Friction | None) -> Loop:
    (inertia,), (linear,) = (rows.get(key, ("",)) for key in ("INERTIA", "FILTER"))
    estimates, rules = "estimates" in rows["LAW"], rows.get("RULES", ())
    return Loop(friction=friction, inertia=inertia, filter=linear, estimates=estimates, rules=rules)
