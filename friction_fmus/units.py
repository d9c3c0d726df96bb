"""Units of the blocks: base-unit exponents for the XML, and the quantity each unit measures."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

import pint

from friction_fmus.errors import FrictionError

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
def base_unit(unit: str) -> BaseUnit:
    """Exponents and factor of a unit such as ``N.s/m`` or ``kg.m2``.

    Raises
    ------
    FrictionError
        If the unit is not made of known units.
    """
    expression = re.sub(r"([A-Za-z])(-?\d+)", r"\1**\2", unit.replace(".", "*"))
    try:
        quantity = _registry().Quantity(1.0, _registry().parse_units(expression)).to_base_units()
    except Exception as error:  # pint raises many kinds, also for bad syntax
        raise FrictionError(f"The unit {unit!r} is not known; write it from SI units, such as N.s/m") from error
    exponents = {BASE_UNITS[name]: int(str(power)) for name, power in quantity.unit_items()}
    return BaseUnit({name: exponents[name] for name in BASE_UNITS.values() if name in exponents}, quantity.magnitude)
