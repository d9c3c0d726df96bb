"""Period and amplitude of a motion that no step reproduces at each time, such as hunting or chaotic stick-slip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from harness.accuracy.alignment import HYSTERESIS, crossings
from harness.parts.part import Values

SETTLED: Final = 1 / 3
"""Share of a run that may pass until it is periodic."""

FEWEST: Final = 4
"""Fewest periods of an oscillation."""


@dataclass(frozen=True)
class Oscillation:
    """Period and amplitude of a variable, with their errors."""

    period: float
    amplitude: float
    """Means over the periods of the run in question: the time between two upward crossings of the middle [s], and half
    of the difference of the largest and the smallest value between them."""
    period_error: float
    amplitude_error: float
    """The largest difference to the other runs, or twice the standard error of the mean if that is larger."""

    @property
    def worst(self) -> float:
        """The larger relative error."""
        return max(self.period_error / self.period, self.amplitude_error / self.amplitude)


def oscillation(runs: Sequence[tuple[Values, Values]]) -> Oscillation | None:
    """Return the oscillation of a variable, or None if it does not oscillate in all runs."""
    found = []
    for times, values in runs:
        one = _periods(times, values)
        if one is None:
            return None
        found.append(one)
    means = np.array([[float(np.mean(each)) for each in one] for one in found])
    spread = [2.0 * float(np.std(each, ddof=1)) / math.sqrt(len(each)) for each in found[0]]
    errors = [max(float(np.max(np.abs(means[1:, k] - means[0, k]))), spread[k]) for k in (0, 1)]
    return Oscillation(float(means[0, 0]), float(means[0, 1]), errors[0], errors[1])


def _periods(times: Values, values: Values) -> tuple[Values, Values] | None:
    """Return the duration and the amplitude of each period."""
    begin = int(SETTLED * len(times))
    t, y = times[begin:], values[begin:]
    low, high = float(y.min()), float(y.max())
    if not high > low:
        return None
    at, directions = crossings(t, y, 0.5 * (low + high), 2.0 * HYSTERESIS * (high - low))
    ups = at[directions > 0.0]
    if len(ups) < FEWEST + 1:
        return None
    cuts = np.searchsorted(t, ups)
    parts = [y[a:b] for a, b in pairwise(cuts)]
    return np.diff(ups), np.array([0.5 * float(np.ptp(part)) for part in parts])
