"""Observed order and error bound from runs with three steps (Richardson 1911).

The bound is the grid convergence index (Roache 1994): the difference to the next coarser run over 2^p - 1, times a
safety factor that is larger where the order is not the expected one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from harness.parts.part import Values

REGULAR: Final = 2.5
"""Safety factor for three runs that converge as expected. Roache has 1.25, for smooth solutions."""

IRREGULAR: Final = 3.0
"""Safety factor for two runs, or for three that converge faster or more slowly than expected."""

SLOWEST: Final = 0.5
"""Lowest observed order that counts as convergence."""

DEVIATION: Final = 0.7
"""Largest difference of the observed order from the expected one that is regular."""


ASYMPTOTIC: Final = 0.01
"""Largest difference over the range of a variable at which an observed order can be relied on."""


@dataclass(frozen=True)
class Convergence:
    """How runs with other steps approach this one."""

    order: float
    """Observed order; NaN if it cannot be observed."""
    factor: float
    """Error bound over the difference to the next run; infinite if the runs do not converge."""
    expected: float
    """The order that a shorter step can count on."""
    least: float = 0.0
    """Least difference that counts: runs that agree much better than the order explains do so by chance."""

    @property
    def resolved(self) -> bool:
        """Whether the runs converge."""
        return math.isfinite(self.factor)


def converge(near: Values, far: Values | None, most: float, size: float, floor: float, *, finer: bool) -> Convergence:
    """Return the convergence of a variable."""
    if finer:  # the order is not observed; at order 1, this run has twice the error of the next one
        return Convergence(math.nan, 2.0 * REGULAR, 1.0)
    if far is None:
        return Convergence(math.nan, IRREGULAR, 1.0)
    sizes = [(float(np.sqrt(np.mean(np.square(each)))), float(np.max(each))) for each in (near, far)]
    if max(sizes[0][1], sizes[1][1]) <= floor:
        return Convergence(math.nan, REGULAR, most)
    order = min(_order(*pair) for pair in zip(*sizes, strict=True))
    if sizes[0][1] <= floor:  # this run and the next one agree: what the third one does is its own affair
        return Convergence(order, IRREGULAR, 1.0)
    if order < SLOWEST:
        return Convergence(order, math.inf, math.nan)
    expected = min(order, most)
    regular = abs(order - most) <= DEVIATION and sizes[0][1] <= ASYMPTOTIC * size
    expected = expected if regular else min(expected, 1.0)
    least = sizes[1][1] / 2.0 ** (most + 1.0) if order > most + DEVIATION else 0.0
    return Convergence(order, (REGULAR if regular else IRREGULAR) / (2.0**expected - 1.0), expected, least)


def _order(near: float, far: float) -> float:
    if near > 0.0 and far > 0.0:
        return math.log2(far) - math.log2(near)
    return math.inf if far > 0.0 else -math.inf


def envelope(differences: Values, window: int) -> Values:
    """Return the largest difference within so many rows before and after each row."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(differences, 2 * window + 1, mode="nearest"))
