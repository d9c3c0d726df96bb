"""From the times of a file to equally spaced pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.record import JITTER, Array

#: An interval longer than this many usual ones is a gap: nothing is interpolated across it.
GAP = 5.0

#: Samples that a piece between gaps needs to be kept.
SHORTEST = 50

#: Columns that are smooth, because a mass moves; the others are interpolated linearly.
SMOOTH = ("q", "v", "reference")


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a measurement without gaps, equally spaced.

    Attributes
    ----------
    t : array, shape (n,)
        Time [s].
    columns : mapping of str to array, shape (n,)
        The other columns.
    """

    t: Array
    columns: Mapping[str, Array]


def equally_spaced(t: Array, columns: Mapping[str, Array]) -> tuple[list[Piece], list[Finding]]:
    """Split a measurement at its gaps and put each piece on equal intervals.

    Parameters
    ----------
    t : array, shape (n,)
        Time [s], increasing.
    columns : mapping of str to array, shape (n,)
        The other columns.

    Returns
    -------
    list of Piece
        Pieces of at least `SHORTEST` samples; none if there are no such ones.
    list of Finding
        ``gaps``, ``short-pieces``, ``rounded-time``, ``irregular-sampling``, as far as they apply.

    Notes
    -----
    A piece whose intervals deviate by more than 1 % from their mean is put on a grid of its own: without
    interpolation where the times are equally spaced but for the rounding of their digits; else by a cubic spline
    (position, velocity, reference) or linearly (forces, which may jump), at the median interval. Where the samples
    lie further apart than that, nothing is known above half their local rate, so no band-limited interpolation is
    claimed.
    """
    steps = np.diff(t)
    usual = float(np.median(steps))
    cuts = np.flatnonzero(steps > GAP * usual)
    findings = []
    if cuts.size:
        longest = float(steps.max())
        what = (
            f"The record has {cuts.size} gap{'s' * (cuts.size > 1)}, the longest of {longest:.4g} s after "
            f"t = {t[int(np.argmax(steps))]:.6g} s, against a usual interval of {usual:.4g} s; it was split there."
        )
        findings.append(Finding("gaps", what, "Log without pauses: each piece needs an initial state of its own."))
    starts = np.concatenate([[0], cuts + 1, [len(t)]])
    spans = [slice(int(a), int(b)) for a, b in pairwise(starts)]
    long_enough = [span for span in spans if span.stop - span.start >= SHORTEST]
    if len(long_enough) < len(spans):
        lost = sum(span.stop - span.start for span in spans if span not in long_enough)
        what = (
            f"{len(spans) - len(long_enough)} pieces between gaps, {lost} samples together, are left out as too short."
        )
        findings.append(Finding("short-pieces", what, f"Log at least {SHORTEST} samples without a gap."))
    pieces, rounded, resampled = [], [], []
    for span in long_enough:
        part = {name: values[span] for name, values in columns.items()}
        grid, method = _grid(t[span], usual)
        if method == "resampled":
            part = {name: _interpolated(name, t[span], values, grid) for name, values in part.items()}
            resampled.append(float(np.diff(t[span]).max()))
        elif method == "rounded":
            rounded.append(_digits(t[span]))
        pieces.append(Piece(grid, part))
    if rounded:
        what = f"The times are rounded to {max(rounded):.3g} s and equally spaced but for that; they were made so."
        findings.append(Finding("rounded-time", what, "Log the time with more digits."))
    if resampled:
        off = np.abs(steps[steps <= GAP * usual] / usual - 1.0) > JITTER
        first, longest = t[:-1][steps <= GAP * usual][off][0], max(resampled)
        what = (
            f"{np.count_nonzero(off)} of {len(off)} intervals deviate by more than 1 % from the usual {usual:.4g} s, "
            f"the first one at t = {first:.6g} s; positions and velocities were resampled at that interval by a cubic "
            f"spline, forces linearly. Where samples lie furthest apart, {longest:.4g} s, the record knows nothing "
            f"above {0.5 / longest:.4g} Hz."
        )
        findings.append(Finding("irregular-sampling", what, "Log at equal intervals, from a real-time task."))
    return pieces, findings


def _grid(t: Array, usual: float) -> tuple[Array, str]:
    """Equally spaced times for a piece, and how they were found: "kept", "rounded" or "resampled"."""
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
    # from the first sample on, so that where only some samples are missing the others stay what they are
    return t[0] + usual * np.arange(int((t[-1] - t[0]) / usual + 1e-3) + 1), "resampled"


def _digits(t: Array) -> float:
    """The decimal place to which all times are rounded [s]; 0 if there is none above the nanosecond."""
    for places in range(10):
        scaled = (t - t[0]) * 10.0**places
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-3:
            return float(10.0**-places)
    return 0.0


def _interpolated(name: str, t: Array, values: Array, at: Array) -> Array:
    if name in SMOOTH:
        return np.asarray(CubicSpline(t, values)(at), dtype=np.float64)
    return np.asarray(np.interp(at, t, values), dtype=np.float64)
