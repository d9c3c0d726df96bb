"""Alignment of two runs by their events, where a difference is one of time rather than of size.

A run that slips a millisecond later than another one differs from it by the whole slip at one time, and by next to
nothing otherwise. The events of a variable are its crossings of three levels, so that no knowledge of the model is
needed: a reversal of a velocity, a drop of a force at break-away and a flag that changes are all among them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from harness.parts.part import Values

LEVELS: Final = (0.2, 0.5, 0.8)
"""Levels, as shares of the range of the variable."""

HYSTERESIS: Final = 0.05
"""Half of the band around a level that a value must leave, as a share of the range."""

PAIRED: Final = 0.6
"""Least share of the crossings of a level that both runs must have."""

MOST_EVENTS: Final = 20_000
"""Largest number of crossings of a level; a variable with more of them is noise, which has no events."""


@dataclass(frozen=True)
class Alignment:
    """The events of one run in time, and how much later another run has them."""

    times: Values
    shifts: Values
    """Times of the events, in order, and by how much the other run is late [s]."""
    interval: float
    """Median time between two events of the same kind [s]; the duration of the run if there are too few."""

    def at(self, times: Values) -> Values:
        """Return by how much the other run is late at these times [s]."""
        return np.asarray(np.interp(times, self.times, self.shifts))


def crossings(times: Values, values: Values, level: float, band: float) -> tuple[Values, Values]:
    """Return the times [s] at which values cross a level and leave a band around it, and the directions."""
    above = values - level
    sides = (above >= band).view(np.int8) - (above <= -band).view(np.int8)
    ends = np.append(np.flatnonzero(sides[1:] != sides[:-1]), len(sides) - 1)
    ends = ends[sides[ends] != 0]  # the last rows of the spans outside of the band
    (turns,) = np.nonzero(sides[ends[1:]] != sides[ends[:-1]])
    if len(turns) > MOST_EVENTS:
        return np.zeros(0), np.zeros(0)
    ends, ways = ends[turns], sides[ends[turns + 1]]
    k = np.empty(len(turns), dtype=np.int64)
    for way, before in ((-1, above > 0.0), (1, above < 0.0)):
        rows = np.flatnonzero(before[:-1] & ~before[1:]) + 1
        mine = ways == way
        k[mine] = rows[np.searchsorted(rows, ends[mine], side="right")]
    share = above[k - 1] / (above[k - 1] - above[k])
    found = times[k - 1] + share * (times[k] - times[k - 1])
    return found, ways.astype(np.float64)


def align(times: Values, values: Values, other_times: Values, other_values: Values) -> Alignment | None:
    """Return the alignment of a variable in two runs, or None if their events do not correspond."""
    low, high = float(values.min()), float(values.max())
    if not high > low:
        return None
    events: list[tuple[float, float]] = [(float(times[0]), 0.0)]
    intervals: list[float] = []
    for share in LEVELS:
        level, band = low + share * (high - low), HYSTERESIS * (high - low)
        here, directions = crossings(times, values, level, band)
        there, others = crossings(other_times, other_values, level, band)
        for way in (1.0, -1.0):
            ours, theirs = here[directions == way], there[others == way]
            mine, partners = _pairs(ours, theirs)
            if len(mine) < PAIRED * max(len(ours), len(theirs)):
                continue  # the difference that remains shows it
            events += zip(ours[mine], theirs[partners] - ours[mine], strict=True)
        intervals += [float(gap) for gap in here[2:] - here[:-2]]
    if len(events) == 1:
        return None
    events.sort()
    found = np.array(events)
    return Alignment(found[:, 0], found[:, 1], float(np.median(intervals)) if intervals else float(np.ptp(times)))


def _pairs(ours: Values, theirs: Values) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of events that are each other's nearest ones; a short ringing may have more of them."""
    if not (len(ours) and len(theirs)):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    forth, back = _nearest(ours, theirs), _nearest(theirs, ours)
    (mine,) = np.nonzero(back[forth] == np.arange(len(ours)))
    return mine, forth[mine]


def _nearest(of: Values, to: Values) -> NDArray[np.int64]:
    """Return for each time the index of the nearest of other times, which are in order."""
    after = (
        np.clip(np.searchsorted(to, of), 1, max(len(to) - 1, 1)) if len(to) > 1 else np.ones(len(of), dtype=np.int64)
    )
    before = after - 1
    after = np.minimum(after, len(to) - 1)
    return np.where(np.abs(to[before] - of) <= np.abs(to[after] - of), before, after)


def aligned_difference(
    times: Values, values: Values, other_times: Values, other_values: Values, by: Alignment
) -> Values:
    """Return how far values are from what the other run has at the shifted times, give or take a row of this run."""
    row = times[1] - times[0]
    there = times + by.at(times)
    first, last = (np.interp(there + late, other_times, other_values) for late in (-row, row))
    low, high = np.minimum(first, last), np.maximum(first, last)
    other_row = other_times[1] - other_times[0]
    begin, end = (
        np.ceil((there + late - other_times[0]) / other_row).astype(np.int64).clip(0, len(other_times))
        for late in (-row, row)
    )
    for k in range(int(np.max(end - begin))):  # the rows in between, of which there are one or two
        inside = np.minimum(begin + k, end - 1)
        among = np.where(end > begin, other_values[np.clip(inside, 0, len(other_values) - 1)], first)
        low, high = np.minimum(low, among), np.maximum(high, among)
    return np.asarray(np.maximum(0.0, np.maximum(values - high, low - values)))
