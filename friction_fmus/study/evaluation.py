"""Evaluation of one compensator on the axis: tuning within the limits, then runs on axes that differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import pi
from typing import Final

import numpy as np
from scipy import signal

from friction_fmus.axis.loop_assembly import FRICTION, OF_LOAD, PartPool, forces_of
from friction_fmus.axis.servo import AxisPlant, Compensator, Servo, Trajectory
from friction_fmus.axis.servo_loop import (
    LoopTrace,
    accurate,
    closed_loop,
    numerical_error,
    run_loop,
    trace_of,
    with_gain,
)
from friction_fmus.blocks.axis_units import SLIDING, Words
from friction_fmus.identification import Array
from friction_fmus.identification.fit.scores import rms
from friction_fmus.study.study_result import Corner, LoopMargins, Metrics, StudyCurve, Trial, thinned
from harness import HarnessError, System

HIGH: Final = 5.0  # high-frequency effort begins at this many times the natural frequency of the position loop

REST: Final = 0.1
"""Shortest rest of the reference in which chatter is measured [s]; its first half is left out, as the axis settles."""

WINDOW: Final = 30.0
"""Longest settling time after a reversal, in time constants of the position loop; the axis then follows again."""

BAND: Final = 0.1
"""Part of the largest error of the servo without friction compensation below which the axis has settled."""


@dataclass(frozen=True, eq=False)
class AxisBench:
    """Test bench on which compensators are compared."""

    servo: Servo  # feedback and sensors
    plant: AxisPlant  # identified mass and friction
    trajectory: Trajectory  # reference FMU and initial state
    r: Array  # reference [m]
    run_up: int = 0  # number of samples before the first one of the record, in which the axis starts from rest
    model_error: float = 0.0  # rms error of this axis on the recorded motion [m]
    unexplained: float = 0.0  # part of the drive force that its model does not explain
    band: float = 0.0  # error below which the axis has settled after a reversal [m]; 0 if it is not known yet
    unsure: tuple[str, ...] = ()  # conditions that depend on parameters which the record does not determine

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


def motion_feedforward(bench: AxisBench) -> tuple[float, float]:
    """Return mass [kg] and viscous coefficient [N.s/m] of the feedforward that lets the axis without friction follow.

    A velocity that is measured late, by half its window T, gives Kd (rd - v) a part in proportion to the acceleration,
    and a cascade with integral action one in proportion to the velocity: the best values are about M - kv T and -ki T.
    The tracking error of a linear loop is affine in both, so that one run for each determines the least square.
    """
    mass, servo = bench.plant.mass, replace(bench.servo, quantum=0.0, noise=0.0)
    servo = replace(servo, force_limit=1e3 * servo.force_limit, coulomb_feedforward=0.0, viscous_feedforward=0.0)
    plant = AxisPlant("Viscous", {"Fv": 0.0}, mass, load=bench.plant.load)
    still = replace(bench.trajectory, offset=0.0, load=0.0)
    integral = servo.law == "CascadePPI" and servo.gains["ki"] > 0.0
    changes = [(0.1 * mass, 0.0), *([(0.0, 0.1 * servo.gains["kv"])] if integral else [])]
    with PartPool() as pool:
        errors = []
        for less, more in ((0.0, 0.0), *changes):
            fed = replace(still, inertia=mass - less, viscous=more)
            try:
                errors.append(bench.r - run_loop(closed_loop(servo, plant, fed, pool=pool)).q)
            except HarnessError:
                return mass, 0.0
    slopes = np.column_stack([error - errors[0] for error in errors[1:]])
    if not np.isfinite(slopes).all() or not slopes.any(axis=0).all():
        return mass, 0.0
    shares = -np.linalg.lstsq(slopes, errors[0], rcond=None)[0]
    inertia = mass - float(shares[0]) * changes[0][0]
    return min(max(inertia, 0.0), 2.0 * mass), float(shares[1]) * changes[1][1] if integral else 0.0


def judge(trace: LoopTrace, bench: AxisBench) -> tuple[Metrics | None, Array | None, str]:
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


def high_frequency(force: Array, bench: AxisBench) -> Array:
    """Return the part of a force above `HIGH` times the natural frequency of the position loop, with zero phase."""
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


def settling(error: Array, bench: AxisBench) -> float | None:
    """Return the median time after a reversal until the error stays within the band [s]; None without reversals."""
    times = []
    longest = round(WINDOW / (bench.bandwidth * bench.servo.Ts))
    for begin, next_one in reversals(bench.r):
        end = min(next_one, begin + longest)
        outside = np.flatnonzero(np.abs(error[begin:end]) > bench.band)
        times.append((outside[-1] + 1) * bench.servo.Ts if len(outside) else 0.0)
    return float(np.median(times)) if times else None


def around_reversal(error: Array, bench: AxisBench) -> StudyCurve | None:
    """Return the error over the time after the reversal nearest to the middle of the run; None without reversals."""
    turns = reversals(bench.r)
    if not turns:
        return None
    centre, end = min(turns, key=lambda turn: abs(turn[0] - len(error) // 2))
    longest = min(end - centre, round(WINDOW / (bench.bandwidth * bench.servo.Ts)))
    shown = slice(max(0, centre - longest // 2), centre + longest)
    t = bench.servo.Ts * (np.arange(float(len(error))) - centre)
    return thinned(t[shown], error[shown])


def at_rest(r: Array, Ts: float) -> Array:
    """Return which samples belong to a rest of the reference of at least `REST`, without the first half of `REST`."""
    still = np.append(np.abs(np.diff(r)) <= 1e-9 * max(float(np.ptp(r)), 1e-300), False)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    resting = np.zeros(len(r), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        if (end - begin) * Ts >= REST:
            resting[begin + round(0.5 * REST / Ts) : end] = True
    return resting


LATE: Final = "acceleration of the reference 1 sample later"  # drives differ in when it changes; no record shows it
COARSER: Final = 4.0  # factor of the encoder resolution in the case with a worse encoder
LOAD: Final = 0.5  # load force divided by the largest friction force near rest


@dataclass(frozen=True)
class Case:
    """Difference of the axis from the identified one."""

    name: str  # description
    friction: float = 1.0
    mass: float = 1.0
    """Factors of all friction forces and of the mass."""
    delay: int = 0  # further samples by which the force lags the command
    coarser: float = 1.0
    noise: float = 0.0
    """Factor of the encoder resolution, and standard deviation of additional noise of the measured position [m]."""
    load: float = 0.0  # constant force on the axis [N]
    late: bool = False  # whether the acceleration of the reference reaches the servo and the laws a sample later
    counts: bool = True  # whether the case is part of the worst case


def cases(
    servo: Servo,
    mismatch: tuple[float, float],
    delays: Sequence[int],
    least_delay: float,
    level: float,
    u: Words = SLIDING,
) -> tuple[Case, ...]:
    """Return the cases of a study, with these relative errors of friction and mass."""
    found = []
    factors = ((1.0 - error, 1.0 + error) if error else (1.0,) for error in mismatch)
    for friction, mass in product(*factors) if any(mismatch) else ():
        found.append(Case(f"friction x {friction:.4g}, {u.mass} x {mass:.4g}", friction, mass))
    for delay in delays:
        samples = "1 more sample" if delay == 1 else f"{delay} more samples"
        found.append(Case(f"{samples} of delay", delay=delay, counts=delay <= least_delay))
    if servo.quantum or servo.noise:
        noise = servo.quantum or servo.noise
        found.append(Case("coarser and noisier encoder", coarser=COARSER, noise=noise))
    found.append(Case(LATE, late=True))
    if level > 0.0:
        # not part of the worst case: the record has no such load, and it would decide for an estimator on every axis
        found.append(Case(f"load of {LOAD * level:.3g} {u.N}", load=LOAD * level, counts=False))
    return tuple(found)


def changed(servo: Servo, trajectory: Trajectory, case: Case) -> tuple[Servo, Trajectory]:
    """Return servo and trajectory with the delay, encoder and load of a case."""
    return (
        replace(
            servo,
            delay=servo.delay + case.delay,
            quantum=case.coarser * servo.quantum,
            noise=(servo.noise**2 + case.noise**2) ** 0.5,
        ),
        replace(trajectory, load=trajectory.load + case.load),
    )


ALIKE: Final = 0.1
"""Errors within this relative difference count as equal; a higher bandwidth then depends less on the friction."""


@dataclass(frozen=True)
class Scheme:
    """What is added to the axis in one trial."""

    servo: Servo  # feedback and sensors; integral action is part of it
    gain: float = 1.0  # gain of the compensator
    bandwidth: float | None = None  # bandwidth of an estimator, or corner frequency of integral action [Hz]
    compensator: Compensator | None = None
    feedforward: Compensator | None = None
    """Compensator, and the friction feedforward beside it."""
    margins: LoopMargins | None = None  # margins of the loop; None if the compensator cannot be linearised
    table: bool = False  # whether the identified force over position is compensated along the reference


@dataclass(frozen=True)
class Evaluation:
    """Results of one compensator."""

    scheme: Scheme | None  # best trial with a gain up to 1; None if all failed
    metrics: Metrics | None  # its metrics
    trials: tuple[Trial, ...]  # all trials
    corners: tuple[Corner, ...]  # runs of the best trial on axes that differ
    error: StudyCurve | None  # reference minus position over time of the best trial
    reason: str = ""  # reason why there is no best trial
    schemes: tuple[Scheme, ...] = ()  # the schemes of the trials
    turn: StudyCurve | None = None  # the error of the best trial over the time after a reversal


def evaluate(bench: AxisBench, schemes: Sequence[Scheme], cases: Sequence[Case], bounded: bool = True) -> Evaluation:
    """Co-simulate the axis with each scheme, and with the best one on axes that differ from the identified one.

    A bound of the numerical error takes as long as two runs.
    """
    with PartPool() as pool:
        return _evaluated(bench, schemes, cases, bounded, pool)


def _evaluated(
    bench: AxisBench, schemes: Sequence[Scheme], cases: Sequence[Case], bounded: bool, pool: PartPool
) -> Evaluation:
    trials, possible = [], []
    for scheme in schemes:
        system, metrics, error, failure = _judged(system_of(bench, scheme, pool), bench)
        trials.append(Trial(scheme.gain, scheme.bandwidth, scheme.margins, metrics, failure))
        if metrics is not None and error is not None and scheme.gain <= 1.0:
            possible.append((scheme, metrics, error, system))
    if not possible:
        reason = next((trial.failure for trial in trials if trial.failure), "")
        return Evaluation(None, None, tuple(trials), (), None, reason, tuple(schemes))
    scheme, metrics, error, system = _best(possible)
    if bounded:
        metrics = replace(metrics, rms_bound=_rms_bound(system, metrics.rms, bench))
    corners = tuple(_corner(bench, scheme, case, pool, metrics) for case in cases)
    drawn = thinned(bench.servo.Ts * np.arange(float(len(error))), error)
    turn = around_reversal(error, bench)
    return Evaluation(scheme, metrics, tuple(trials), corners, drawn, schemes=tuple(schemes), turn=turn)


def _best(trials: Sequence[tuple[Scheme, Metrics, Array, System]]) -> tuple[Scheme, Metrics, Array, System]:
    """Return the trial with the smallest error or, among those within `ALIKE`, the one with the highest bandwidth."""
    least = min(metrics.rms for _, metrics, *_ in trials)
    alike = [trial for trial in trials if trial[1].rms <= (1.0 + ALIKE) * least]
    return min(alike, key=lambda trial: (-(trial[0].bandwidth or 0.0), trial[1].rms))


def system_of(bench: AxisBench, scheme: Scheme, pool: PartPool) -> System:
    """Return the axis with a scheme as a system; the caller closes the pool."""
    servo, plant, trajectory = scheme.servo, bench.plant, with_table(bench, scheme)
    one, other = scheme.compensator, scheme.feedforward
    one, other = (other, None) if one is None else (one, other)
    system = closed_loop(servo, plant, trajectory, one, feedforward=other, pool=pool)
    return system if scheme.compensator is None else with_gain(system, scheme.gain)


def with_table(bench: AxisBench, scheme: Scheme) -> Trajectory:
    """Return the trajectory of the axis, with the table over position if the scheme has one."""
    return replace(bench.trajectory, table=bench.plant.position) if scheme.table else bench.trajectory


def _corner(bench: AxisBench, scheme: Scheme, case: Case, pool: PartPool, nominal: Metrics) -> Corner:
    servo, trajectory = changed(scheme.servo, bench.trajectory, case)
    system = system_of(replace(bench, trajectory=trajectory), replace(scheme, servo=servo), pool)
    if case.late:
        fed = [wire.ends[1][0] for wire in system.wires if wire.source == "reference.rdd"]
        if not any(system.start.get(f"{part}.m", 1.0) for part in fed):
            return Corner(case.name, replace(nominal, rms_bound=None), "", case.counts)
        assert system.experiment is not None
        sample = system.experiment.decimate
        wires = [replace(wire, delay=sample) if wire.source == "reference.rdd" else wire for wire in system.wires]
        system = System(system.parts.values(), wires, system.start, system.experiment, system.name)
    _, metrics, _, failure = _judged(system.with_start(off_by(system, case.friction, case.mass)), bench)
    return Corner(case.name, metrics, failure, case.counts)


MASSES: Final = ("axis.m", "axis.m1", "axis.m2")  # start values of one mass, and of motor and load


def off_by(system: System, friction: float, mass: float) -> dict[str, float]:
    """Return the start values of the axis with all friction forces and the mass scaled by these factors."""
    parts, forces = [name for name in (FRICTION, OF_LOAD) if name in system.parts], forces_of(system.parts[FRICTION])
    names = [f"{part}.{name}" for part in parts for name in forces]
    names += [] if OF_LOAD in parts else ["axis.d"]  # viscous friction beside that of the block
    scaled = {name: friction * float(value) for name in names if (value := system.start.get(name))}
    if "position" in system.parts:
        scaled["position.friction_gain"] = friction
    masses = {name: system.start[name] for name in MASSES if name in system.start}
    return {**scaled, **{name: mass * float(value) for name, value in masses.items()}}


def _judged(system: System, bench: AxisBench) -> tuple[System, Metrics | None, Array | None, str]:
    """Run a system; return what ran, with the master that it needs, metrics, error and, if it failed, the reason."""
    try:
        system, found = accurate(system)
    except HarnessError as error:
        return system, None, None, str(error)
    return system, *judge(trace_of(system, found), bench)


def _rms_bound(system: System, number: float, bench: AxisBench) -> float | None:
    """Return the bound of the numerical error of the tracking error; None if the run cannot be repeated."""
    try:
        bound = numerical_error(system, number, lambda trace: rms(bench.r[: len(trace.q)] - trace.q))
    except HarnessError:
        return None
    return bound if math.isfinite(bound) else None
