"""Control loops as the doctor examines them: plants, friction and laws in the symbols of the conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from friction_fmus.blocks.contact import Contact, Level
from friction_fmus.conditions import Condition, DrivenPlant, PathDynamics, SampledLaw, one_mass, two_masses

Values: TypeAlias = Mapping[str, float]
"""Parameters and constant inputs of a part, by name, in SI units."""


@dataclass(frozen=True)
class Gains:
    """Position loop in PID form: u = Kp e + Kd (rd - v) + Ki times the integral of e.

    Parameters
    ----------
    Kp, Kd, Ki : float
        Gains [N/m, N.s/m, N/(m.s)].
    db : float
        Error up to which the integral is held [m].
    m : float
        Mass of the inertia feedforward [kg].
    reversal : float
        Factor of the integral at a reversal.
    turned : float
        Coulomb friction in the integral that changes its sign at a reversal [N].
    """

    Kp: float
    Kd: float
    Ki: float = 0.0
    db: float = 0.0
    m: float = 0.0
    reversal: float = 1.0
    turned: float = 0.0


@dataclass(frozen=True)
class Law:
    """Properties of a law that the conditions need, as functions of its parameter values.

    Parameters
    ----------
    gains : callable or None
        Position loop, from the values; None if the law does not close one.
    levels : callable or None
        Compensated friction, forward and backward, from the values.
    inertia : callable or None
        Mass of the inertia feedforward [kg], from the values.
    linear : callable or None
        Linear sampled law, from the values and the sample time; None if it has no part in the loop.
    amplifies : callable or None
        Gain from the input f to the output for small movements, from the values; None for a gain of 1.
    rules : tuple of callable
        Conditions specific to this law.
    measured, at_rest, estimates, hunts, shapes : bool
        As in `Loop`.
    """

    gains: Callable[[Values], Gains] | None = None
    levels: Callable[[Values], tuple[Level, Level]] | None = None
    inertia: Callable[[Values], float] | None = None
    linear: Callable[[Values, float], SampledLaw] | None = None
    amplifies: Callable[[Values], float] | None = None
    rules: tuple[Rule, ...] = ()
    measured: bool = False
    at_rest: bool = False
    estimates: bool = False
    hunts: bool = True
    shapes: bool = False


@dataclass(frozen=True)
class SignalPath:
    """Actuator, limits and sensors between a law and its plant.

    Parameters
    ----------
    tau, delay : float
        Lag and delay of the actuator [s].
    low, high : float
        Limits of the force on the plant [N].
    amplified : float
        Gain of the force of the law for small movements.
    window : int
        Number of samples over which the velocity is computed from positions; 0 if it is measured.
    smoothing : float
        Time constant of a low-pass filter behind that difference [s].
    quantum : float
        Resolution of the measured position [m].
    sensor : str
        Name of the sensor part; empty if the plant's outputs are used directly.
    at_load : (bool, bool)
        Whether position and velocity are measured at the load of a flexible drive.
    """

    tau: float = 0.0
    delay: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    amplified: float = 1.0
    window: int = 0
    smoothing: float = 0.0
    quantum: float = 0.0
    sensor: str = ""
    at_load: tuple[bool, bool] = (False, False)

    @property
    def dynamics(self) -> PathDynamics:
        """Lag, delay and velocity measurement, for the poles of the loop."""
        return PathDynamics(self.tau, self.delay, self.window, self.smoothing)


@dataclass(frozen=True)
class ActiveLaw:
    """Law that acts on an axis.

    Parameters
    ----------
    part : str
        Name of the part.
    law : Law
        Properties of the law.
    values : mapping of str to float
        Parameter values of the law.
    to_force : float
        Product of the gains of the connections from its u to the force on the plant.
    of_position, of_velocity : float
        Gains of the connections from the plant to its x and v.
    path : SignalPath
        Actuator, limits and sensors between the law and the plant.
    """

    part: str
    law: Law
    values: Values
    to_force: float = 1.0
    of_position: float = 1.0
    of_velocity: float = 1.0
    path: SignalPath = SignalPath()

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
    """One mass with its friction and the laws that drive it.

    Parameters
    ----------
    plant : str
        Name of the part.
    m, damping, stiffness : float
        Mass [kg], damper [N.s/m] and spring [N/m] to ground.
    friction : str or None
        Name of the part with the friction; None if no known part acts as friction.
    contact : Contact or None
        Friction of the axis.
    laws : tuple of ActiveLaw
        Laws that drive the axis, in the order from the plant to the reference.
    flexible : (float, float, float, float) or None
        m1, m2, k, d of motor and load; None for a single mass.
    at_load : bool
        Whether the friction acts on the load.
    cogging : (str, float) or None
        Part and largest slope [N/m] of a position-dependent force.
    belt : float or None
        Speed of the belt under the mass [m/s].
    support : float or None
        Speed of the other end of spring and damper [m/s].
    shapers : tuple of Shaper
        Prefilters of the references.
    rotary : bool
        Whether the plant has angles and torques, and the numbers are in their units.
    """

    plant: str
    m: float
    damping: float = 0.0
    stiffness: float = 0.0
    friction: str | None = None
    contact: Contact | None = None
    laws: tuple[ActiveLaw, ...] = ()
    flexible: tuple[float, float, float, float] | None = None
    at_load: bool = False
    cogging: tuple[str, float] | None = None
    belt: float | None = None
    support: float | None = None
    shapers: tuple[Shaper, ...] = ()
    rotary: bool = False

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
class Finding:
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
