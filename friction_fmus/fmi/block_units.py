"""Units of the blocks: base-unit exponents for the XML, and the quantity of each unit."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING

from friction_fmus.errors import FrictionError
from harness.units import BASE_SYMBOLS, LONGEST_UNIT, BaseUnit, is_unit_text

if TYPE_CHECKING:
    import pint

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
"""Attributes of the FMI element BaseUnit by pint's names."""

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
"""Physical quantity of each unit; it distinguishes torque and energy, which have the same exponents."""

DISPLAY_UNITS = {
    "m": (("mm", 1e3), ("um", 1e6)),
    "m/s": (("mm/s", 1e3),),
    "rad": (("deg", 57.29577951308232),),
    "rad/s": (("deg/s", 57.29577951308232), ("rev/min", 9.549296585513721)),
}
"""Display units of each unit, with factors: displayed value = factor x value."""


@cache
def _registry() -> pint.UnitRegistry[float]:
    import pint  # takes a third of a second

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    # rad is a base unit in FMI, but dimensionless in pint
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
    import pint

    return pint.UnitRegistry()


def _parsed(text: str, registry: pint.UnitRegistry[float]) -> BaseUnit:
    """Return a unit in base units. Only this function lets pint parse a text, as pint evaluates expressions."""
    if not is_unit_text(text):
        raise ValueError("it contains more than symbols, powers, products and quotients")
    expression = re.sub(r"([A-Za-z])([-+]?\d+)", r"\1**\2", text.strip().replace(".", "*"))
    quantity = registry.Quantity(1.0, registry.parse_units(expression)).to_base_units()
    powers = {BASE_UNITS[name]: float(str(power)) for name, power in quantity.unit_items()}
    factor = float(quantity.magnitude)
    if not (all(power.is_integer() for power in powers.values()) and 0.0 < factor < math.inf):
        raise ValueError("it has a fractional power, or a factor that is not a number")
    return BaseUnit(tuple(int(powers.get(symbol, 0)) for symbol in BASE_SYMBOLS), factor)


@cache
def base_unit(unit: str) -> BaseUnit:
    """Return exponents and factor of a unit such as ``N.s/m`` or ``kg.m2``."""
    try:
        return _parsed(unit, _registry())
    except Exception as error:  # see _parsed
        raise FrictionError(
            f"The unit {unit[:LONGEST_UNIT]!r} is unknown; write it in SI units, such as N.s/m"
        ) from error


@cache
def everyday_unit(unit: str) -> BaseUnit | None:
    """Return exponents and factor of any unit known to pint, such as ``rpm``, ``inch``, ``lbf``, or None."""
    try:
        return _parsed(unit, _everyday_registry())
    except Exception:  # see _parsed
        return None
