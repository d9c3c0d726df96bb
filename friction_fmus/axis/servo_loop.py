"""The servo axis as a system of FMUs: reference, compensator, feedback, sensors, mass and friction."""

import logging
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.axis.loop_assembly import DRIVE, OF_LOAD, AxisAssembly, LoopAssembly, PartPool
from friction_fmus.axis.servo import AxisPlant, Compensator, Servo, Trajectory
from friction_fmus.blocks.catalogue import find
from harness import Experiment, ExperimentError, SeriesPart, System
from harness.accuracy.measure_bounds import measure_bounds
from harness.engine.algorithm import Recorder
from harness.engine.defect import inaccurate
from harness.masters import best_first
from harness.parts.part import StartValue
from harness.run import Session

FITTED: Final = 12  # number of samples at the start from which velocity and acceleration are estimated
SLOW: Final = 1e-3  # initial velocity over the largest one up to which a reference begins at rest
REST: Final = 10  # number of samples at rest before the run-up
SHORTEST: Final = 20  # smallest number of samples of a run-up


def from_rest(r: NDArray[np.float64], Ts: float) -> NDArray[np.float64]:
    """Return a reference that begins at rest."""
    # A record may begin in motion. The states that compensators, servo and friction have then are unknown, and laws
    # whose states start at zero would disturb the axis, by 74 µm on the EMPS axis. An axis at rest on its reference
    # needs only the start values that the blocks have.
    rd = np.gradient(r, Ts)
    fastest = float(np.max(np.abs(rd)))
    t = Ts * np.arange(float(FITTED))
    curve, v0, _ = np.polyfit(t, r[:FITTED], 2)
    if abs(v0) <= SLOW * fastest:
        return r
    a0 = 2.0 * curve
    strongest = float(np.quantile(np.abs(np.gradient(rd, Ts)), 0.99))
    samples = max(SHORTEST, ceil(1.5 * abs(v0) / (strongest * Ts))) if strongest > 0.0 else SHORTEST
    samples = min(samples, len(r))
    duration = samples * Ts
    s = np.arange(samples + 1.0) / samples

    # integral of the velocity v0 (3 s^2 - 2 s^3) + a0 T (s^3 - s^2)
    path = duration * (v0 * (s**3 - s**4 / 2.0) + a0 * duration * (s**4 / 4.0 - s**3 / 3.0))
    run_up = r[0] + path[:-1] - path[-1]
    return np.concatenate([np.full(REST, run_up[0]), run_up, r])


@contextmanager
def quiet_runs() -> Iterator[None]:
    """Suppress log messages of runs that may fail or be inaccurate by design: the result states the reason."""
    log = logging.getLogger("harness")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)


FINEST, COARSER = 0.5e-3, 1e-3  # longest communication steps of masses and friction with and without a spring [s]

MASTER = "newton"
"""Master of an axis. On soft bristles an explicit one is of first order: 0.28 µm off with steps of 0.5 ms on an axis of
12 kg with 4e5 N/m, which a fit turns into 5 % too much damping; this one is 0.01 µm off."""

TOLERANCE = 1e-7
"""Relative tolerance of the solvers in the blocks. A run takes less than half of the time of one with the default of
1e-11, and the position of EMPS changes by less than 1e-13 m."""


def recorded(parts: Container[str]) -> tuple[str, str]:
    """Return the variables that are recorded at every sample of the servo: position, and force before its delay."""
    force = next((f"{name}.y" for name in ("current", "notch") if name in parts), "servo.u")
    return "axis.x1" if OF_LOAD in parts else "axis.x", force


@dataclass(frozen=True, eq=False)
class LoopTrace:
    """Position q [m] and drive force [N] of a run, shape (samples,); the force is held from the time of q on."""

    q: NDArray[np.float64]
    force: NDArray[np.float64]


def closed_loop(
    servo: Servo,
    plant: AxisPlant,
    trajectory: Trajectory,
    compensator: Compensator | None = None,
    fmus: Mapping[str, Path] | None = None,
    feedforward: Compensator | None = None,
    pool: PartPool | None = None,
) -> System:
    """Return the closed loop of an axis as a system."""
    every = max(1, ceil(servo.Ts / _longest(plant) - 1e-9))  # steps of mass and friction in a sample
    loop = LoopAssembly(trajectory, every, fmus or {}, pool or PartPool(), plant, servo=servo)
    loop.add_sensors()
    loop.add_servo()
    loop.add_compensation(compensator, feedforward)
    loop.add_plant()
    step = servo.Ts / every
    stop = trajectory.samples * servo.Ts
    experiment = Experiment(
        stop=stop,
        step=step,
        master=MASTER,
        record=recorded([part.name for part in loop.parts]),
        decimate=every,
        tolerance=TOLERANCE,
    )
    return System(loop.parts, loop.wires, loop.start, experiment, "axis")


