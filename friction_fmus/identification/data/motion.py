"""Velocity, turning points and noise of a record, for looking at it rather than for fitting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, find_peaks, sosfiltfilt

from friction_fmus.identification.data.record import Array, Record

#: The position is looked at up to this many times the frequency at which half of its power is below.
BANDWIDTH = 30.0


@dataclass(frozen=True, eq=False)
class Course:
    """The motion of a record.

    Attributes
    ----------
    q, v : array, shape (n,)
        Position and velocity, smoothed.
    noise : float
        Standard deviation of the noise of the position, or of the integral of the velocity.
    turns : array of int
        Samples at which the motion turns round.
    strokes : array, shape (turns - 1,)
        Distances between one turn and the next.
    """

    q: Array
    v: Array
    noise: float
    turns: Array
    strokes: Array


def course(record: Record) -> Course:
    """Look at the motion of a record.

    Notes
    -----
    A turn is a peak that stands out by 10 standard deviations of the noise (from fourth differences), 3 steps of the
    encoder and a millionth of the whole motion. The velocity, if it was not measured, is the central difference of the
    position behind a zero-phase low-pass filter of second order.
    """
    measured = record.q if record.q is not None else cumulative_trapezoid(record.column("v"), record.t, initial=0)
    noise = float(np.median(np.abs(np.diff(measured, 4)))) / (0.6745 * np.sqrt(70.0))
    q = _smoothed(measured, record.Ts)
    v = record.v if record.v is not None else np.gradient(q, record.Ts)
    span = float(np.ptp(measured))
    height = max(10.0 * noise, 3.0 * record.quantum, 1e-6 * span)
    turns = np.sort(np.concatenate([find_peaks(side * measured, prominence=height)[0] for side in (1.0, -1.0)]))
    return Course(q, v, noise, turns, np.abs(np.diff(q[turns])) if turns.size else np.zeros(0))


def _smoothed(q: Array, Ts: float) -> Array:
    """The position behind a zero-phase low-pass filter that leaves `BANDWIDTH` harmonics of the motion."""
    power = np.abs(np.fft.rfft(np.gradient(q))) ** 2
    frequencies = np.fft.rfftfreq(len(q), Ts)
    total = np.cumsum(power)
    typical = float(frequencies[int(np.searchsorted(total, 0.5 * total[-1]))]) if total[-1] > 0 else 0.0
    cutoff = BANDWIDTH * max(typical, 1.0 / (len(q) * Ts))
    if cutoff >= 0.4 / Ts:
        return q
    filtered = sosfiltfilt(butter(2, cutoff, fs=1.0 / Ts, output="sos"), q, padlen=min(len(q) - 1, 200))
    return np.asarray(filtered, dtype=np.float64)
