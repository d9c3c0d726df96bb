"""Control loops as the doctor examines them: plants, friction and laws in the symbols of the conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from friction_fmus.blocks.axis_units import SLIDING, Words
from friction_fmus.blocks.contact import AxisFriction, Level
from friction_fmus.conditions import Condition, DrivenPlant, PathDynamics, SampledLaw, one_mass, two_masses
from friction_fmus.conditions.chain import Biquad, in_series, second_order

Values: TypeAlias = Mapping[str, float]  # parameters and constant inputs of a part, by name, in SI units


@dataclass(frozen=True)
class Gains:
    """Position loop in PID form: u = Kp e + Kd (rd - v) + Ki times the integral of e."""

    Kp: float
    Kd: float
    Ki: float = 0.0
    """Gains [N/m, N.s/m, N/(m.s)]."""
    db: float = 0.0  # error up to which the integral is held [m]
    m: float = 0.0  # mass of the inertia feedforward [kg]
    reversal: float = 1.0  # factor of the integral at a reversal
    turned: float = 0.0  # coulomb friction in the integral that changes its sign at a reversal [N]


@dataclass(frozen=True)
class LawProperties:
    """Properties of a law that the conditions need, as functions of its parameter values."""

    gains: Callable[[Values], Gains] | None = None  # position loop, from the values; None if the law does not close one
    levels: Callable[[Values], tuple[Level, Level]] | None = None
    """Compensated friction, forward and backward, from the values."""
    inertia: Callable[[Values], float] | None = None  # mass of the inertia feedforward [kg], from the values
    linear: Callable[[Values, float], SampledLaw] | None = None
    """Linear sampled law, from the values and the sample time; None if it has no part in the loop."""
    amplifies: Callable[[Values], float] | None = None
    """Gain from the input f to the output for small movements, from the values; None for a gain of 1."""
    rules: tuple[Rule, ...] = ()  # conditions specific to this law
    measured: bool = False
    at_rest: bool = False
    estimates: bool = False
    hunts: bool = True
    shapes: bool = False
    """As in `Loop`."""


@dataclass(frozen=True)
class SignalPath:
    """Actuator, limits and sensors between a law and its plant."""

    tau: float = 0.0
    delay: float = 0.0
    """Lag and delay of the actuator [s]."""
    low: float = -math.inf
    high: float = math.inf
    """Limits of the force on the plant [N]."""
    amplified: float = 1.0  # gain of the force of the law for small movements
    window: int = 0  # number of samples over which the velocity is computed from positions; 0 if it is measured
    smoothing: float = 0.0  # time constant of a low-pass filter behind that difference [s]
    quantum: float = 0.0  # resolution of the measured position [m]
    sensor: str = ""  # name of the sensor part; empty if the plant's outputs are used directly
    lowpass: tuple[Biquad, ...] = ()
    notch: tuple[Biquad, ...] = ()
    position: tuple[Biquad, ...] = ()
    """Filters of velocity, force and position."""
    at_load: tuple[bool, bool] = (False, False)
    """Whether position and velocity are measured at the load of a flexible drive."""

    def dynamics(self, Ts: float) -> PathDynamics:
        """Return lag, delay, velocity measurement and filters, for the poles of the loop."""
        found = [[second_order(*each, Ts) for each in own] for own in (self.lowpass, self.notch, self.position)]
        filters = (in_series(own) if own else None for own in found)
        return PathDynamics(self.tau, self.delay, self.window, self.smoothing, *filters)


@dataclass(frozen=True)
class ActiveLaw:
    """Law that acts on an axis."""

    part: str  # name of the part
    law: LawProperties  # properties of the law
    values: Values  # parameter values of the law
    to_force: float = 1.0  # product of the gains of the connections from its u to the force on the plant
    of_position: float = 1.0
    of_velocity: float = 1.0
    """Gains of the connections from the plant to its x and v."""
    path: SignalPath = SignalPath()  # actuator, limits and sensors between the law and the plant

    @property
    def gains(self) -> Gains | None:
        """Position loop in the units and signs of the plant; None if the law does not close one."""
        if self.law.gains is None:
            return None
        own = self.law.gains(self.values)
        by_position, by_velocity = self.to_force * self.of_position, self.to_force * self.of_velocity
        return Gains(
            own.Kp * by_position,
            own.Kd * by_velocity,
            own.Ki * by_position,
            own.db / abs(self.of_position or 1.0),
            own.m * self.to_force,
            own.reversal,
            own.turned * abs(self.to_force),
        )


@dataclass(frozen=True)
class Shaper:
    """Law that shapes a reference: name of the part, its block, and its parameter values."""

    part: str
    model: str
    values: Values


@dataclass(frozen=True)
class Axis:
    """One mass with its friction and the laws that drive it."""

    plant: str  # name of the part
    m: float
    damping: float = 0.0
    stiffness: float = 0.0
    """Mass [kg], damper [N.s/m] and spring [N/m] to ground."""
    friction: str | None = None  # name of the part with the friction; None if no known part acts as friction
    contact: AxisFriction | None = None  # friction of the axis
    laws: tuple[ActiveLaw, ...] = ()  # laws that drive the axis, in the order from the plant to the reference
    flexible: tuple[float, float, float, float] | None = None  # m1, m2, k, d of motor and load; None for a single mass
    at_load: bool = False  # whether the friction acts on the load
    cogging: tuple[str, float] | None = None  # part and largest slope [N/m] of a position-dependent force
    belt: float | None = None  # speed of the belt under the mass [m/s]
    support: float | None = None  # speed of the other end of spring and damper [m/s]
    shapers: tuple[Shaper, ...] = ()  # prefilters of the references
    words: Words = SLIDING  # nouns and units of the plant: forces and positions, or torques and angles

    def driven(self, damping: float, stiffness: float, measured: tuple[bool, bool] = (False, False)) -> DrivenPlant:
        """Return the linear plant with damping and stiffness of the contact in addition to those to ground."""
        if self.flexible is None:
            return one_mass(self.m, self.damping + damping, self.stiffness + stiffness)
        dampers = (0.0, damping) if self.at_load else (damping, 0.0)
        springs = (0.0, stiffness) if self.at_load else (stiffness, 0.0)
        return two_masses(*self.flexible, dampers, springs, measured)

    @property
    def servo(self) -> ActiveLaw | None:
        """Law that closes the position loop; None if there is none."""
        return next((law for law in self.laws if law.law.gains is not None), None)


@dataclass(frozen=True)
class LoopFinding:
    """Condition evaluated for some parts of a system; its texts have the words and units of the axis.

    Parameters
    ----------
    parts : tuple of str
        Names of the parts.
    condition : Condition
        Evaluated condition.
    """

    parts: tuple[str, ...]
    condition: Condition


Rule: TypeAlias = Callable[[Axis, ActiveLaw], Iterable[Condition]]
"""Function that yields the conditions of one law on its axis that apply."""
