"""Settings of a servo in the units of its drive, such as ``"0.5 A/rpm"``, converted to those of the axis."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from friction_fmus.axis.servo import GAINS
from friction_fmus.errors import RecordError
from friction_fmus.identification.data.mapping import MISSING
from friction_fmus.identification.data.record import parse_quantity
from harness.storage.toml_file import TomlTable
from harness.units import BaseUnit, parse_unit
from harness.values import finite, shown


class Quantity(NamedTuple):
    """Unit with places for numerator and denominator, an example, and whether the numerator is a force."""

    unit: str
    example: str
    of_force: bool = True


QUANTITIES: Final[Mapping[str, Quantity]] = {
    "kp": Quantity("{}/s/{}", "1 m/min/mm", False),
    **dict.fromkeys(("kv", "Kd", "viscous_feedforward"), Quantity("{}/({}/s)", "0.5 A/rpm")),
    **dict.fromkeys(("ki", "Kp"), Quantity("{}/{}", "20 A/rev")),
    "Ki": Quantity("{}/({}.s)", "20 A/(rev.s)"),
    **dict.fromkeys(("force_limit", "coulomb_feedforward"), Quantity("{}", "10 A")),
    **dict.fromkeys(("mass", "inertia_feedforward"), Quantity("{}/({}/s2)", "0.002 kg.m2")),
    **dict.fromkeys(("quantum", "noise"), Quantity("{}", "0.01 deg", False)),
    **dict.fromkeys(("Ts", "Tn"), Quantity("s", "20 ms")),
    "current_loop": Quantity("Hz", "800 Hz"),
}
"""Settings that may have a unit."""

OF_DRIVE: Final = ("torque_constant", "pitch", "Tn")  # settings from which others are computed

_LINEAR: Final = {True: (("N", "m"), ("A", "m"), ("A", "rad"), ("N.m", "rad")), False: (("m", "m"), ("rad", "m"))}
_ROTARY: Final = {True: (("N.m", "rad"), ("A", "rad")), False: (("rad", "rad"),)}
"""Numerators and denominators on a linear and a rotary axis, by whether the numerator is a force."""


@dataclass(frozen=True)
class DriveUnits:
    """Settings of a servo as they are given."""

    table: TomlTable
    rotary: bool  # whether the axis is rotary
    gain: str = ""  # factor of the column of the force, which is the torque constant if its unit fits; empty if unknown

    def converted(self) -> TomlTable:
        """Return the settings as numbers in the units of the axis, with an integral gain instead of ``Tn``."""
        given = self.table.content
        integral, Tn = GAINS.get(str(given.get("law")), ("",))[-1], self._value("Tn")
        if "Tn" in given and integral in given:
            raise self.table.error(f"{self.table.where} has both Tn and {integral}; remove one of the two")
        if "Tn" in given and not (finite(Tn) or 0.0) > 0.0:
            raise self._error("Tn", 'give a reset time above 0 in s, or with a unit: "20 ms"')
        content = {name: self._value(name) for name in given if name not in OF_DRIVE}
        gain = finite(content.get("kv" if integral == "ki" else "Kp"))
        if Tn is not None and gain is not None:  # a missing gain is named when the gains are read
            content[integral] = gain / Tn
        return TomlTable(content, self.table.where, self.table.error)

    def _value(self, name: str) -> Any:
        """Return a text with a unit as a number, and any other value as it is."""
        value = self.table.content.get(name)
        if name not in QUANTITIES or not isinstance(value, str) or value == MISSING:
            return value
        quantity = QUANTITIES[name]
        number, unit = self._parsed(name, quantity.example)
        pairs = (_ROTARY if self.rotary else _LINEAR)[quantity.of_force]
        for pair in pairs:
            if _fits(unit, quantity.unit.format(*pair), inertia="s2" in quantity.unit):
                sizes = [self._size(name, symbol) for symbol in pair[: quantity.unit.count("{}")]]
                return number * unit.factor * math.prod(sizes[:1]) / math.prod(sizes[1:])
        fitting = ", ".join(dict.fromkeys(quantity.unit.format(*pair) for pair in pairs))
        fitting = fitting.replace("rad/s/rad", "1/s").replace("m/s/m", "1/s")
        axis = f"on a {'rotary' if self.rotary else 'linear'} axis, " if "{}" in quantity.unit else ""
        raise self._error(name, f'{axis}give it in {fitting} or multiples, such as "{quantity.example}"')

    def _size(self, name: str, symbol: str) -> float:
        """Return a unit of the drive in the unit of the axis."""
        if symbol == "A":
            return self._torque_constant(name)
        if self.rotary or symbol in ("N", "m"):
            return 1.0
        way = self._pitch(name) / (2.0 * math.pi)
        return way if symbol == "rad" else 1.0 / way

    def _torque_constant(self, name: str) -> float:
        """Return the force of the axis per ampere."""
        own = "torque_constant" in self.table
        try:
            number, unit = parse_quantity(self.gain, "") if not own else self._parsed("torque_constant", "0.5 N.m/A")
        except RecordError:
            number, unit = 0.0, BaseUnit()
        for force in ("N.m",) if self.rotary else ("N", "N.m"):
            if _fits(unit, f"{force}/A"):
                if own and number <= 0.0:
                    break
                return abs(number) * unit.factor * self._size(name, force)  # a column may count the other way
        if own:
            raise self._error("torque_constant", f"give it above 0 in N.m/A{'' if self.rotary else ' or N/A'}")
        raise self._error(name, 'add torque_constant = "0.5 N.m/A", or "60 N/A" of a linear motor, to convert it')

    def _pitch(self, name: str) -> float:
        """Return the way per turn of the motor [m]."""
        if "pitch" not in self.table:
            raise self._error(name, 'on a linear axis, add pitch = "10 mm", the way per turn, to convert it')
        number, unit = self._parsed("pitch", "10 mm")
        turn = 2.0 * math.pi if _fits(unit, "m/rad") else 1.0
        if number <= 0.0 or not (_fits(unit, "m/rad") or _fits(unit, "m")):
            raise self._error("pitch", 'give the way per turn of the motor with its unit, such as "10 mm"')
        return number * unit.factor * turn

    def _parsed(self, name: str, example: str) -> tuple[float, BaseUnit]:
        try:
            return parse_quantity(self.table.content[name], f"{self.table.where} {name}", example)
        except RecordError as error:
            raise self.table.error(str(error)) from error

    def _error(self, name: str, remedy: str) -> Exception:
        return self.table.error(f"{self.table.where} has {name} = {shown(self.table.content[name])}; {remedy}")


def _fits(unit: BaseUnit, name: str, inertia: bool = False) -> bool:
    """Return whether a unit has the dimension of another one; an inertia is in kg.m2 as well as in N.m/(rad/s2)."""
    known = parse_unit(name)
    assert known is not None
    return unit.exponents == known.exponents or (inertia and unit.exponents[:-1] == known.exponents[:-1])
