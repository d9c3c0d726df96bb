"""The error of each variable of a run, from the same run with other steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from harness.parts.part import Values

# Alignment of two runs by their events, where a difference is one of time rather than of size.
#
# A run that slips a millisecond later than another one differs from it by the whole slip at one time, and by next to
# nothing otherwise. The events of a variable are its crossings of three levels, so that no knowledge of the model is
# needed: a reversal of a velocity, a drop of a force at break-away and a flag that changes are all among them.

LEVELS: Final = (0.2, 0.5, 0.8)  # levels, as shares of the range of the variable
HYSTERESIS: Final = 0.05  # half of the band around a level that a value must leave, as a share of the range
PAIRED: Final = 0.6  # least share of the crossings of a level that both runs must have
MOST_EVENTS: Final = 20_000  # most crossings of a level; a variable with more is noise, which has no events


@dataclass(frozen=True)
class Alignment:
    """The events of one run in time, and how much later another run has them."""

    times: Values  # times of the events, in order [s]
    shifts: Values  # by how much the other run is late [s]
    interval: float  # median time between two events of the same kind [s]; the duration of the run if there are too few

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
    ends, signs = ends[turns], sides[ends[turns + 1]]
    k = np.empty(len(turns), dtype=np.int64)
    for direction, before in ((-1, above > 0.0), (1, above < 0.0)):
        rows = np.flatnonzero(before[:-1] & ~before[1:]) + 1
        mine = signs == direction
        k[mine] = rows[np.searchsorted(rows, ends[mine], side="right")]
    share = above[k - 1] / (above[k - 1] - above[k])
    found = times[k - 1] + share * (times[k] - times[k - 1])
    return found, signs.astype(np.float64)


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
        for direction in (1.0, -1.0):
            ours, theirs = here[directions == direction], there[others == direction]
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


SETTLED: Final = 1 / 3  # share of a run that may pass until it is periodic
FEWEST: Final = 4  # fewest periods of an oscillation


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


# Observed order and error bound from runs with three steps (Richardson 1911).
#
# The bound is the grid convergence index (Roache 1994): the difference to the next coarser run over 2^p - 1, times a
# safety factor that is larger where the order is not the expected one.

REGULAR: Final = 2.5  # safety factor for three runs that converge as expected. Roache has 1.25, for smooth solutions
IRREGULAR: Final = 3.0  # safety factor for two runs, or for three that converge faster or more slowly than expected
SLOWEST: Final = 0.5  # lowest observed order that counts as convergence
DEVIATION: Final = 0.7  # largest difference of the observed order from the expected one that is regular
ASYMPTOTIC: Final = 0.01  # largest difference over the range of a variable at which an observed order can be relied on


@dataclass(frozen=True)
class Convergence:
    """How runs with other steps approach this one."""

    order: float  # observed order; NaN if it cannot be observed
    factor: float  # error bound over the difference to the next run; infinite if the runs do not converge
    expected: float  # the order that a shorter step can count on
    least: float = 0.0  # least difference that counts: runs that agree much better do so by chance

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
    with np.errstate(over="ignore"):  # a run that grows beyond all limits
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
    """Return the largest difference within this number of rows before and after each row."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(differences, 2 * window + 1, mode="nearest"))


Verdict: TypeAlias = Literal[
    "within tolerance", "sensitive", "step too long", "not certain", "not converged", "invalid"
]
VERDICTS: Final[tuple[Verdict, ...]] = get_args(Verdict)
"""From the best to the worst."""

MUCH: Final = 3.0  # by what factor events explain a difference, if it is one of time
AGREEMENT: Final = 0.05  # largest relative difference of periods and amplitudes of the same motion
REMEMBERED: Final = 0.5  # least bound over the largest one until then: a chance agreement proves nothing
SMOOTHING: Final = 0.005  # half of the span of a bound, as a share of the run: differences pass zero
BLOCKS: Final = 8  # number of blocks of rows in that half span; the bound is constant in each block
LARGEST: Final = 1e30  # largest value of a run that is compared: beyond it, bounds in single precision overflow
NOTHING: Final = 1e-8  # largest value over the nominal value of a variable that counts as zero


@dataclass(frozen=True)
class Track:
    """One variable in one run."""

    ratio: Fraction  # step of this run, relative to that of the run to be judged
    stride: Fraction  # steps of the run in question between two rows
    start: float  # time of the first row [s]
    row: float  # time from one row to the next [s]
    values: Values  # the rows

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
class ErrorEstimate:
    """The error of a variable."""

    bound: NDArray[np.float32]  # error bound at each row, in the unit of the variable, rounded up
    relative: float  # its largest value over the range of the variable
    shift: float  # bound of the error of the times of events [s]; 0 if the runs were compared at equal times
    relative_shift: float  # the same over the time between two events
    convergence: Convergence  # observed order
    verdict: Verdict  # what may be concluded
    oscillation: Oscillation | None = None  # period and amplitude of a motion that no step reproduces at each time

    @property
    def largest(self) -> float:
        """Error bound over the whole run, in the unit of the variable."""
        return float(np.max(self.bound))

    @property
    def worst(self) -> float:
        """The larger of both relative errors, which the required accuracy limits."""
        return max(self.relative, self.relative_shift)


