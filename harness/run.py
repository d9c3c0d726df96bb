"""A run: start the parts, loop over the communication steps, return the recorded values."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import Final

import numpy as np

from harness.engine.checkpoint import read_checkpoint, write_checkpoint
from harness.engine.defect import Coupling
from harness.engine.line import Extrapolated
from harness.engine.manipulate import Manipulations
from harness.engine.native import NOT_CONVERGED, Engine
from harness.engine.newton import Loops
from harness.engine.tap import Progress, Reader, Recorder, Tap, tap_reader
from harness.errors import ExperimentError, HarnessError, Interrupted
from harness.masters import find_master
from harness.parts.feedthrough import find_feedthrough
from harness.parts.guard import Guard
from harness.result import Result
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment
from harness.system.graph import check_loops
from harness.system.initialisation import start_parts
from harness.system.layout import find_port, make_plan, recorded_names
from harness.system.plan import Plan, Program, Schedule

_LOG = logging.getLogger("harness")

LOOK: Final = 0.1
"""Time between two checks for changed settings of the process [s]."""


@dataclass(frozen=True)
class Options:
    """Options of a run in addition to its experiment.

    Parameters
    ----------
    taps : sequence of Tap
        Functions that receive values during the run.
    progress : Progress or None
        Receives reports of progress.
    resume : path-like or None
        Checkpoint from which the run continues.
    checkpoint : path-like or None
        File for the state at the end of the run.
    pace : float or None
        Simulated time per wall-clock time; None runs as fast as possible.
    native : bool
        Whether the compiled engine runs the loop. Python gives the same results for explicit masters, more slowly, for
        comparison.

    Raises
    ------
    ExperimentError
        If the pace is not positive.
    """

    taps: Sequence[Tap] = ()
    progress: Progress | None = None
    resume: str | Path | None = None
    checkpoint: str | Path | None = None
    pace: float | None = None
    native: bool = True

    def __post_init__(self) -> None:
        """Check the pace."""
        if self.pace is not None and not 0.0 < self.pace < np.inf:
            raise ExperimentError(
                f"the pace is {self.pace}: give a positive number of simulated seconds per second (1 is real time)"
            )


def run(system: Assembly, experiment: Experiment, options: Options | None = None) -> Result:
    """Run a system.

    Parameters
    ----------
    system : Assembly
        The system to run.
    experiment : Experiment
        Settings of the run.
    options : Options or None
        Further options.

    Returns
    -------
    xarray.Dataset
        The recorded variables, named "part.port", along ``time`` [s]. The first row holds the start values, each other
        row the values at the end of a step; for a sampled part, the values held during the step.

    Raises
    ------
    HarnessError
        If the run cannot be started or a part fails; the ``result`` of the error holds the values recorded until then.
    """
    guard = Guard([*system.parts.values()])
    with guard.running():
        return _run(system, experiment, options or Options(), guard)


def _run(system: Assembly, experiment: Experiment, options: Options, guard: Guard) -> Result:
    saved = read_checkpoint(Path(options.resume), system, experiment) if options.resume else None
    begin = saved.tick if saved else 0
    names = recorded_names(system.parts, experiment.record)
    for tap in options.taps:
        for name in tap.names:
            find_port(system.parts, name, "tap")
    find_feedthrough(system, experiment)
    plan = make_plan(system, experiment, [*names, *(name for tap in options.taps for name in tap.names)])
    schedule = find_master(experiment.master)(plan, experiment)
    check_loops(system.parts, system.wires, implicit=schedule.tolerance > 0.0)
    recorder = Recorder(plan, names, experiment.decimate, begin)
    attributes: dict[str, str | float] = {
        "system": system.name,
        "master": experiment.master,
        "start": experiment.start,
        "stop": experiment.stop,
        "step": experiment.step,
    }
    ticks: _Native | _Python | None = None
    try:
        plan = start_parts(plan, system, experiment, guard, open_end=bool(options.resume or options.checkpoint))
        manipulate = Manipulations(plan, schedule, experiment.manipulators)
        ticks = _Native(plan, schedule, recorder, manipulate) if options.native else _Python(plan, schedule, manipulate)
        if saved:
            saved.restore(plan, ticks.memory)
        readers = [(tap.every, tap_reader(plan, tap)) for tap in options.taps]
        if options.progress is not None:
            readers.append(_progress_reader(options.progress, plan.ticks))
        for every, read in (*readers, *([(experiment.decimate, recorder.read)] if names else [])):
            if begin % every == 0:
                read(begin)
        if names and not options.native:
            readers.append((experiment.decimate, recorder.read))
        _loop(ticks, readers, begin, plan, options.pace, guard)
        guard.look()  # before a file is written
        if options.checkpoint:
            write_checkpoint(Path(options.checkpoint), system, experiment, plan, ticks.memory)
        attributes |= ticks.attributes()
        if options.progress is not None:
            options.progress.update(plan.ticks, plan.ticks)
    except HarnessError as error:
        error.result = recorder.result(attributes) if recorder.filled else None
        raise
    except KeyboardInterrupt as signal:
        interrupted = Interrupted()
        interrupted.result = recorder.result(attributes) if recorder.filled else None
        raise interrupted from signal
    finally:
        if ticks is not None:
            ticks.close()
        for part in plan.parts:
            with guard.watching(part.name):
                part.terminate()
    result = recorder.result(attributes)
    _warn_of_nonfinite(result)
    return result


def _loop(
    ticks: _Native | _Python,
    readers: Sequence[tuple[int, Reader]],
    begin: int,
    plan: Plan,
    pace: float | None,
    guard: Guard,
) -> None:
    """Run the communication steps in spans between readers, short enough for Ctrl-C and for the pace."""
    tick, longest = begin, 100
    clock = looked = monotonic()
    while tick < plan.ticks:
        end = min(plan.ticks, tick + longest, *(tick + every - tick % every for every, _ in readers))
        before = monotonic()
        if before - looked > LOOK:
            guard.look()
            looked = before
        ticks.run(tick, end)
        tick = end
        for every, read in readers:
            if tick % every == 0:
                read(tick)
        if pace is not None:
            longest = max(1, int(0.01 * pace / plan.step))
            sleep(max(0.0, clock + (tick - begin) * plan.step / pace - monotonic()))
        elif monotonic() - before < 0.05:
            longest = min(2 * longest, 10_000_000)


class _Native:
    """The loop in C."""

    def __init__(self, plan: Plan, schedule: Schedule, recorder: Recorder, manipulations: Manipulations) -> None:
        self._engine = Engine(plan, schedule.operations, recorder.rows, recorder.columns, recorder.decimate)
        self._recorder = recorder
        self._implicit = Loops(self._engine, schedule) if schedule.tolerance > 0.0 else None
        self._coupling = None if self._implicit else Coupling(self._engine, schedule)
        extrapolated = Extrapolated(self._engine, schedule.extrapolation) if schedule.extrapolation else None
        manipulations.attach(self._engine)
        parts = (self._implicit, self._coupling, extrapolated, manipulations)
        self.memory = {name: array for part in parts if part is not None for name, array in part.memory().items()}

    def run(self, first: int, last: int) -> None:
        """Run the ticks first, ..., last - 1."""
        data = self._engine.data
        data.filled = self._recorder.filled
        try:
            with self._engine.interruptible():
                self._engine.run(first, last)
        except HarnessError:
            if self._implicit and data.status == NOT_CONVERGED:
                raise self._implicit.failure(int(data.failed_part), float(data.failed_time)) from None
            raise
        finally:
            self._recorder.filled = int(data.filled)

    def attributes(self) -> dict[str, str | float]:
        """Return the measures of the run for the attributes of the result."""
        measured = self._implicit or self._coupling
        return measured.report() if measured else {}

    def close(self) -> None:
        """Free the states saved within steps."""
        self._engine.free_states()


class _Python:
    """The loop in Python, for explicit masters."""

    def __init__(self, plan: Plan, schedule: Schedule, manipulations: Manipulations) -> None:
        if not schedule.operations:
            raise ExperimentError("this master runs in the compiled engine only: use native=True")
        self._advance = Program(plan, schedule.operations, manipulations)
        self.memory = manipulations.memory()

    def run(self, first: int, last: int) -> None:
        """Run the ticks first, ..., last - 1; the time follows from the tick alone."""
        for tick in range(first, last):
            self._advance(tick)

    def attributes(self) -> dict[str, str | float]:
        """Return no attributes, as nothing is measured."""
        return {}

    def close(self) -> None:
        """Do nothing, as no states were saved."""


def _progress_reader(progress: Progress, ticks: int) -> tuple[int, Reader]:
    return max(1, ticks // 100), lambda tick: progress.update(tick, ticks)


def _warn_of_nonfinite(result: Result) -> None:
    """Log a warning for each variable that is not finite; a part may return NaN without an error."""
    for name, column in result.data_vars.items():
        bad = ~np.isfinite(column.to_numpy())
        if bad.any():
            first = float(result["time"].to_numpy()[np.argmax(bad)])
            _LOG.warning("%s is not finite from t = %.12g s on: check the inputs of this part", name, first)