def _longest(plant: AxisPlant) -> float:
    """Return the longest communication step between mass and friction of an axis [s]."""
    friction = find(plant.friction).about.friction
    rigid = plant.load is None and friction is not None and friction.stiffness == "0"
    return COARSER if rigid else FINEST


def with_gain(system: System, gain: float) -> System:
    """Return the system with another gain of the compensation; both share their parts, so run one at a time."""
    into = ("servo.f", "force.u1")  # what adds the force of the compensator
    own = [wire.source.startswith("compensator.") and wire.target in into for wire in system.wires]
    wires = [replace(wire, gain=gain) if its else wire for wire, its in zip(system.wires, own, strict=True)]
    return System(system.parts.values(), wires, system.start, system.experiment, system.name)


def accurate(system: System) -> tuple[System, Recorder]:
    """Return a system of an axis, with a more accurate master if it needs one, and what its run records."""
    assert system.experiment is not None
    found = Session(system, system.experiment).run(system.start)
    for master in best_first(lambda master: master.implicit):
        assert system.experiment is not None
        if inaccurate(found.attributes) and master != system.experiment.master:
            experiment = replace(system.experiment, master=master)
            system = System(system.parts.values(), system.wires, system.start, experiment, system.name)
            found = Session(system, experiment).run(system.start)
    if inaccurate(found.attributes):
        raise ExperimentError("the simulation of the axis is inaccurate, even with the master adaptive")
    return system, found


def run_loop(system: System) -> LoopTrace:
    """Run the system of an axis and return position and force."""
    return trace_of(*accurate(system))


def trace_of(system: System, found: Recorder) -> LoopTrace:
    """Return position and force of a run; a row has the force of the sampling period that ends there."""
    position, force = (found.column(name) for name in recorded(system.parts))
    return LoopTrace(q=position[:-1], force=force[1:])


def numerical_error(system: System, number: float, measure: Callable[[LoopTrace], float]) -> float:
    """Return the error bound of a number that summarises an accurate run, from runs with other steps."""
    assert system.experiment is not None

    def measured(found: Recorder) -> dict[str, float]:
        return {"number": measure(trace_of(system, found))}

    (bound,) = measure_bounds(system, system.experiment, measured, {"number": number}).values()
    return bound


Array = NDArray[np.float64]

FREE_TOLERANCE = 1e-6  # residual of the loop of mass and friction over the size of the values


def free_axis(
    plant: AxisPlant, t: Array, force: Array, trend: Array, *, rotary: bool, contact: Path, longest: float
) -> System:
    """Return mass and friction of an axis, driven by a recorded force."""
    Ts = float((t[-1] - t[0]) / (len(t) - 1))
    every = max(1, int(np.ceil(Ts / longest - 1e-9)))
    still = Trajectory(Path(), len(t), 0.0, 0.0, rotary=rotary)
    axis = AxisAssembly(still, every, {"friction": contact}, PartPool(), plant)
    columns = {"u": force, "trend": trend}
    drive = SeriesPart("drive", Ts * np.arange(len(t)), columns, interpolation="previous", beyond="hold")
    drive.every = every
    axis.parts.append(drive)
    axis.add("force", "Sum", {"gain[2]": 0.0}, sampled=False)
    axis.wires += ["drive.u -> force.u1", "drive.trend -> force.u2", f"force.y -> {DRIVE}"]
    axis.add_plant()
    step, stop, seen = Ts / every, Ts * (len(t) - 1), ("axis.x", "axis.v")
    experiment = Experiment(stop, step, master=MASTER, record=seen, decimate=every, loop_tolerance=FREE_TOLERANCE)
    return System(axis.parts, axis.wires, axis.start, experiment, "free axis")


def run_free(system: System, start: Mapping[str, StartValue], begin: float, end: float) -> tuple[Array, Array]:
    """Run a free axis from one sample to another and return position and velocity at all samples."""
    result = system.with_start(start).run(start=begin, stop=end)
    return (
        np.asarray(result["axis.x"].to_numpy(), dtype=np.float64),
        np.asarray(result["axis.v"].to_numpy(), dtype=np.float64),
    )
