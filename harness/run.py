"""A run: start the parts, loop over the communication steps, return the recorded values."""

import logging
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Final

import numpy as np

from harness.engine.algorithm import Progress, Reader, Recorder, Tap, Ticks, event_reader, tap_reader
from harness.engine.checkpoint import read_checkpoint, write_checkpoint
from harness.engine.compiled import check_engine, pays
from harness.errors import ENDED, ExperimentError, HarnessError, Interrupted, PartError
from harness.masters import find_master
from harness.parts.guard import Guard
from harness.parts.part import StartValue
from harness.parts.series import SeriesPart
from harness.system.assembly import Assembly, resize_parts
from harness.system.experiment import Experiment
from harness.system.graph import (
    check_loops,
    find_feedthrough,
    find_port,
    make_plan,
    positions,
    recorded_names,
    state_outputs,
)
from harness.system.initialisation import Initialisation
from harness.system.plan import Plan

if TYPE_CHECKING:
    from harness.result import Result

_LOG = logging.getLogger("harness")

LOOK: Final = 0.1  # time between two checks for changed settings of the process [s]


@dataclass(frozen=True)
class Options:
    """Options of a run in addition to its experiment."""

    taps: Sequence[Tap] = ()  # functions that receive values during the run
    progress: Progress | None = None  # receives reports of progress
    resume: str | Path | None = None  # checkpoint from which the run continues
    checkpoint: str | Path | None = None  # file for the state at the end of the run
    pace: float | None = None  # simulated time per wall-clock time; None runs as fast as possible
    events: bool = False  # whether a second row has the values after events at the time of a row
    engine: str = "auto"  # "general", "compiled" for the system, or "auto": compiled if the runs are long enough
    runs: int = 1  # number of such runs

    def __post_init__(self) -> None:
        check_engine(self.engine)
        if self.pace is not None and not 0.0 < self.pace < np.inf:
            raise ExperimentError(
                f"the pace is {self.pace}: give a positive number of simulated seconds per second (1 is real time)"
            )


def run(system: Assembly, experiment: Experiment, options: Options | None = None) -> "Result":
    """Run a system."""
    return Session(system, experiment, options).run(system.start).result()


