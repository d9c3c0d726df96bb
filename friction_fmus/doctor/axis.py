"""What the doctor knows of a control loop: plants, friction and laws in the symbols of the conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from friction_fmus.blocks.contact import Contact, Level
from friction_fmus.conditions import Between, Condition, DrivenPlant, SampledLaw, one_mass, two_masses

Values: TypeAlias = Mapping[str, float]
"""Parameters of a part, and those of its inputs that are constant, by name in SI units."""


@dataclass(frozen=True)
class Gains:
    """A position loop as PID: u = Kp e + Kd (rd - v) + Ki times the integral of e.

    Parameters
    ----------
    Kp, Kd, Ki : float
        [N/m, N.s/m, N/(m.s)].
    db : float
        Error up to which the integral is held [m].
    m : float
        Mass of the inertia feedforward [kg].
    """

    Kp: float
    Kd: float
    Ki: float = 0.0
    db: float = 0.0
    m: float = 0.0


@dataclass(frozen=True)
class Law:
    """What the conditions need of a law.

    Parameters
    ----------
    gains : callable or None
        Its position loop from the values.
    levels : callable or None
        The friction that it compensates, forward and backward.
    inertia : callable or None
        Mass of its inertia feedforward, from the values.
    linear : callable or None
        Its part of the sampled loop, from the values and the sample time; None: it has none.
    amplifies : callable or None
        How many times what comes in at f leaves the law in small movements; None: once.
    rules : tuple of callable
        Conditions of this law alone.
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
class Path:
    """What lies between a law and its plant.

    Parameters
    ----------
    tau, delay : float
        Of an actuator [s].
    low, high : float
        Limits of the force on the plant [N].
    amplified : float
        How many times the force of the law arrives in small movements.
    window, smoothing : float
        Samples over which the velocity is taken from positions, 0: it is measured; time constant behind that [s].
    quantum : float
        Step of the measured position [m].
    sensor : str
        Part that measures; empty: the plant itself.
    at_load : (bool, bool)
        Whether position and velocity are those of the load of a flexible drive.
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
    def between(self) -> Between:
        """The same for the poles of the loop."""
        return Between(self.tau, self.delay, self.window, self.smoothing)


@dataclass(frozen=True)
class Used:
    """A law that acts on an axis.

    Parameters
    ----------
    part : str
        Name of the part.
    law : Law
        What is known of it.
    values : mapping
        Its parameters.
    to_force : float
        Product of the gains of the wires from its u to the force on the plant.
    of_position, of_velocity : float
        Gains of the wires from the plant to its x and v.
    path : Path
        What lies between the law and the plant.
    """

    part: str
    law: Law
    values: Values
    to_force: float = 1.0
    of_position: float = 1.0
    of_velocity: float = 1.0
    path: Path = Path()

    @property
    def gains(self) -> Gains | None:
        """The position loop in the units and signs of the plant."""
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
        )


@dataclass(frozen=True)
class Shaper:
    """A law that shapes a reference: its part, its row of the table, and its values."""

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
        Mass [kg], damper [N.s/m] and spring [N/m] to the ground.
    friction : str or None
        Name of the part with the friction; None if there is none that is known.
    contact : Contact or None
        Its friction.
    laws : tuple of Used
        From the plant outward.
    flexible : (float, float, float, float) or None
        m1, m2, k, d of motor and load; None: a single mass.
    at_load : bool
        Whether the friction is that of the load.
    cogging : (str, float) or None
        Part and largest slope [N/m] of a force that depends on position.
    belt : float or None
        Speed of the belt below [m/s].
    shapers : tuple of Shaper
        What shapes the references of its laws.
    """

    plant: str
    m: float
    damping: float = 0.0
    stiffness: float = 0.0
    friction: str | None = None
    contact: Contact | None = None
    laws: tuple[Used, ...] = ()
    flexible: tuple[float, float, float, float] | None = None
    at_load: bool = False
    cogging: tuple[str, float] | None = None
    belt: float | None = None
    shapers: tuple[Shaper, ...] = ()

    def driven(self, damping: float, stiffness: float, measured: tuple[bool, bool] = (False, False)) -> DrivenPlant:
        """The plant with this damping and stiffness of its contact, beside its own to the ground."""
        if self.flexible is None:
            return one_mass(self.m, self.damping + damping, self.stiffness + stiffness)
        dampers = (0.0, damping) if self.at_load else (damping, 0.0)
        springs = (0.0, stiffness) if self.at_load else (stiffness, 0.0)
        return two_masses(*self.flexible, dampers, springs, measured)

    @property
    def servo(self) -> Used | None:
        """The law that closes the position loop."""
        return next((law for law in self.laws if law.law.gains is not None), None)


@dataclass(frozen=True)
class Finding:
    """A condition of some parts of a system.

    Parameters
    ----------
    parts : tuple of str
        Which parts it concerns.
    condition : Condition
        What was evaluated.
    """

    parts: tuple[str, ...]
    condition: Condition


Rule: TypeAlias = Callable[[Axis, Used], Iterable[Condition]]
"""Conditions of one law on its axis; none where they do not apply."""
