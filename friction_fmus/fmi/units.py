"""Units of the blocks: base-unit exponents for the XML, and the quantity each unit measures."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache

import pint

from friction_fmus.errors import FrictionError
from harness.units import LONGEST_UNIT, is_unit_text

BASE_UNITS = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
"""pint's names -> the attributes of the FMI element BaseUnit."""

QUANTITIES = {
    "s": "Time",
    "Hz": "Frequency",
    "m": "Length",
    "m/s": "Velocity",
    "m/s2": "Acceleration",
    "m/s3": "Jerk",
    "kg": "Mass",
    "N": "Force",
    "N/m": "TranslationalStiffness",
    "N.s/m": "TranslationalDamping",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration",
    "rad/s3": "AngularJerk",
    "kg.m2": "MomentOfInertia",
    "N.m": "Torque",
    "N.m/rad": "RotationalStiffness",
    "N.m.s/rad": "RotationalDamping",
}
"""Unit -> physical quantity; torque and energy share exponents, so the quantity tells them apart."""

DISPLAY_UNITS = {
    "m": (("mm", 1e3), ("um", 1e6)),
    "m/s": (("mm/s", 1e3),),
    "rad": (("deg", 57.29577951308232),),
    "rad/s": (("deg/s", 57.29577951308232), ("rev/min", 9.549296585513721)),
}
"""Unit -> display units with factors: shown value = factor x value."""


@dataclass(frozen=True)
class BaseUnit:
    """A unit in base units: value in base units = factor x value + offset (offset is 0 here)."""

    exponents: dict[str, int]
    factor: float


@cache
def _registry() -> pint.UnitRegistry[float]:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    # FMI counts rad among the base units; pint's own definition makes it a number
    for name, symbol, dimension in (
        ("kilogram", "kg", "mass"),
        ("meter", "m", "length"),
        ("second", "s", "time"),
        ("ampere", "A", "current"),
        ("kelvin", "K", "temperature"),
        ("mole", "mol", "substance"),
        ("candela", "cd", "luminosity"),
        ("radian", "rad", "angle"),
    ):
        registry.define(f"{name} = [{dimension}] = {symbol}")
    for definition in (
        "hertz = 1 / second = Hz",
        "newton = kilogram * meter / second ** 2 = N",
        "joule = newton * meter = J",
        "watt = joule / second = W",
        "volt = watt / ampere = V",
    ):
        registry.define(definition)
    return registry


@cache
def _everyday_registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry()


def _parsed(text: str, registry: pint.UnitRegistry[float]) -> BaseUnit:
    """A unit in base units. The only place where pint parses a text: it evaluates all that it gets.

    Raises
    ------
    Exception
        Of many kinds: pint's, also for bad syntax and units with an offset; ValueError for what is no unit name.
    """
    if not is_unit_text(text):
        raise ValueError("it is not made of symbols, powers, products and quotients")
    expression = re.sub(r"([A-Za-z])([-+]?\d+)", r"\1**\2", text.strip().replace(".", "*"))
    quantity = registry.Quantity(1.0, registry.parse_units(expression)).to_base_units()
    powers = {BASE_UNITS[name]: float(str(power)) for name, power in quantity.unit_items()}
    factor = float(quantity.magnitude)
    if not (all(power.is_integer() for power in powers.values()) and 0.0 < factor < math.inf):
        raise ValueError("it has a fractional power, or a factor that is no number")
    return BaseUnit({name: int(powers[name]) for name in BASE_UNITS.values() if name in powers}, factor)


@cache
def base_unit(unit: str) -> BaseUnit:
    """Exponents and factor of a unit such as ``N.s/m`` or ``kg.m2``.

    Raises
    ------
    FrictionError
        If the unit is not made of known units.
    """
    try:
        return _parsed(unit, _registry())
    except Exception as error:  # see there
        raise FrictionError(
            f"The unit {unit[:LONGEST_UNIT]!r} is not known; write it from SI units, such as N.s/m"
        ) from error


@cache
def everyday_unit(unit: str) -> BaseUnit | None:
    """Exponents and factor of any unit that pint knows, such as ``rpm``, ``inch``, ``lbf``; None for others."""
    try:
        return _parsed(unit, _everyday_registry())
    except Exception:  # see there
        return None