class Session:
    """A system laid out for runs that differ in their start values only."""

    # A part that has the same instance in the next run, such as an FMU with `FmuPart.reuse`, is not bound to the engine
    # again.

    def __init__(self, system: Assembly, experiment: Experiment, options: Options | None = None) -> None:
        self._system, self._experiment, self._options = system, experiment, options or Options()
        resize_parts(system)
        self._guard = Guard([*system.parts.values()])
        self._saved = None
        if self._options.resume:
            self._saved = read_checkpoint(Path(self._options.resume), system, experiment)
        self._names = recorded_names(system.parts, experiment.record)
        if "*" in experiment.record and not self._names:
            known = [f"{name}.{port.name}" for name, part in system.parts.items() for port in part.observables]
            example = f", such as {known[0]!r}" if known else ""
            _LOG.warning("no part has an output, so nothing is recorded: name variables in record%s", example)
        tapped = [name for tap in self._options.taps for name in tap.names]
        for name in tapped:
            find_port(system.parts, name, "tap")
        for part in system.parts.values():
            if self._options.events and part.events and not part.saves:
                _LOG.warning("'%s' cannot save its state: its values after events have no rows", part.name)
        with self._guard.running():
            find_feedthrough(system, experiment)
        master = find_master(experiment.master)
        compared = state_outputs(system.parts) if master.implicit else positions(system.parts, system.wires)
        plan = self._plan = make_plan(system, experiment, [*self._names, *tapped, *compared])
        _warn_of_missed_values(system, plan)
        schedule = master.schedule(plan, experiment)
        check_loops(system.parts, system.wires, implicit=schedule.implicit)
        open_end = bool(self._options.resume or self._options.checkpoint)
        self._initialisation = Initialisation(plan, system, experiment, self._guard, open_end=open_end)
        self._ticks = Ticks(plan, schedule, experiment.manipulators)

    def run(self, start: Mapping[str, StartValue]) -> Recorder:
        """Run it."""
        begin = self._saved.tick if self._saved else 0
        experiment = self._experiment
        about: dict[str, str | float] = {"system": self._system.name, "master": experiment.master}
        about |= {"start": experiment.start, "stop": experiment.stop, "step": experiment.step}
        recorder = Recorder(self._plan, self._names, experiment.decimate, begin, about)
        with self._guard.running():
            try:
                self._run(start, recorder, begin)
            except PartError as error:
                if error.reason != ENDED or not recorder.filled:
                    error.result = recorder.result() if recorder.filled else None
                    raise
                when = "" if error.time is None else f" in the step from t = {error.time:.12g} s"
                recorder.attributes["ended"] = f"part '{error.part}' ended the simulation{when}"
                _LOG.warning("%s: the result ends there", recorder.attributes["ended"])
                self._record_end(recorder, error)
            except HarnessError as error:
                error.result = recorder.result() if recorder.filled else None
                raise
            except KeyboardInterrupt as signal:
                interrupted = Interrupted()
                interrupted.result = recorder.result() if recorder.filled else None
                raise interrupted from signal
            finally:
                self._ticks.close()
                for part in self._plan.parts:
                    with self._guard.watching(part.name):
                        part.terminate()
        _warn_of_nonfinite(recorder)
        return recorder

    def _record_end(self, recorder: Recorder, error: PartError) -> None:
        """Record the values with which a part has ended the simulation, if that was after the last row."""
        end, last = error.time if error.ended is None else error.ended, float(recorder.times[-1])
        if end is None or not last + 1e-9 * self._plan.step < end <= self._plan.time(self._plan.ticks):
            return
        with suppress(PartError):
            self._plan.calls[[part.name for part in self._plan.parts].index(error.part)].get()
            recorder.read_end(end)

    def _run(self, start: Mapping[str, StartValue], recorder: Recorder, begin: int) -> None:
        plan, options, ticks = self._plan, self._options, self._ticks
        self._initialisation.start(start)
        ticks.begin(recorder)
        if pays(options.engine, options.runs * plan.ticks * len(plan.parts)):
            ticks.compile(required=options.engine == "compiled")
        if self._saved:
            self._saved.restore(plan, ticks.memory)
        readers = [(tap.every, tap_reader(plan, tap)) for tap in options.taps]
        if (progress := options.progress) is not None:
            readers.append((max(1, plan.ticks // 100), lambda tick: progress.update(tick, plan.ticks)))
        recording = [(recorder.decimate, recorder.read)] if self._names else []
        events = [(recorder.decimate, event_reader(plan, recorder))] if self._names and options.events else []
        for every, read in (*readers, *recording, *events):
            if begin % every == 0:
                read(begin)
        _loop(ticks, [*readers, *events], begin, plan, options.pace, self._guard)
        self._guard.look()  # before a file is written
        if options.checkpoint:
            write_checkpoint(Path(options.checkpoint), self._system, self._experiment, plan, ticks.memory)
        recorder.attributes |= ticks.attributes()
        if options.progress is not None:
            options.progress.update(plan.ticks, plan.ticks)


def _loop(
    ticks: Ticks, readers: Sequence[tuple[int, Reader]], begin: int, plan: Plan, pace: float | None, guard: Guard
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


def _warn_of_missed_values(system: Assembly, plan: Plan) -> None:
    """Log a warning for each series with a value that no step sees."""
    for part, every in zip(plan.parts, plan.every, strict=True):
        series = system.parts[part.name]
        if isinstance(series, SeriesPart) and (
            found := series.missed(plan.start, every * plan.step, plan.ticks // every)
        ):
            _LOG.warning(
                "%s.%s changes at t = %.12g s and again before the next step: the run leaves this value out; use a "
                "shorter step",
                part.name,
                *found,
            )


def _warn_of_nonfinite(recorder: Recorder) -> None:
    """Log a warning for each variable that is not finite; a part may return NaN without an error."""
    with np.errstate(all="ignore"):
        if math.isfinite(np.sum(recorder.rows[: recorder.filled])):  # one fast pass in place of one for each column
            return
    for index, name in enumerate(recorder.names):
        bad = ~np.isfinite(recorder.rows[: recorder.filled, index])
        if bad.any():
            first = float(recorder.times[np.argmax(bad)])
            _LOG.warning("%s is not finite from t = %.12g s on: check the inputs of this part", name, first)