def estimate(tracks: Sequence[Track], *, most: float, noise: float, nominal: float, required: float) -> ErrorEstimate:
    """Return the error of a variable of the first run."""
    own = tracks[0]
    if not all(np.abs(track.values).max() < LARGEST for track in tracks):
        never = Convergence(math.nan, math.inf, math.nan)
        return ErrorEstimate(unbounded(len(own.values)), np.inf, 0.0, 0.0, never, "not converged")
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
        return replace(found, verdict="step too long")
    moving = oscillation([(track.times, track.values) for track in tracks])
    if moving is not None and moving.worst <= AGREEMENT:
        return replace(found, verdict="sensitive", oscillation=moving)
    return replace(found, verdict="not converged")


OTHER: Final = 1.5  # error bound over the difference to newton, which has an error of its own


def compare(one: ErrorEstimate, own: Track, other: Track, *, nominal: float, required: float) -> ErrorEstimate:
    """Return the estimate, raised to the difference to a run of another master where that exceeds what is required."""
    # A mass that swings several times within each step follows the held force of its contact at any such step: its runs
    # agree with each other, not with the truth.
    every, here, there = own.together(other)
    beyond = np.maximum(np.abs(here - there) - one.bound[::every][: len(here)], 0.0)
    size = max(size_of(own.values), NOTHING * nominal)
    if float(np.max(beyond)) <= required * size:
        return one
    if (found := _at_shifted_times(own, other)) is not None:
        by, differences = found
        late = float(np.max(np.abs(by.shifts))) - one.shift - other.row
        aligned = np.maximum(differences - one.bound[: len(differences)], 0.0)
        if late <= required * by.interval and float(np.max(aligned)) < float(np.max(beyond)):
            beyond = aligned
    largest = float(np.max(beyond))
    if largest <= required * size:
        return one
    bound = _spread(one.bound.astype(np.float64) + OTHER * largest, 1, len(one.bound))
    return replace(one, bound=bound, relative=float(np.max(bound)) / size, verdict="not certain")


def size_of(values: Values) -> float:
    """Return the range of a variable, or the magnitude of one that is constant."""
    largest, span = float(np.max(np.abs(values))), float(np.ptp(values))
    return span if span > NOTHING * largest else largest


def unbounded(rows: int) -> NDArray[np.float32]:
    """Return an infinite bound, for a result of unknown error."""
    return np.full(rows, np.inf, dtype=np.float32)


def _upper(near: Values, far: Values | None, convergence: Convergence, floor: float) -> tuple[int, Values]:
    """Return the number of rows in a block, and the bound in each block."""
    # If the runs do not converge, all rows are one block, whose bound is a multiple of the largest difference.
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


def _at_shifted_times(own: Track, other: Track) -> tuple[Alignment, Values] | None:
    """Return the alignment of two runs and their differences with it, or None if their events do not correspond."""
    times, there = own.times, other.times
    times = times[: int(np.searchsorted(times, there[-1] + 0.5 * own.row, side="right"))]
    values = own.values[: len(times)]
    by = align(times, values, there, other.values)
    return None if by is None else (by, aligned_difference(times, values, there, other.values, by))


def _at_equal_times(
    own: Track, pairs: Sequence[tuple[Track, Track]], most: float, size: float, floor: float, *, finer: bool
) -> ErrorEstimate:
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
    return ErrorEstimate(bound, float(np.max(upper)) / size, 0.0, 0.0, convergence, "within tolerance")


def _at_events(
    own: Track, pairs: Sequence[tuple[Track, Track]], most: float, size: float, floor: float, *, finer: bool
) -> ErrorEstimate | None:
    """Return the estimate from differences at corresponding events, or None if there are none."""
    first = _at_shifted_times(*pairs[0])
    if first is None:
        return None
    events, near = first
    far = _at_shifted_times(*pairs[1]) if len(pairs) > 1 else None
    sizes = converge(near, far[1] if far else None, most, size, floor, finer=finer)
    sizes = replace(sizes, factor=sizes.factor * IRREGULAR / REGULAR)  # what looks like a shift is taken for one
    shifts = np.abs(events.shifts), np.abs(far[0].shifts) if far else None
    late = converge(*shifts, most, events.interval, own.row, finer=finer)
    many, upper = _upper(near, far[1] if far else None, sizes, floor)
    bound = _spread(upper, many, len(own.values))
    shift = float(np.max(_upper(shifts[0], shifts[1], late, own.row)[1]))
    worse = late if not late.resolved or (sizes.resolved and late.expected < sizes.expected) else sizes
    return ErrorEstimate(bound, float(np.max(upper)) / size, shift, shift / events.interval, worse, "within tolerance")
