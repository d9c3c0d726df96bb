"""The result of a condition, and comparisons with a tolerance for rounding errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

ROUNDING: Final = 1e-9
"""Relative difference above which two numbers count as different.

Sums and products of parameters have relative rounding errors of about 1e-16. Without a tolerance, the answer for a loop
exactly on the boundary of a condition would depend on the order of the operations.
"""


@dataclass(frozen=True)
class Condition:
    """Result of evaluating one condition.

    Attributes
    ----------
    name : str
        Name of the condition.
    ok : bool
        Whether the condition holds.
    value, bound : float
        The two numbers compared, in SI units; `wrong` says in which direction.
    wrong : str
        What is wrong, with the numbers. A condition that holds has this text, too.
    why : str
        Consequence of a violation.
    change : str
        What to change.
    source : str
        Publication or derivation of the condition.
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
    """Return whether a value is above a bound by more than rounding errors."""
    if math.isinf(value) or math.isinf(bound):
        return value > bound
    return value - bound > ROUNDING * max(abs(value), abs(bound), scale)


def below(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is below a bound by more than rounding errors; see `above`."""
    return above(bound, value, scale)


def at_least(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is above a bound, or equal to it within rounding errors."""
    return not (math.isnan(value) or math.isnan(bound) or below(value, bound, scale))


def at_most(value: float, bound: float, scale: float = 0.0) -> bool:
    """Return whether a value is below a bound, or equal to it within rounding errors."""
    return not (math.isnan(value) or math.isnan(bound) or above(value, bound, scale))


def remainder(value: float, taken: float) -> float:
    """Return ``value - taken``, or exactly 0 if the two are equal within rounding errors."""
    return value - taken if above(value, taken) or below(value, taken) else 0.0


def first_largest(values: Sequence[float]) -> int:
    """Return the index of the first value that equals the largest one within rounding errors."""
    largest = max(values)
    return next((i for i, value in enumerate(values) if at_least(value, largest)), 0)
