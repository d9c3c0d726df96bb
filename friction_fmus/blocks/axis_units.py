"""Units and nouns of a linear and of a rotary axis, for messages and descriptions."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

from harness.units import BASE_SYMBOLS, parse_unit


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
    def rotary(self) -> bool:
        """Whether the position is an angle."""
        return self.position == "rad"

    @property
    def known(self) -> bool:
        """Whether all are SI units; otherwise a channel without a scale keeps its own unit."""
        return self in (LINEAR, ROTARY)

    @property
    def results(self) -> str:
        """Units of force and position for texts."""
        known = {"1": "no unit", "u.s": "the unit of the velocity"}
        both = [known.get(unit, unit) for unit in (self.force, self.position)]
        return " and ".join(dict.fromkeys(both))

    @property
    def words(self) -> Words:
        """Nouns and units for texts."""
        words = TURNING if self.rotary else SLIDING
        if self.known:
            return words
        own = {name: self.own(unit) for name, unit in words._asdict().items() if name in Words._fields[5:]}
        units = {name: "units" if unit == "1" else unit for name, unit in own.items()}
        nouns = {"mass": "inertia", "a_mass": "an inertia", "moving_mass": "inertia", "moved_mass": "inertia"}
        amperes = self.force.endswith("A")
        force = "current" if amperes else "torque" if self.force.endswith("N.m") else words.force
        return words._replace(force=force, **nouns, **units)

    def own(self, unit: str) -> str:
        """Return the unit of a quantity of a block in the units of the axis, such as ``mA.s/rad`` for ``N.m.s/rad``.

        Parameters
        ----------
        unit : str
            Unit of the quantity in SI units.

        Returns
        -------
        str
            Its unit; ``1`` for none.
        """
        known = parse_unit(unit)
        if self.known or known is None:
            return unit
        of = dict(zip(BASE_SYMBOLS, known.exponents, strict=True))
        force, way = of["kg"], of["rad"] if self.rotary else of["m"] - of["kg"]
        symbol = self.position.removesuffix(".s")  # "u.s": only the velocity has a name
        time = of["s"] + 2 * force + (way if symbol != self.position else 0)
        if self.force == f"{self.position}/s2":  # a force over inertia
            way, time, force = way + force, time - 2 * force, 0

        def product(sign: int) -> str:
            powers = [(self.force, force * sign), ("s", time * sign), (symbol, way * sign)]
            return ".".join(f"{name}{n if n > 1 else ''}" for name, n in powers if n > 0 and name != "1")

        over, under = product(1) or "1", product(-1)
        return f"{over}/({under})" if "." in under else f"{over}/{under}" if under else over


LINEAR = AxisUnits()
ROTARY = AxisUnits("rad", "rad/s", "N.m", "kg.m2", "N.m.s/rad")


def units_of_channels(position: str, force: str) -> AxisUnits:
    """Return the units of an axis of which a channel has its own unit; ``1`` if it has none."""
    si = ROTARY if position == "rad" else LINEAR
    if (position, force) == (si.position, si.force):
        return si
    given = AxisUnits(position, force=force)
    return replace(given, **{name: given.own(getattr(si, name)) for name in ("velocity", "inertia", "viscous")})


Domain: TypeAlias = Literal["translational", "rotational"]


def domain_of(rotary: bool) -> Domain:
    """Return the domain of the FMUs of a linear or a rotary axis."""
    return "rotational" if rotary else "translational"


def words_of(rotary: bool) -> Words:
    """Return the nouns and units of a linear or a rotary axis."""
    return TURNING if rotary else SLIDING
