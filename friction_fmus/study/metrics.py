"""Metrics of a run of the servo."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
from scipy import signal

from friction_fmus.axis.loop import Trace
from friction_fmus.axis.servo import Plant, Servo, Trajectory
from friction_fmus.identification import Array
from friction_fmus.study.compensator_records import Metrics

HIGH: Final = 5.0
"""Lower limit of high-frequency effort over the natural frequency of the position loop."""

REST: Final = 0.1
"""Shortest rest of the reference in which chatter is measured [s]; its first half is left out, as the axis settles."""

WINDOW: Final = 30.0
"""Longest settling time after a reversal, over the time constant of the position loop; the axis then follows again."""

BAND: Final = 0.1
"""Error below which the axis has settled, over the largest error of the servo without friction compensation."""


@dataclass(frozen=True, eq=False)
class Bench:
    """Test bench on which compensators are compared."""

    servo: Servo
    """Feedback and sensors."""
    plant: Plant
    """Identified mass and friction."""
    trajectory: Trajectory
    """Reference FMU and initial state."""
    r: Array
    """Reference [m]."""
    run_up: int = 0
    """Number of samples before the first one of the record, in which the axis starts from rest."""
    band: float = 0.0
    """Error below which the axis has settled after a reversal [m]; 0 if it is not known yet."""

    @property
    def bandwidth(self) -> float:
        """Natural frequency of the position loop [rad/s]."""
        return float((self.servo.pid[0] / self.plant.mass) ** 0.5)

    @property
    def speed(self) -> float:
        """Median speed of the reference while it moves [m/s]; 0 if it does not move."""
        speeds = np.abs(np.diff(self.r)) / self.servo.Ts
        moving = speeds[speeds > 1e-3 * np.max(speeds, initial=0.0)]
        return float(np.median(moving)) if len(moving) else 0.0


def judge(trace: Trace, bench: Bench) -> tuple[Metrics | None, Array | None, str]:
    """Return metrics and error of a run and, if it failed, the reason."""
    error = bench.r - trace.q
    if not (np.isfinite(error).all() and np.max(np.abs(error)) <= max(float(np.ptp(bench.r)), 1e-12)):
        return None, None, "The loop is unstable: the error exceeds the range of the reference."
    high = high_frequency(trace.force, bench)
    resting = at_rest(bench.r, bench.servo.Ts)
    metrics = Metrics(
        rms=rms(error),
        largest=float(np.max(np.abs(error))),
        effort=rms(trace.force),
        effort_high=rms(high),
        variation=float(np.sum(np.abs(np.diff(trace.force)))) / (len(error) * bench.servo.Ts),
        settling=settling(error, bench) if bench.band else None,
        chatter=rms(high[resting]) if resting.any() else None,
    )
    return metrics, error, ""


def high_frequency(force: Array, bench: Bench) -> Array:
    """Return the part of a force above `HIGH` times the natural frequency of the position loop, with zero phase.

    The frequency is at least one period over the whole signal, and at most half of the Nyquist frequency.
    """
    natural = bench.bandwidth / (2.0 * pi)
    corner = min(max(HIGH * natural, 1.0 / (len(force) * bench.servo.Ts)), 0.25 / bench.servo.Ts)
    sections = signal.butter(2, corner, "highpass", fs=1.0 / bench.servo.Ts, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, force), dtype=np.float64)


def reversals(r: Array) -> list[tuple[int, int]]:
    """Return the samples at which a reference reverses, each with the end of the motion that follows."""
    change = np.diff(r)
    moving = np.flatnonzero(np.abs(change) > 1e-6 * np.max(np.abs(change), initial=0.0))
    turns = moving[1:][np.diff(np.sign(change[moving])) != 0.0]
    return list(zip(turns.tolist(), [*turns[1:].tolist(), len(r)], strict=False))


def settling(error: Array, bench: Bench) -> float | None:
    """Return the median time after a reversal until the error stays within the band [s]; None without reversals."""
    times = []
    longest = round(WINDOW / (bench.bandwidth * bench.servo.Ts))
    for begin, next_one in reversals(bench.r):
        end = min(next_one, begin + longest)
        outside = np.flatnonzero(np.abs(error[begin:end]) > bench.band)
        times.append((outside[-1] + 1) * bench.servo.Ts if len(outside) else 0.0)
    return float(np.median(times)) if times else None


def at_rest(r: Array, Ts: float) -> Array:
    """Return which samples belong to a rest of the reference of at least `REST`, without the first half of `REST`."""
    still = np.append(np.abs(np.diff(r)) <= 1e-9 * max(float(np.ptp(r)), 1e-300), False)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    resting = np.zeros(len(r), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        if (end - begin) * Ts >= REST:
            resting[begin + round(0.5 * REST / Ts) : end] = True
    return resting


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
