"""Units in SSP files, and what becomes of a value on its way through connectors (SSP 1.0, 4.5.3 and 4.5.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lxml import etree

from harness.errors import UnitError
from harness.ssp.document import SPACES, sub
from harness.units import BASE_SYMBOLS, LONGEST_UNIT, BaseUnit, conversion, parse_unit, stated_unit


def read_units(root: etree._Element, tag: str) -> dict[str, BaseUnit]:
    """The units that a document defines in its element ``tag`` (``ssd:Units`` or ``ssv:Units``), by name.

    Raises
    ------
    UnitError
        If a unit has numbers that no unit has.
    """
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
    """Append the element ``tag`` with these units, sorted; nothing if there are none."""
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
    """The unit of this name: as it is defined, else as its name says; None if neither says anything."""
    return base or (None if name is None else parse_unit(name))


def converted(source: BaseUnit, target: BaseUnit, where: str) -> tuple[float, float]:
    """Factor and offset that turn a number in one unit into a number in another.

    Raises
    ------
    UnitError
        If they measure different quantities.
    """
    numbers = conversion(source, target)
    if numbers is None:
        raise UnitError(f"{where} joins [{source}] and [{target}]: correct the units, they are different quantities")
    return numbers


@dataclass(frozen=True)
class Signal:
    """A value on its way: gain * (the value at the source, converted from the unit there to the unit here) + offset.

    Parameters
    ----------
    source : BaseUnit or None
        The first unit that was known on the way.
    unit : BaseUnit or None
        The unit that it has now.
    gain, offset : float
        What the connections have done so far, beside converting.
    """

    source: BaseUnit | None
    unit: BaseUnit | None
    gain: float = 1.0
    offset: float = 0.0

    def passed(self, unit: BaseUnit | None, factor: float, offset: float, suppress: bool, where: str) -> Signal:
        """The signal after a connection: converted first, then transformed, as SSP 1.0 says.

        Parameters
        ----------
        unit : BaseUnit or None
            Unit of the connector that it reaches.
        factor, offset : float
            Linear transformation of the connection.
        suppress : bool
            The number is taken as it is, whatever the units.
        where : str
            The connection, for messages.

        Raises
        ------
        UnitError
            If the units measure different quantities.
        """
        gain, rest = self.gain, self.offset
        if self.unit is not None and unit is not None:
            k, c = converted(self.unit, unit, where)
            if suppress:
                gain, rest = gain / k, rest - gain * c / k
            else:
                rest = k * rest + c * (1.0 - gain)
        return Signal(self.source or unit, unit or self.unit, factor * gain, factor * rest + offset)

    def number(self, where: str) -> tuple[float, float]:
        """Gain and offset from the number at the source to the number here, conversion included."""
        if self.source is None or self.unit is None:
            return self.gain, self.offset
        k, c = converted(self.source, self.unit, where)
        return self.gain * k, self.gain * c + self.offset
