"""Velocity, reversal points and noise of a record, for checks of the excitation and not for fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, find_peaks, sosfiltfilt

from friction_fmus.identification.data.record import Array, Record

#: Bandwidth of the smoothed position over its median frequency, below which half of the power of the velocity is.
BANDWIDTH = 30.0


@dataclass(frozen=True, eq=False)
class MotionFeatures:
    """Features of the motion in a record."""

    q: Array
    v: Array
    """Smoothed position and velocity."""
    noise: float
    """Standard deviation of the noise of the position, or of the integral of the velocity."""
    reversals: Array
    """Indices of the reversal points."""
    strokes: Array
    """Distances between consecutive reversal points."""


def motion_features(record: Record) -> MotionFeatures:
    """Return the features of the motion in a record.

    Notes
    -----
    A reversal point is a peak with a prominence of at least 10 standard deviations of the noise (from fourth
    differences), 3 encoder counts and a millionth of the travel. A velocity that was not measured is the central
    difference of the position behind a second-order zero-phase low-pass filter.
    """
    measured = record.q if record.q is not None else cumulative_trapezoid(record.column("v"), record.t, initial=0)
    noise = float(np.median(np.abs(np.diff(measured, 4)))) / (0.6745 * np.sqrt(70.0))
    q = _smoothed(measured, record.Ts)
    v = record.v if record.v is not None else np.gradient(q, record.Ts)
    span = float(np.ptp(measured))
    height = max(10.0 * noise, 3.0 * record.quantum, 1e-6 * span)
    reversals = np.sort(np.concatenate([find_peaks(side * measured, prominence=height)[0] for side in (1.0, -1.0)]))
    return MotionFeatures(q, v, noise, reversals, np.abs(np.diff(q[reversals])) if reversals.size else np.zeros(0))


def _smoothed(q: Array, Ts: float) -> Array:
    """Return the position behind a zero-phase low-pass filter at `BANDWIDTH` times the median frequency."""
    power = np.abs(np.fft.rfft(np.gradient(q))) ** 2
    frequencies = np.fft.rfftfreq(len(q), Ts)
    total = np.cumsum(power)
    typical = float(frequencies[int(np.searchsorted(total, 0.5 * total[-1]))]) if total[-1] > 0 else 0.0
    cutoff = BANDWIDTH * max(typical, 1.0 / (len(q) * Ts))
    if cutoff >= 0.4 / Ts:
        return q
    filtered = sosfiltfilt(butter(2, cutoff, fs=1.0 / Ts, output="sos"), q, padlen=min(len(q) - 1, 200))
    return np.asarray(filtered, dtype=np.float64)
