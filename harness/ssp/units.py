"""Units in SSP files, and unit conversion along connections (SSP 1.0, 4.5.3 and 4.5.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lxml import etree

from harness.errors import UnitError
from harness.ssp.package import SPACES, sub
from harness.units import BASE_SYMBOLS, LONGEST_UNIT, BaseUnit, conversion, parse_unit, stated_unit


def read_units(root: etree._Element, tag: str) -> dict[str, BaseUnit]:
    """Return the units that a document defines in its element ``tag`` (``ssd:Units`` or ``ssv:Units``), by name."""
    units = {}
    for unit in root.iterfind(f"{tag}/ssc:Unit", SPACES):
        base = unit.find("ssc:BaseUnit", SPACES)
        assert base is not None  # the document is valid
        try:
            exponents = [int(base.get(symbol, "0")) for symbol in BASE_SYMBOLS]
            stated = stated_unit(exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
        except ValueError as error:
            name = unit.get("name", "")[:LONGEST_UNIT]
            raise UnitError(f"the unit '{name}' is malformed ({error}): correct it in {tag}") from error
        units[unit.get("name", "")] = stated
    return units


def write_units(parent: etree._Element, tag: str, units: Mapping[str, BaseUnit]) -> None:
    """Append the element ``tag`` with these units, sorted by name, unless there are none."""
    if not units:
        return
    element = sub(parent, tag)
    for name, unit in sorted(units.items()):
        powers = {symbol: str(power) for symbol, power in zip(BASE_SYMBOLS, unit.exponents, strict=True) if power}
        base = sub(sub(element, "ssc:Unit", name=name), "ssc:BaseUnit", **powers)
        if unit.factor != 1.0:
            base.set("factor", repr(unit.factor))
        if unit.offset != 0.0:
            base.set("offset", repr(unit.offset))


def known_unit(name: str | None, base: BaseUnit | None) -> BaseUnit | None:
    """Return the unit with this name, as defined or else derived from the name; None if it is unknown."""
    return base or (None if name is None else parse_unit(name))


def converted(source: BaseUnit, target: BaseUnit, where: str) -> tuple[float, float]:
    """Return factor and offset that convert a number from one unit to another."""
    numbers = conversion(source, target)
    if numbers is None:
        raise UnitError(
            f"{where} joins [{source}] and [{target}], which measure different quantities: correct the units"
        )
    return numbers


@dataclass(frozen=True)
class Signal:
    """A value along a chain of connections: gain * (source value in the current unit) + offset."""

    source: BaseUnit | None
    """The first known unit of the chain."""
    unit: BaseUnit | None
    """The current unit."""
    gain: float = 1.0
    offset: float = 0.0
    """Transformation by the connections so far, without unit conversion."""

    def passed(self, unit: BaseUnit | None, factor: float, offset: float, suppress: bool, where: str) -> Signal:
        """Return the signal after a connection: first converted, then transformed, as SSP 1.0 requires."""
        gain, rest = self.gain, self.offset
        if self.unit is not None and unit is not None:
            k, c = converted(self.unit, unit, where)
            if suppress:
                gain, rest = gain / k, rest - gain * c / k
            else:
                rest = k * rest + c * (1.0 - gain)
        return Signal(self.source or unit, unit or self.unit, factor * gain, factor * rest + offset)

    def number(self, where: str) -> tuple[float, float]:
        """Return gain and offset from the number at the source to the number here, including unit conversion."""
        if self.source is None or self.unit is None:
            return self.gain, self.offset
        k, c = converted(self.source, self.unit, where)
        return self.gain * k, self.gain * c + self.offset
