"""Segmentation of a measurement at gaps, and resampling to equal intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.record import JITTER, Array, Record

#: Ratio of an interval to the median above which it is a gap, across which nothing is interpolated.
GAP = 5.0

#: Smallest number of samples of a segment.
SHORTEST = 50

#: Columns that are smooth because of inertia; the others are interpolated linearly.
SMOOTH = ("q", "v", "reference")


@dataclass(frozen=True, eq=False)
class SampledSegment:
    """Equally spaced segment of a measurement without gaps."""

    t: Array
    """Time [s]."""
    columns: Mapping[str, Array]
    """Other columns."""


def equally_spaced(t: Array, columns: Mapping[str, Array]) -> tuple[list[SampledSegment], list[Finding]]:
    """Split a measurement at gaps, and convert each segment to equal intervals.

    Notes
    -----
    A segment whose intervals deviate by more than 1 % from their mean gets a new time grid. If the times are equally
    spaced except for rounding, samples are not interpolated. Otherwise they are resampled at the median interval by a
    cubic spline (position, velocity, reference) or linearly (forces, which may jump). The result contains no
    information above half the local sample rate.
    """
    steps = np.diff(t)
    usual = float(np.median(steps))
    cuts = np.flatnonzero(steps > GAP * usual)
    findings = []
    if cuts.size:
        longest = float(steps.max())
        what = (
            f"The record has {cuts.size} gap{'s' * (cuts.size > 1)}, the longest of {longest:.4g} s after "
            f"t = {t[int(np.argmax(steps))]:.6g} s (median interval {usual:.4g} s); it is split at each gap."
        )
        findings.append(Finding("gaps", what, "Log without pauses: each segment needs its own initial state."))
    starts = np.concatenate([[0], cuts + 1, [len(t)]])
    spans = [slice(int(a), int(b)) for a, b in pairwise(starts)]
    long_enough = [span for span in spans if span.stop - span.start >= SHORTEST]
    if len(long_enough) < len(spans):
        lost = sum(span.stop - span.start for span in spans if span not in long_enough)
        what = f"{len(spans) - len(long_enough)} segments with {lost} samples in total are too short and are ignored."
        findings.append(Finding("short-pieces", what, f"Log at least {SHORTEST} samples without a gap."))
    segments, rounded, resampled = [], [], []
    for span in long_enough:
        part = {name: values[span] for name, values in columns.items()}
        grid, method = _grid(t[span], usual)
        if method == "resampled":
            part = {name: _interpolated(name, t[span], values, grid) for name, values in part.items()}
            resampled.append(float(np.diff(t[span]).max()))
        elif method == "rounded":
            rounded.append(_digits(t[span]))
        segments.append(SampledSegment(grid, part))
    if rounded:
        what = f"The times are rounded to {max(rounded):.3g} s; they are replaced by equally spaced times."
        findings.append(Finding("rounded-time", what, "Log the time with more digits."))
    if resampled:
        off = np.abs(steps[steps <= GAP * usual] / usual - 1.0) > JITTER
        first, longest = t[:-1][steps <= GAP * usual][off][0], max(resampled)
        what = (
            f"{np.count_nonzero(off)} of {len(off)} intervals deviate by more than 1 % from the median {usual:.4g} s, "
            f"the first one at t = {first:.6g} s; positions and velocities are resampled at the median interval by a "
            f"cubic spline, forces linearly. With the longest interval, {longest:.4g} s, the record has no information "
            f"above {0.5 / longest:.4g} Hz."
        )
        findings.append(Finding("irregular-sampling", what, "Log at equal intervals, from a real-time task."))
    return segments, findings


def _grid(t: Array, usual: float) -> tuple[Array, str]:
    """Return equally spaced times of a segment, and how they were determined: "kept", "rounded" or "resampled"."""
    count = len(t) - 1
    mean = (t[-1] - t[0]) / count
    if np.all(np.abs(np.diff(t) / mean - 1.0) <= JITTER):
        return t, "kept"
    k = np.arange(len(t))
    slope, begin = np.polyfit(k, t - t[0], 1)
    line = t[0] + begin + slope * k
    digits = _digits(t)
    if np.max(np.abs(t - line)) <= 0.6 * digits and digits <= 0.4 * slope:
        return line, "rounded"
    # the grid starts at the first sample, so that the others are unchanged if only some samples are missing
    return t[0] + usual * np.arange(int((t[-1] - t[0]) / usual + 1e-3) + 1), "resampled"


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


TRAIN: Final = 0.6
"""Fraction of a record that is fitted; the rest is validation data."""


def default_windows(records: Sequence[Record]) -> dict[str, tuple[float, float]]:
    """Return the windows of records for which none are given."""
    begin, end = float(records[0].t[0]), float(records[-1].t[-1])
    middle = begin + TRAIN * (end - begin)

    def enough(low: float, high: float) -> bool:
        return any(np.count_nonzero((r.t >= low) & (r.t <= high)) >= SHORTEST for r in records)

    if not (enough(begin, middle) and enough(middle, end)):
        return {"train": (begin, end)}
    return {"train": (begin, middle), "validation": (middle, end)}
