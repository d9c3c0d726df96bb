"""Units of the blocks: base-unit exponents for the XML, and the quantity of each unit."""

from friction_fmus.errors import FrictionError
from harness.units import LONGEST_UNIT, BaseUnit, parse_unit

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


def base_unit(unit: str) -> BaseUnit:
    """Return exponents and factor of a unit such as ``N.s/m`` or ``kg.m2``."""
    found = parse_unit(unit)
    if found is None or (found.factor, found.offset) != (1.0, 0.0):
        raise FrictionError(f"The unit {unit[:LONGEST_UNIT]!r} is unknown; write it in SI units, such as N.s/m")
    return found
