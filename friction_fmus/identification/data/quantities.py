"""Units of the columns of a data file, and conversion to the units of a record."""

from __future__ import annotations

import math
import re

from friction_fmus.fmi.units import everyday_unit
from friction_fmus.identification.data.record import LINEAR, ROTARY, AxisUnits
from friction_fmus.identification.errors import RecordError
from harness.units import BASE_SYMBOLS, LONGEST_UNIT, BaseUnit, parse_unit

QUANTITY = {
    "time": "time",
    "position": "position",
    "velocity": "velocity",
    "reference": "position",
    "force": "force",
    "friction": "force",
    "normal": "normal",
    "injected": "force",
}
"""Physical quantity of each role of a column."""

_LONGEST = 2 * LONGEST_UNIT
"""Largest number of characters of a number with a unit."""

DRIVE_UNITS = {
    **dict.fromkeys(("1/min", "min-1", "min^-1"), "rpm"),
    **dict.fromkeys(("Sek", "sek", "Sekunden", "Sekunde"), "s"),
    **{"Grad": "deg", "grad": "deg", "Grad/s": "deg/s"},
}
"""Units as drives write them, which mean something else or nothing in a model."""

_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")


def unit_of(text: str) -> BaseUnit | None:
    """Return the base unit of a unit such as ``mm``, ``N.m``, ``rpm``; None if the unit is unknown."""
    symbol = DRIVE_UNITS.get(text.strip(), text)
    known = parse_unit(symbol)
    if known is not None or not symbol.strip():
        return known
    rare = everyday_unit(symbol)
    return None if rare is None else BaseUnit(tuple(rare.exponents.get(s, 0) for s in BASE_SYMBOLS), rare.factor)


def wanted_unit(role: str, units: AxisUnits) -> str:
    """Return the unit of a role, such as ``position``, in a record."""
    return {
        "time": "s",
        "position": units.position,
        "velocity": units.velocity,
        "force": units.force,
        "normal": LINEAR.force,
    }[QUANTITY[role]]


def fits(role: str, unit: BaseUnit) -> bool:
    """Return whether a unit is valid for a role, on a linear or a rotary axis."""
    return any(unit.exponents == _exponents(wanted_unit(role, units)) for units in (LINEAR, ROTARY))


def axis_units(role: str, unit: BaseUnit) -> AxisUnits | None:
    """Return the axis units implied by the unit of a position, velocity or reference; None for other roles."""
    if QUANTITY[role] not in ("position", "velocity"):
        return None
    return LINEAR if unit.exponents == _exponents(wanted_unit(role, LINEAR)) else ROTARY


def factor(role: str, unit: BaseUnit, units: AxisUnits) -> float | None:
    """Return the conversion factor from a unit to the unit of the record; None if the quantities differ."""
    return unit.factor if unit.exponents == _exponents(wanted_unit(role, units)) else None


def parse_quantity(text: str | float, where: str) -> tuple[float, BaseUnit]:
    """Return number and unit of a text such as ``35.15 N/V``; a number alone has the unit 1."""
    given = str(text)
    match = _NUMBER.fullmatch(given) if len(given) <= _LONGEST and not isinstance(text, bool) else None
    unit = unit_of(match[2] or "1") if match else None
    if match is None or unit is None or not 0.0 < abs(float(match[1])) < math.inf:
        raise RecordError(
            f"{where} is {given[:_LONGEST]!r}, which is not a number with a known unit; use the form '35.15 N/V'."
        )
    return float(match[1]), unit


def times(a: BaseUnit, b: BaseUnit) -> BaseUnit:
    """Return the product of two units."""
    return BaseUnit(tuple(i + j for i, j in zip(a.exponents, b.exponents, strict=True)), a.factor * b.factor)


def _exponents(unit: str) -> tuple[int, ...]:
    known = parse_unit(unit)
    assert known is not None
    return known.exponents
