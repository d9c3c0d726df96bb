"""The floating-point types of C."""

from __future__ import annotations

import math
from dataclasses import dataclass

from friction_fmus.errors import FrictionError


@dataclass(frozen=True)
class Real:
    """A floating-point type of C."""

    name: str
    """C keyword."""
    suffix: str
    """Suffix of literals and of the functions in <math.h>."""
    infinity: str
    """Expression for infinity."""
    largest: float
    """Largest finite number."""
    smallest: float
    """Smallest magnitude of a constant other than zero: a guard against division by zero must not become zero."""
    bound: float = 0.0
    """Largest magnitude of an input, so that its square does not overflow; 0 if each finite number is accepted."""

    def literal(self, value: float) -> str:
        """Return the shortest literal that reads back as this number."""
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return f"-{self.infinity}" if value < 0.0 else self.infinity
        if abs(value) > self.largest:
            raise FrictionError(f"The constant {value!r} is too large for the C type {self.name}")
        if 0.0 < abs(value) < self.smallest:
            value = math.copysign(self.smallest, value)
        return repr(float(value)) + self.suffix


DOUBLE = Real("double", "", "HUGE_VAL", math.inf, 0.0)
FLOAT = Real("float", "f", "HUGE_VALF", 3.4028234e38, 1.1754944e-38, 1e9)
