"""Times that are certain by themselves, and counters and angles that wrap around."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.identification.data.record import Array, RecordFinding

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

TICKS: Final = {
    "ns": (0, 10**9),
    "Windows": (-11_644_473_600, 10**7),
    ".NET": (-62_135_596_800, 10**7),
}
"""Clocks of computers whose counts between 2001 and 2096 exclude each other: their start [s since 1970], and ticks per
second."""


def absolute(counts: NDArray[np.int64]) -> tuple[Array, str] | None:
    """Return 64-bit time stamps in seconds since 1970, and the date of the first; None if they are no such stamps."""
    first = int(counts[0]) if counts.size else 0
    for start, rate in TICKS.values():
        begin = start + first / rate
        if 1e9 < begin < 4e9 and int(np.abs(counts - first).max()) < 1e7 * rate:
            return begin + (counts - first) / rate, iso(first * 10**9 // rate + start * 10**9)
    return None


def iso(nanoseconds: int) -> str:
    """Return date and time in ISO 8601 of a time since 1970."""
    return (_EPOCH + timedelta(microseconds=nanoseconds // 1000)).isoformat()


def serial_days(values: Array) -> tuple[Array, str] | None:
    """Return the seconds since the first of some serial dates of a spreadsheet or of MATLAB; None for others.

    Seconds of the same size would have been sampled faster than at 500 kHz.
    """
    steps = np.diff(values[:100_000])
    if len(values) < 3 or not np.all(np.isfinite(steps)) or not np.all(steps >= 0.0):
        return None
    for begin, end, offset in ((36526.0, 73051.0, 25569.0), (730486.0, 767011.0, 719529.0)):
        if begin < values[0] < end and 0.0 < float(np.mean(steps)) < 2e-6:
            return 86400.0 * (values - values[0]), iso(round((float(values[0]) - offset) * 86400e9))
    return None


DAY: Final = 86_400_000_000_000  # [ns]


def from_midnight(moments: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return times of the day that continue after midnight."""
    passed = np.concatenate([[0], np.cumsum(np.diff(moments) < -DAY // 2)])
    return np.asarray(moments + DAY * passed, dtype=np.int64)


_ANGLES: Final = (*(360.0 * 10.0**k for k in range(5)), 2.0 * np.pi, 400.0, 1.0, 6400.0)
_COUNTS: Final = tuple(float(2**bits) for bits in (*range(8, 25), 32))

NEAR: Final = 3.0  # largest ratio of the step at a wrap to the steps beside it
BESIDE: Final = 3  # number of steps on either side that are compared


def unwrapped(values: Array) -> tuple[Array, float, int] | None:
    """Return values without the jumps of a counter or an angle that wraps, its range, and the number of wraps.

    None if there are no jumps, or if one of them cannot be a wrap for certain: at each, the motion must go on as before
    once the range is added, from one end of it to the other.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size < 10:
        return None
    known = values[finite]
    low, high = float(known.min()), float(known.max())
    steps = np.diff(known)
    jumps = np.flatnonzero(np.abs(steps) > 0.5 * (high - low))
    if not jumps.size or jumps.size > 0.1 * steps.size:
        return None
    for period in _periods(known, (low, high), steps[jumps]):
        turns = -np.round(steps[jumps] / period)
        rest = steps[jumps] + period * turns
        if not np.all(np.abs(turns) == 1.0):
            continue
        others = np.abs(steps)
        others[jumps] = 0.0
        padded = np.pad(others, BESIDE)
        around = np.max([padded[jumps + k] for k in range(2 * BESIDE + 1)], axis=0)
        inner = float(np.median(others[others > 0.0])) if np.any(others > 0.0) else 0.0
        if inner and np.all(np.abs(rest) <= NEAR * np.maximum(around, inner)) and np.max(np.abs(rest)) < 0.25 * period:
            moved = np.zeros(len(known))
            moved[jumps + 1] = period * turns
            if np.any(around > 0.0):
                result = values.copy()
                result[finite] = known + np.cumsum(moved)
                return result, period, int(jumps.size)
    return None


def _periods(values: Array, ends: tuple[float, float], jumps: Array) -> list[float]:
    """Return the ranges that values between these ends may have, unsigned or symmetrical.

    A range that is neither of a register nor of an angle counts only if the values jump both up and down, unlike those
    of a counter that starts again.
    """
    (low, high), jump = ends, float(np.abs(jumps).max())
    both_ways = bool(np.any(jumps > 0.0) and np.any(jumps < 0.0))
    whole = bool(np.all(values == np.round(values)))
    known = [*(_COUNTS if whole else ()), *_ANGLES]
    if whole and low >= 0.0 and both_ways:
        known += [size for unit in (1000.0, 100.0) if (size := unit * np.ceil((high + 1.0) / unit)) < 1.01 * high]
    return [
        period
        for period in known
        if period / 1.5 < jump <= period * (1.0 + 1e-9)
        and ((low >= 0.0 and high <= period) or (low >= -0.5 * period - 1e-9 and high <= 0.5 * period * (1.0 + 1e-9)))
    ]


def wrap_finding(name: str, period: float, count: int, file: Any) -> RecordFinding:
    """Return the finding about a column that was made continuous."""
    times = "once" if count == 1 else f"{count} times"
    what = f"Column {name!r} of {file} wraps around after {period:.6g}, {times}; it is made continuous."
    return RecordFinding("wrapped", what, "Nothing has to be done if the range is right.")
