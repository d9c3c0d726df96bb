"""Evaluation of one compensator on the axis: gain sweep, runs with parameter mismatch, and computing time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from time import perf_counter
from typing import Final

import numpy as np
from scipy import signal

from friction_fmus.axis.loop import (
    Compensator,
    Plant,
    Trace,
    Trajectory,
    block,
    closed_loop,
    run_loop,
    typed,
    with_gain,
)
from friction_fmus.axis.servo import Servo
from friction_fmus.identification import Array
from friction_fmus.study.records import Corner, Curve, GainPoint, Metrics
from harness import FmuPart, HarnessError, System
from harness.parts.part import StartValue

SETTLED: Final = 0.1
"""Initial fraction of a run excluded from its metrics: estimators and tracking error settle."""

HIGH: Final = 5.0
"""Lower limit of high-frequency effort over the natural frequency of the position loop."""

POINTS: Final = 1500
"""Approximate number of points of a stored curve over time."""


@dataclass(frozen=True, eq=False)
class Bench:
    """Test bench on which compensators are compared.

    Attributes
    ----------
    servo : Servo
        Feedback and sensors.
    plant : Plant
        Identified mass and friction.
    trajectory : Trajectory
        Reference FMU and initial state.
    r : array, shape (samples,)
        Reference [m].
    run_up : int
        Number of samples before the first one of the record, in which the axis starts from rest.
    """

    servo: Servo
    plant: Plant
    trajectory: Trajectory
    r: Array
    run_up: int = 0


@dataclass(frozen=True)
class Evaluation:
    """Results of one compensator.

    Attributes
    ----------
    gain : float or None
        Best gain up to 1; None if all runs failed.
    metrics : Metrics or None
        Metrics at the best gain.
    sweep : tuple of GainPoint
        Metrics over the gain.
    corners : tuple of Corner
        Metrics at the best gain with parameter mismatch.
    error : Curve or None
        Reference minus position over time at the best gain.
    """

    gain: float | None
    metrics: Metrics | None
    sweep: tuple[GainPoint, ...]
    corners: tuple[Corner, ...]
    error: Curve | None


def evaluate_compensator(
    bench: Bench, compensator: Compensator | None, gains: Sequence[float], mismatch: float
) -> Evaluation:
    """Co-simulate the axis with one compensator, or without compensation.

    Parameters
    ----------
    bench : Bench
        Axis and reference.
    compensator : Compensator or None
        Compensator; None for a single run without compensation.
    gains : sequence of float
        Gains of the compensation.
    mismatch : float
        Relative error of friction and mass: four runs scale them by 1 - mismatch and 1 + mismatch. 0 for none.
    """
    runs: dict[float, tuple[GainPoint, Array | None]] = {}
    corners = []
    with closed_loop(bench.servo, bench.plant, bench.trajectory, compensator) as system:
        for gain in gains if compensator else (0.0,):
            metrics, error, failure = _judged(with_gain(system, gain), bench)
            runs[gain] = GainPoint(gain, metrics, failure), error
        sweep = tuple(point for point, _ in runs.values())
        fit = [(point.metrics.rms, point.gain) for point in sweep if point.metrics is not None and point.gain <= 1.0]
        if not fit:
            return Evaluation(None, None, sweep, (), None)
        gain = min(fit)[1]
        best = with_gain(system, gain)
        for friction in (1.0 - mismatch, 1.0 + mismatch) if mismatch else ():
            for mass in (1.0 - mismatch, 1.0 + mismatch):
                metrics, _, failure = _judged(best.with_start(off_by(system, friction, mass)), bench)
                corners.append(Corner(friction, mass, metrics, failure))
    point, error = runs[gain]
    assert error is not None
    drawn = thinned(bench.servo.Ts * np.arange(float(len(error))), error)
    return Evaluation(gain, point.metrics, sweep, tuple(corners), drawn)


def off_by(system: System, friction: float, mass: float) -> dict[str, float]:
    """Return the start values of the axis with all friction forces and the mass scaled by these factors."""
    part = system.parts["friction"]
    forces = [f"friction.{port.name}" for port in part.parameters if port.unit and port.unit[0] == "N"]  # N, N/m, ...
    scaled = {name: friction * float(value) for name in forces if (value := system.start.get(name)) is not None}
    if "position" in system.parts:
        scaled["position.friction_gain"] = friction
    return {**scaled, "axis.m": mass * float(system.start["axis.m"])}


def _judged(system: System, bench: Bench) -> tuple[Metrics | None, Array | None, str]:
    """Run a system and return metrics, error and, if it failed, the reason."""
    try:
        trace = run_loop(system)
    except HarnessError as error:
        return None, None, str(error)
    return judge(trace, bench)


def judge(trace: Trace, bench: Bench) -> tuple[Metrics | None, Array | None, str]:
    """Return metrics and error of a run and, if it failed, the reason."""
    error = bench.r - trace.q
    if not (np.isfinite(error).all() and np.max(np.abs(error)) <= max(float(np.ptp(bench.r)), 1e-12)):
        return None, None, "The loop is unstable: the error exceeds the range of the reference."
    begin = round(SETTLED * len(error))
    high = high_frequency(trace.force, bench)
    metrics = Metrics(
        rms=_rms(error[begin:]),
        largest=float(np.max(np.abs(error[begin:]))),
        effort=_rms(trace.force[begin:]),
        effort_high=_rms(high[begin:]),
    )
    return metrics, error, ""


def high_frequency(force: Array, bench: Bench) -> Array:
    """Return the part of a force above `HIGH` times the natural frequency of the position loop, with zero phase.

    The frequency is at least one period over the whole signal, and at most half of the Nyquist frequency.
    """
    natural = (bench.servo.pid[0] / bench.plant.mass) ** 0.5 / (2.0 * pi)
    corner = min(max(HIGH * natural, 1.0 / (len(force) * bench.servo.Ts)), 0.25 / bench.servo.Ts)
    sections = signal.butter(2, corner, "highpass", fs=1.0 / bench.servo.Ts, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, force), dtype=np.float64)


@dataclass(frozen=True)
class Cost:
    """Computing time of one sample [ns]."""

    ns: float


def cost_of(compensator: Compensator, Ts: float, rotary: bool, samples: int = 100_000) -> Cost:
    """Measure the computing time of one sample of a compensator's FMU, without start-up, as the best of three."""
    part = FmuPart("law", block(compensator.model, rotary))
    start: dict[str, StartValue] = {f"law.{port.name}": 0.01 for port in part.inputs if not port.optional}
    start |= {f"law.{name}": value for name, value in typed(part, compensator.values).items()}
    with System([part], [], {**start, "law.Ts": Ts}) as system:

        def seconds(count: int) -> float:
            begin = perf_counter()
            system.run(stop=count * Ts, step=Ts, decimate=count, record=[f"law.{compensator.output}"])
            return perf_counter() - begin

        short = samples // 10
        taken = min(seconds(samples) for _ in range(3)) - min(seconds(short) for _ in range(3))
    return Cost(1e9 * max(taken, 0.0) / (samples - short))


def thinned(x: Array, y: Array, points: int = POINTS) -> Curve:
    """Return a decimated curve with the minimum and maximum of each interval, so that peaks are kept.

    Parameters
    ----------
    x, y : array, shape (n,)
        Points of the curve.
    points : int
        Approximate number of points to keep.
    """
    width = -(-2 * len(y) // points)
    if width <= 2:
        return Curve(tuple(x.tolist()), tuple(y.tolist()))
    kept: list[int] = [0]
    for begin in range(0, len(y), width):
        interval = y[begin : begin + width]
        kept += sorted({begin + int(np.argmin(interval)), begin + int(np.argmax(interval))})
    places = np.unique([*kept, len(y) - 1])
    return Curve(tuple(x[places].tolist()), tuple(y[places].tolist()))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
