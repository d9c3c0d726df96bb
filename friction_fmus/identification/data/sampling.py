"""Times of a measurement: order, gaps, changes of the rate, and equal intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter
from scipy.signal import savgol_filter

from friction_fmus.blocks.axis_units import SLIDING, Words
from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import JITTER, Array, RecordFinding
from friction_fmus.identification.data.tables import DataTable

GAP = 5.0  # ratio of an interval to those beside it above which it is a gap, across which nothing is interpolated
SHORTEST = 50  # smallest number of samples of a segment
SMOOTH = ("q", "v", "reference")  # columns that are smooth because of inertia; the others are interpolated linearly

RATE: Final = 1.5  # ratio of the usual intervals before and after a sample at which the sample rate changes
NEAR: Final = 10  # number of intervals on either side that give the usual one
ALIKE: Final = 0.8  # least share of them that are about the usual one where the rate changes
RESTARTS: Final = 50  # largest number of logs that are taken to be joined in a file
WRONG: Final = 0.05  # largest fraction of times that are replaced by those of a regular clock


@dataclass(frozen=True, eq=False)
class SampledSegment:
    """Equally spaced segment of a measurement without gaps."""

    t: Array  # time [s]
    columns: Mapping[str, Array]  # other columns


def in_order(
    table: DataTable, t: Array, columns: dict[str, Array], findings: list[RecordFinding]
) -> tuple[Array, dict[str, Array]]:
    """Return the rows of a file at increasing times, where the order is certain; otherwise raise RecordError."""
    # The column ``row`` with the numbers of the rows is removed. Repeated rows are dropped, rows of another order
    # sorted, joined logs put one after the other, and single wrong times or times with few digits replaced by a regular
    # clock.
    rows = columns.pop("row")
    if len(t) < SHORTEST:
        raise RecordError(f"{table.file} has {len(t)} samples; an identification needs at least {SHORTEST}.")
    wrong = np.flatnonzero(np.diff(t) <= 0.0)
    if not wrong.size:
        return t, columns
    place = table.place(int(rows[wrong[0] + 1]))
    same = np.concatenate([[False], np.all([np.diff(values) == 0.0 for values in (t, *columns.values())], axis=0)])
    if not (same.any() and _regular(t[~same])) and (clock := _coarse_clock(t)) is not None:
        what = f"The times are repeated, first in {place}; with {len(t)} rows at a regular rate they are rounded."
        findings.append(RecordFinding("rounded-time", what, "Log the time with more digits."))
        return clock, columns
    if same.any():
        what = f"{np.count_nonzero(same)} rows repeat the one before them, the first in {place}; they are ignored."
        findings.append(RecordFinding("repeated-rows", what, "Log each sample once."))
        t, columns, rows = t[~same], {name: values[~same] for name, values in columns.items()}, rows[~same]
        wrong = np.flatnonzero(np.diff(t) <= 0.0)
        if not wrong.size:
            return t, columns
    at = int(wrong[0]) + 1
    place, count = table.place(int(rows[at])), _times(wrong.size)
    order = np.argsort(t, kind="stable")
    if _regular(t[order]):
        what = f"The rows are not in the order of their times: the time decreases {count}, first in {place}."
        findings.append(RecordFinding("unsorted-rows", what, "They are sorted; log in the order of time."))
        return t[order], {name: values[order] for name, values in columns.items()}
    if (clock := _without_wrong_times(t)) is not None:
        what = f"{np.count_nonzero(clock != t)} times do not fit the regular clock of the others, the first in {place}."
        findings.append(RecordFinding("wrong-times", what, "They are replaced; check how the time is logged."))
        return clock, columns
    begins = wrong + 1
    lengths = np.diff([0, *begins, len(t)])
    if (
        begins.size <= RESTARTS
        and np.all(lengths >= 3)
        and np.median(lengths) >= SHORTEST
        and np.all(t[begins] - t[wrong] < -2.0 * GAP * np.median(np.diff(t)))
    ):
        what = (
            f"The time goes back from {t[at - 1]:.9g} s to {t[at]:.9g} s in {place} ({count} in the file); the logs "
            "that are joined there are separate segments, one after the other."
        )
        moved = t.copy()
        for begin, end in pairwise([*begins, len(t)]):
            pause = 2.0 * GAP * float(np.median(np.diff(t[begin:end])))
            moved[begin:end] += moved[begin - 1] - t[begin] + pause
        if np.all(np.diff(moved) > 0.0):
            findings.append(RecordFinding("joined-logs", what, "Windows count from the start of the first log."))
            return moved, columns
    if t[at] == t[at - 1]:
        raise RecordError(
            f"{table.file} has the time {t[at]:.9g} s twice, the second time in {place} ({count} in the file); "
            'remove duplicate rows, log the time with more digits, or use time = {{ period = "..." }}.'
        )
    raise RecordError(
        f"The time in {table.file} decreases from {t[at - 1]:.9g} s to {t[at]:.9g} s in {place} ({count} in the "
        "file); sort the rows, or split the file there if the log was restarted."
    )


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _coarse_clock(t: Array) -> Array | None:
    """Return the regular times that rounded to their last digit are those given; None if there are none."""
    digits = _digits(t)
    if np.any(np.diff(t) < 0.0) or not 0.0 < digits <= 0.02 * (t[-1] - t[0]):
        return None
    line, slope = _clock(t)
    return line if slope > 0.0 and np.max(np.abs(t - line)) <= 0.6 * digits else None


def _clock(t: Array) -> tuple[Array, float]:
    """Return the equally spaced times nearest to those given, and their interval."""
    k = np.arange(len(t))
    slope, begin = np.polyfit(k, t - t[0], 1)
    return t[0] + begin + slope * k, slope


def _regular(t: Array) -> bool:
    """Return whether times have equal intervals, except for gaps."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    return usual > 0.0 and bool(np.all((np.abs(steps / usual - 1.0) <= 0.2) | (steps > GAP * usual)))


