"""What a condition says of a set of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

ROUNDING: Final = 1e-9
"""Share by which two numbers must differ to count as different.

Parameters are known to a few digits, and sums and products of them carry errors of some 1e-16: without a tolerance a
loop on the border of a condition gets an answer that depends on the order of the operations.
"""


@dataclass(frozen=True)
class Condition:
    """One condition, evaluated.

    Attributes
    ----------
    name : str
        Which condition it is.
    ok : bool
        Whether it holds.
    value, bound : float
        What was compared, in SI units; the texts say which way.
    wrong : str
        What is wrong, with the numbers; also of a condition that holds, as if it did not.
    why : str
        What happens then.
    change : str
        What to change.
    source : str
        Where the condition comes from.
    """

    name: str
    ok: bool
    value: float
    bound: float
    wrong: str
    why: str
    change: str
    source: str


def above(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is above a bound by more than rounding errors.

    Parameters
    ----------
    value, bound : float
        What is compared; NaN is above nothing.
    scale : float
        Size of the terms that the two were computed from, where they may have cancelled.
    """
    if math.isinf(value) or math.isinf(bound):
        return value > bound
    return value - bound > ROUNDING * max(abs(value), abs(bound), scale)


def below(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is below a bound by more than rounding errors, as `above`."""
    return above(bound, value, scale)


def at_least(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is above a bound, or equal to it within rounding errors."""
    return not (math.isnan(value) or math.isnan(bound) or below(value, bound, scale))


def at_most(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is below a bound, or equal to it within rounding errors."""
    return not (math.isnan(value) or math.isnan(bound) or above(value, bound, scale))


def remainder(value: float, taken: float) -> float:
    """Return a value less another one; exactly 0 if they are equal within rounding errors."""
    return value - taken if above(value, taken) or below(value, taken) else 0.0


def first_largest(values: Sequence[float]) -> int:
    """Return the index of the largest value; of those that are equal within rounding errors the first one."""
    largest = max(values)
    return next((i for i, value in enumerate(values) if at_least(value, largest)), 0)
