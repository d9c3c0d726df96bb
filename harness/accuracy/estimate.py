"""The error of each variable of a run, from the same run with other steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness.accuracy.alignment import Alignment, align, aligned_difference
from harness.accuracy.convergence import IRREGULAR, REGULAR, Convergence, converge, envelope
from harness.accuracy.oscillation import Oscillation, oscillation
from harness.parts.part import Values

Verdict: TypeAlias = Literal["right", "sensitive", "too coarse", "not resolved", "wrong"]
VERDICTS: Final[tuple[Verdict, ...]] = ("right", "sensitive", "too coarse", "not resolved", "wrong")
"""From the best to the worst."""

MUCH: Final = 3.0
"""By what factor events explain a difference, if it is one of time."""

AGREEMENT: Final = 0.05
"""Largest relative difference of periods and amplitudes of the same motion."""

REMEMBERED: Final = 0.5
"""Least bound over the largest one until then: a difference that is small by chance proves nothing."""

SMOOTHING: Final = 0.005
"""Half of the span over which a bound holds the largest difference, as a share of the run: differences pass zero."""

BLOCKS: Final = 8
"""Number of blocks of rows in that half span; the bound is constant in each block."""

LARGEST: Final = 1e30
"""Largest value of a run that is compared: beyond it, bounds in single precision overflow."""

NOTHING: Final = 1e-8
"""Largest value over the nominal value of a variable that counts as zero."""


@dataclass(frozen=True)
class Track:
    """One variable in one run."""

    ratio: Fraction
    """Step of this run, relative to that of the run to be judged."""
    stride: Fraction
    """Steps of the run in question between two rows."""
    start: float
    row: float
    """Time of the first row, and from one row to the next [s]."""
    values: Values
    """The rows."""

    @property
    def times(self) -> Values:
        """Times of the rows [s], not stored: they take as much memory as the values and are seldom needed."""
        return np.asarray(self.start + self.row * np.arange(len(self.values)))

    def together(self, other: Track) -> tuple[int, Values, Values]:
        """Return how many rows of this run it is from one common row to the next, and the values of both runs there."""
        unit = math.lcm(self.stride.denominator, other.stride.denominator)
        strides = int(self.stride * unit), int(other.stride * unit)
        every, others = (math.lcm(*strides) // stride for stride in strides)
        here, there = self.values[::every], other.values[::others]
        count = min(len(here), len(there))
        return every, here[:count], there[:count]


@dataclass(frozen=True)
class Estimate:
    """The error of a variable."""

    bound: NDArray[np.float32]
    """Error bound at each row, in the unit of the variable, rounded up."""
    relative: float
    """Its largest value over the range of the variable."""
    shift: float
    """Bound of the error of the times of events [s]; 0 if the runs were compared at equal times."""
    relative_shift: float
    """The same over the time between two events."""
    convergence: Convergence
    """Observed order."""
    verdict: Verdict
    """What may be concluded."""
    oscillation: Oscillation | None = None
    """Period and amplitude of a motion that no step reproduces at each time."""

    @property
    def largest(self) -> float:
        """Error bound over the whole run, in the unit of the variable."""
        return float(np.max(self.bound))

    @property
    def worst(self) -> float:
        """The larger of both relative errors, which the required accuracy limits."""
        return max(self.relative, self.relative_shift)


def estimate(tracks: Sequence[Track], *, most: float, noise: float, nominal: float, required: float) -> Estimate:
    """Return the error of a variable of the first run."""
    own = tracks[0]
    if not all(np.abs(track.values).max() < LARGEST for track in tracks):
        never = Convergence(math.nan, math.inf, math.nan)
        return Estimate(unbounded(len(own.values)), np.inf, 0.0, 0.0, never, "not resolved")
    size = max(size_of(own.values), NOTHING * nominal)
    floor, finer = noise * size, tracks[1].ratio < 1
    pairs = [*pairwise(tracks)]
    found = _at_equal_times(own, pairs, most, size, floor, finer=finer)
    if found.relative <= required:
        return found
    aligned = _at_events(own, pairs, most, size, floor, finer=finer)
    if aligned is not None and aligned.worst < found.relative / MUCH:
        found = aligned
    if found.worst <= required:
        return found
    if found.convergence.resolved and found.worst < 1.0:
        return replace(found, verdict="too coarse")
    moving = oscillation([(track.times, track.values) for track in tracks])
    if moving is not None and moving.worst <= AGREEMENT:
        return replace(found, verdict="sensitive", oscillation=moving)
    return replace(found, verdict="not resolved")


def size_of(values: Values) -> float:
    """Return the range of a variable, or the magnitude of one that is constant."""
    largest, span = float(np.max(np.abs(values))), float(np.ptp(values))
    return span if span > NOTHING * largest else largest


def unbounded(rows: int) -> NDArray[np.float32]:
    """Return an infinite bound, for a result of unknown error."""
    return np.full(rows, np.inf, dtype=np.float32)


def _upper(near: Values, far: Values | None, convergence: Convergence, floor: float) -> tuple[int, Values]:
    """Return the number of rows in a block, and the bound in each block.

    If the runs do not converge, all rows are one block, whose bound is a multiple of the largest difference.
    """
    if not convergence.resolved:
        most = float(np.max(near)) if far is None else max(float(np.max(near)), float(np.max(far)))
        return len(near), np.array([IRREGULAR * most + floor])
    window = max(4, int(SMOOTHING * len(near)))
    many = max(1, window // BLOCKS)
    peaks = np.maximum.reduceat(near, np.arange(0, len(near), many))
    differences = np.maximum(envelope(peaks, -(-window // many)), REMEMBERED * np.maximum.accumulate(peaks))
    largest = float(np.max(peaks))
    enough = max(1.0, convergence.least / largest) if largest > 0.0 else 1.0
    return many, differences * (enough * convergence.factor) + floor


def _spread(bounds: Values, many: int, rows: int) -> NDArray[np.float32]:
    """Return the bound at each row, rounded up, from those of blocks of ``many`` rows; the last holds to the end."""
    each = np.nextafter(bounds.astype(np.float32), np.float32(np.inf))
    return np.append(np.repeat(each, many)[:rows], np.full(max(0, rows - many * len(each)), each[-1]))


def _at_equal_times(
    own: Track, pairs: Sequence[tuple[Track, Track]], most: float, size: float, floor: float, *, finer: bool
) -> Estimate:
    """Return the estimate from differences at equal times."""
    differences = []
    for a, b in pairs:
        every, here, there = a.together(b)
        differences.append((every, np.abs(here - there)))
    every, near = differences[0]
    far = differences[1][1] if len(differences) > 1 else None
    convergence = converge(near, far, most, size, floor, finer=finer)
    many, upper = _upper(near, far, convergence, floor)
    bound = _spread(upper, many * every, len(own.values))
    return Estimate(bound, float(np.max(upper)) / size, 0.0, 0.0, convergence, "right")


def _at_events(
    own: Track, pairs: Sequence[tuple[Track, Track]], most: float, size: float, floor: float, *, finer: bool
) -> Estimate | None:
    """Return the estimate from differences at corresponding events, or None if there are none."""
    found: list[tuple[Alignment, Values]] = []
    for a, b in pairs:
        times, other_times = a.times, b.times
        count = int(np.searchsorted(times, other_times[-1] + 0.5 * a.row, side="right"))
        times, values = times[:count], a.values[:count]
        by = align(times, values, other_times, b.values)
        if by is None:
            break
        found.append((by, aligned_difference(times, values, other_times, b.values, by)))
    if not found:
        return None
    (events, near), *others = found
    far = others[0] if others else None
    sizes = converge(near, far[1] if far else None, most, size, floor, finer=finer)
    sizes = replace(sizes, factor=sizes.factor * IRREGULAR / REGULAR)  # what looks like a shift is taken for one
    shifts = np.abs(events.shifts), np.abs(far[0].shifts) if far else None
    late = converge(*shifts, most, events.interval, own.row, finer=finer)
    many, upper = _upper(near, far[1] if far else None, sizes, floor)
    bound = _spread(upper, many, len(own.values))
    shift = float(np.max(_upper(shifts[0], shifts[1], late, own.row)[1]))
    worse = late if not late.resolved or (sizes.resolved and late.expected < sizes.expected) else sizes
    return Estimate(bound, float(np.max(upper)) / size, shift, shift / events.interval, worse, "right")