def _without_wrong_times(t: Array) -> Array | None:
    """Return times whose single wrong ones are those of the regular clock of the others; None if there is none."""
    k = np.arange(len(t))
    half = len(t) // 2
    slope = float(np.median((t[half:] - t[: len(t) - half]) / half))
    if slope <= 0.0:
        return None
    begin = float(np.median(t - slope * k))
    line = begin + slope * k
    digits = _digits(t)
    wrong = np.abs(t - line) > max(0.2 * slope, 0.6 * digits if digits < 0.9 * slope else 0.0)
    repaired = np.where(wrong, line, t)
    alone = not np.any(wrong[3:] & wrong[2:-1] & wrong[1:-2] & wrong[:-3])
    return repaired if alone and np.mean(wrong) <= WRONG and np.all(np.diff(repaired) > 0.0) else None


def equally_spaced(
    t: Array, columns: Mapping[str, Array], u: Words = SLIDING
) -> tuple[list[SampledSegment], list[RecordFinding]]:
    """Split a measurement at gaps and where its rate changes, and convert each segment to equal intervals."""
    # A segment whose intervals deviate by more than 1 % from their mean gets a new time grid. If the times are equally
    # spaced except for rounding, or deviate from a regular clock that explains the motion better, samples are not
    # interpolated. Otherwise they are resampled at the median interval by a cubic spline (position, velocity,
    # reference) or linearly (forces, which may jump). The result contains no information above half the local sample
    # rate.
    steps = np.diff(t)
    cuts, changes = _cuts(steps)
    findings = []
    if cuts.size:
        longest = float(steps[cuts].max())
        at, usual = cuts[int(np.argmax(steps[cuts]))], float(np.median(steps))
        what = (
            f"The record has {cuts.size} gap{'s' * (cuts.size > 1)}, the longest of {longest:.4g} s after "
            f"t = {t[at]:.6g} s (median interval {usual:.4g} s); it is split at each gap."
        )
        findings.append(RecordFinding("gaps", what, "Log without pauses: each segment needs its own initial state."))
    if changes.size:
        before, after = steps[: changes[0]], steps[changes[0] + 1 : (*changes[1:], None)[0]]
        what = (
            f"The interval changes {_times(changes.size)}, first from {_usual(before):.4g} s to {_usual(after):.4g} s "
            f"at t = {t[changes[0]]:.6g} s; the record is split there."
        )
        findings.append(RecordFinding("rate-change", what, "Log at one rate."))
    starts = np.concatenate([[0], np.sort(np.concatenate([cuts, changes])) + 1, [len(t)]])
    spans = [slice(int(a), int(b)) for a, b in pairwise(starts)]
    long_enough = [span for span in spans if span.stop - span.start >= SHORTEST]
    if len(long_enough) < len(spans):
        lost = sum(span.stop - span.start for span in spans if span not in long_enough)
        what = f"{len(spans) - len(long_enough)} segments with {lost} samples in total are too short and are ignored."
        findings.append(RecordFinding("short-pieces", what, f"Log at least {SHORTEST} samples without a gap."))
    segments, rounded, resampled, regular = [], [], [], []
    for span in long_enough:
        part = {name: values[span] for name, values in columns.items()}
        grid, method = _grid(t[span], part)
        if method == "resampled":
            part = {name: _interpolated(name, t[span], values, grid) for name, values in part.items()}
            resampled.append(t[span])
        elif method == "rounded":
            rounded.append(_digits(t[span]))
        elif method == "regular":
            regular.append(np.abs(t[span] - grid).max() / (grid[1] - grid[0]))
        segments.append(SampledSegment(grid, part))
    if rounded:
        what = f"The times are rounded to {max(rounded):.3g} s; they are replaced by equally spaced times."
        findings.append(RecordFinding("rounded-time", what, "Log the time with more digits."))
    if regular:
        what = (
            f"The times deviate from a regular clock by up to {100 * max(regular):.2g} % of an interval, but the "
            "motion follows the clock; its times are used."
        )
        findings.append(RecordFinding("jittered-times", what, "Log the time at which the signals are sampled."))
    if resampled:
        findings.append(_about_intervals(resampled, u))
    return segments, findings


