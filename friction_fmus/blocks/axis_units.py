"""Units and nouns of a linear and of a rotary axis, for messages and descriptions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias


class Words(NamedTuple):
    """Nouns and units with which texts describe an axis; the names are those of a linear axis."""

    force: str = "force"
    mass: str = "mass"
    a_mass: str = "a mass"
    moving_mass: str = "moving mass"
    moved_mass: str = "moved mass"
    m: str = "m"
    m_s: str = "m/s"
    N: str = "N"
    kg: str = "kg"
    N_m: str = "N/m"
    Ns_m: str = "N.s/m"
    N_ms: str = "N/(m.s)"
    N2s_m2: str = "N2.s/m2"

    def signal(self, name: str) -> str:
        """Return the name of a fitted signal: ``force`` is a torque on a rotary axis."""
        return self.force if name == "force" else name

    def fill(self, text: str) -> str:
        """Return a text with placeholders such as ``{force}`` and ``{Force}`` replaced by the nouns."""
        for name, noun in self._asdict().items():
            text = text.replace(f"{{{name}}}", noun).replace(f"{{{name.capitalize()}}}", noun.capitalize())
        return text


SLIDING = Words()
TURNING = Words(
    *("torque", "inertia", "an inertia", "moment of inertia", "moment of inertia"),
    *("rad", "rad/s", "N.m", "kg.m2", "N.m/rad", "N.m.s/rad", "N.m/(rad.s)", "N2.m2.s/rad2"),
)


@dataclass(frozen=True)
class AxisUnits:
    """Units of an axis; the defaults are for a linear axis, see `ROTARY` for a rotary one.

    Attributes
    ----------
    position, velocity, force, inertia, viscous : str
        Units of position, velocity, force or torque, mass or moment of inertia, and viscous coefficient.
    """

    position: str = "m"
    velocity: str = "m/s"
    force: str = "N"
    inertia: str = "kg"
    viscous: str = "N.s/m"

    @property
    def words(self) -> Words:
        """Nouns and units for texts."""
        return TURNING if self == ROTARY else SLIDING


LINEAR = AxisUnits()
ROTARY = AxisUnits("rad", "rad/s", "N.m", "kg.m2", "N.m.s/rad")


Domain: TypeAlias = Literal["translational", "rotational"]


def domain_of(rotary: bool) -> Domain:
    """Return the domain of the FMUs of a linear or a rotary axis."""
    return "rotational" if rotary else "translational"


def words_of(rotary: bool) -> Words:
    """Return the nouns and units of a linear or a rotary axis."""
    return TURNING if rotary else SLIDING