def _about_intervals(times: Sequence[Array], u: Words) -> RecordFinding:
    """Return the finding about segments that were resampled."""
    steps = [np.diff(t) for t in times]
    usual, longest = float(np.median(np.concatenate(steps))), max(float(each.max()) for each in steps)
    off = [np.abs(each / np.median(each) - 1.0) > JITTER for each in steps]
    first = next(t[int(np.argmax(each))] for t, each in zip(times, off, strict=True) if each.any())
    what = (
        f"{sum(map(np.count_nonzero, off))} of {sum(map(len, off))} intervals deviate by more than 1 % from the median "
        f"{usual:.4g} s, the first one at t = {first:.6g} s; positions and velocities are resampled at the median "
        f"interval by a cubic spline, {u.force}s linearly. With the longest interval, {longest:.4g} s, the record has "
        f"no information above {0.5 / longest:.4g} Hz."
    )
    return RecordFinding("irregular-sampling", what, "Log at equal intervals, from a real-time task.")


def _usual(steps: Array) -> float:
    return float(np.median(steps[:NEAR])) if len(steps) < 2 * NEAR else float(np.median(steps))


def _cuts(steps: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of the intervals that are gaps, and of those at which the rate changes."""
    none = np.zeros(0, dtype=np.intp)
    usual = float(np.median(steps))
    if np.all(np.abs(steps / usual - 1.0) < RATE - 1.0) or len(steps) < 2 * NEAR:
        return np.flatnonzero(steps > GAP * usual), none
    # medians of the 5 intervals before and after each one
    before = np.concatenate([[np.inf], median_filter(steps, 5, origin=2)[:-1]])
    after = np.concatenate([median_filter(steps, 5, origin=-2)[1:], [np.inf]])
    before[0], after[-1] = after[0], before[-1]
    gaps = np.flatnonzero(steps > GAP * np.maximum(before, after))
    local = np.log(median_filter(steps, 2 * NEAR + 1))
    changes = np.flatnonzero(np.abs(np.diff(local)) > np.log(RATE))
    earlier, later = np.maximum(changes - NEAR, 0), np.minimum(changes + 1 + NEAR, len(local) - 1)
    steady = np.abs(local[earlier] - local[changes]) + np.abs(local[later] - local[changes + 1]) < np.log(RATE)
    # single missing rows change the median, but not most intervals on a side
    alike = np.concatenate([[0], np.cumsum(np.abs(np.log(steps) - local) < np.log(RATE))])
    steady &= alike[changes + 1] - alike[earlier] >= ALIKE * (changes + 1 - earlier)
    steady &= alike[later] - alike[changes + 1] >= ALIKE * (later - changes - 1)
    found = changes[steady]
    return gaps, found[~np.isin(found, gaps)]


def _grid(t: Array, columns: Mapping[str, Array]) -> tuple[Array, str]:
    """Return equally spaced times of a segment, and how they were determined."""
    # ``kept``, ``rounded`` to the digits of the times, ``regular`` clock from which the times deviate, or
    # ``resampled``.
    count = len(t) - 1
    mean = (t[-1] - t[0]) / count
    if np.all(np.abs(np.diff(t) / mean - 1.0) <= JITTER):
        return t, "kept"
    line, slope = _clock(t)
    digits = _digits(t)
    off = t - line
    if np.max(np.abs(off)) <= 0.6 * digits and digits <= 0.4 * slope:
        return line, "rounded"
    if np.max(np.abs(off)) < 0.6 * slope and _follows_clock(off, slope, columns):
        return line, "regular"
    # the grid starts at the first sample, so that the others are unchanged if only some samples are missing
    usual = float(np.median(np.diff(t)))
    return t[0] + usual * np.arange(int((t[-1] - t[0]) / usual + 1e-3) + 1), "resampled"


WINDOW: Final = 9  # number of samples of the polynomials that smooth a motion


def _follows_clock(off: Array, step: float, columns: Mapping[str, Array]) -> bool:
    """Return whether the samples were taken at regular times, from which those in the file deviate by `off`."""
    # Otherwise the motion would deviate from a smooth one by its speed times `off`. The regression of one on the other
    # has the coefficient 0 for a regular clock, and 1 for samples at the times in the file.
    motion = columns.get("q", columns.get("v"))
    if motion is None:
        return False

    def rough(values: Array) -> Array:
        return np.asarray(values - savgol_filter(values, WINDOW, 3), dtype=np.float64)

    expected, found = rough(off * savgol_filter(motion, WINDOW, 3, deriv=1, delta=step)), rough(motion)
    size = float(expected @ expected)
    return size == 0.0 or float(found @ expected) < 0.5 * size


def _digits(t: Array) -> float:
    """Return the decimal place to which all times are rounded [s]; 0 if it is below a nanosecond."""
    for places in range(10):
        scaled = (t - t[0]) * 10.0**places
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-3:
            return float(10.0**-places)
    return 0.0


def _interpolated(name: str, t: Array, values: Array, at: Array) -> Array:
    if name in SMOOTH:
        return np.asarray(CubicSpline(t, values)(at), dtype=np.float64)
    return np.asarray(np.interp(at, t, values), dtype=np.float64)


HELD: Final = 20  # smallest number of new values of a position that show how often it is updated


def without_held_samples(segments: Sequence[SampledSegment]) -> tuple[list[SampledSegment], list[RecordFinding]]:
    """Return segments without the samples at which the position was not updated, if every n-th one is new."""
    every = [_updates(segment.columns["q"]) if "q" in segment.columns else 1 for segment in segments]
    longest = max(every, default=1)
    if longest < 2:
        return list(segments), []
    found = []
    for segment, n in zip(segments, every, strict=True):
        if n == 1 or len(segment.t) < SHORTEST * n:
            found.append(segment)
            continue
        begin = int(np.flatnonzero(np.diff(segment.columns["q"]))[0] + 1) % n
        columns = {name: values[begin::n] for name, values in segment.columns.items()}
        found.append(SampledSegment(segment.t[begin::n], columns))
    what = f"The position is updated with every {longest}th sample only; the record is reduced to these samples."
    return found, [RecordFinding("held-position", what, "Log the position at the rate of the other signals.")]


def _updates(q: Array) -> int:
    """Return the number of samples from one new value of a position to the next; 1 if it varies."""
    steps = np.diff(q)
    new = np.flatnonzero(steps)
    if new.size < HELD or new.size > 0.6 * steps.size:
        return 1
    spacing = np.diff(new)
    n = int(np.bincount(spacing).argmax())
    sizes = np.abs(steps[new])
    coarse = float(np.median(sizes)) < 2.5 * float(sizes.min())  # single counts of an encoder
    return n if n > 1 and not coarse and np.mean(spacing % n == 0) > 0.99 else 1
