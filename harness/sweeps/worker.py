"""Workers: each executes chunks of runs with its own system, whose FMUs are reset between runs."""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any, Final

from harness.accuracy.measure_bounds import measure_bounds
from harness.engine.algorithm import Recorder
from harness.errors import HarnessError, SweepError
from harness.parts.fmu import FmuPart
from harness.parts.part import StartValue
from harness.result import Result
from harness.run import Options, Session
from harness.sweeps.measures import Builtin, Measure, label
from harness.sweeps.samples import Sample
from harness.system.experiment import SCALARS, Experiment
from harness.system.system import System

_PROBED: Final = 1000  # number of communication steps over which a reset FMU is compared with a new one

_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Job:
    """Data common to all runs of a sweep."""

    key: str  # identifies the sweep; workers keep a system for each
    open: Callable[[], System]  # returns a system for exclusive use
    experiment: Experiment  # settings of each run, with full names of the recorded variables
    measures: tuple[Measure, ...]  # functions of the result of a run
    keep: tuple[str, ...] = ()  # variables whose trajectories are returned
    accuracy: bool = False  # whether each measure gets an error bound
    engine: str = "auto"  # of each run
    runs: int = 1  # number of runs


@dataclass
class Outcome:
    """Outcome of a run."""

    run: int  # number of the run
    wall_time: float = 0.0  # duration of the run [s]
    measures: dict[str, float] = field(default_factory=dict)  # values of the measures; empty if the run failed
    error: str | None = None  # error of the run
    warnings: str | None = None  # logged warnings
    kept: Result | None = None  # stored trajectories


class Runner:
    """The system of one worker."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.busy = threading.Lock()  # held while the system runs or is closed
        self.used = perf_counter()  # when it last ran [s]
        self.system = job.open()
        self._fmus = [part for part in self.system.parts.values() if isinstance(part, FmuPart)]
        self._probed = not self._fmus
        flats = {part.name: part.archive.flat for part in self._fmus}
        self._sizes = {f"{name}.{size}" for name, flat in flats.items() if flat for size in flat.structural}
        self._session: Session | None = None
        self._layout: object = None
        self._start: Mapping[str, StartValue] = {}
        self._reuse(True)

    def run(self, number: int, values: Sample) -> Outcome:
        """Execute one run; any exception becomes the error of its outcome."""
        outcome = Outcome(number)
        with _collected_warnings() as messages:
            begin = perf_counter()
            try:
                recorded = self._run(values)
                outcome.measures = self._measured(recorded)
                if self.job.accuracy:
                    outcome.measures |= self._bounds(values, outcome.measures)
                outcome.kept = recorded.result()[list(self.job.keep)] if self.job.keep else None
            except HarnessError as error:
                outcome.error = str(error)
            except Exception as error:
                outcome.error = f"{type(error).__name__}: {error}"
            outcome.wall_time = perf_counter() - begin
            outcome.warnings = "; ".join(messages) or None
            if not (self._probed or outcome.error):
                self._probe(values)
        return outcome

    def close(self) -> None:
        """Close the system."""
        self._reuse(False)
        self.system.close()

    def _run(self, values: Sample) -> Recorder:
        """One run, laid out as the one before if values of the same start values differ and no size of an array."""
        settings, start = _split(values)
        layout = settings, start.keys(), {name: start[name] for name in start.keys() & self._sizes}
        if self._session is None or layout != self._layout:
            system, experiment = self._set(values, self.job.experiment)
            options = Options(engine=self.job.engine, runs=self.job.runs)
            self._session, self._start, self._layout = Session(system, experiment, options), system.start, layout
        session = self._session
        if any(part.undeclared for part in self.system.parts.values()):
            self._session = None  # start values decide on which inputs its outputs depend
        return session.run({**self._start, **start})

    def _set(self, values: Sample, experiment: Experiment) -> tuple[System, Experiment]:
        """Return the system and the experiment with the values of a run."""
        settings, start = _split(values)
        return self.system.with_start(start), replace(experiment, **settings)

    def _measured(self, recorded: Recorder) -> dict[str, float]:
        numbers: dict[str, float] = {}
        result: Result | None = None
        for measure in self.job.measures:
            try:
                if isinstance(measure, Builtin):
                    found: Mapping[str, float] = {str(measure): measure.of(recorded.column(measure.name))}
                else:
                    result = recorded.result() if result is None else result
                    found = measure(result)
                given = {str(name): float(value) for name, value in found.items()}
            except Exception as error:
                raise SweepError(f"the measure {label(measure)} failed with {type(error).__name__}: {error}") from error
            for name in given:
                if name in numbers:
                    raise SweepError(f"two measures are called '{name}': rename the result of {label(measure)}")
            numbers |= given
        return numbers

    def _bounds(self, values: Sample, measured: Mapping[str, float]) -> dict[str, float]:
        """Return the error bound of each measure."""
        bounds = measure_bounds(*self._set(values, self.job.experiment), self._measured, measured, dense=True)
        for name in bounds:
            if name in measured:
                raise SweepError(f"two measures are called '{name}': rename one of them")
        return bounds

    def _probe(self, values: Sample) -> None:
        """Use new instances in every run if reset instances do not behave like new ones."""
        # An FMU may return fmi2OK from fmi2Reset and still keep a state, which shows after the first run.
        self._probed = True
        names = [
            f"{name}.{port.name}"
            for name, part in self.system.parts.items()
            for port in (*part.outputs, *part.observables)
        ]
        whole = self.job.experiment
        begin, stop, step = (float(values.get(name, getattr(whole, name))) for name in ("start", "stop", "step"))
        ticks = min(_PROBED, round((stop - begin) / step))
        short = {**values, "stop": begin + ticks * step, "decimate": 1}
        probe = replace(whole, record=tuple(names))
        was_reset = self._outputs(short, probe)
        self._reuse(False)
        new = self._outputs(short, probe)
        if was_reset == new:
            self._reuse(True)
        else:
            _LOG.info("fmi2Reset does not restore the initial state of all FMUs: every run uses new instances")

    def _outputs(self, values: Sample, experiment: Experiment) -> bytes | str:
        """Return the recorded values as bytes, or the error text of a failed run."""
        try:
            system, experiment = self._set(values, experiment)
            recorded = Session(system, experiment).run(system.start)
        except Exception as error:
            return str(error)
        return recorded.rows[: recorded.filled].tobytes()

    def _reuse(self, reuse: bool) -> None:
        for part in self._fmus:
            part.reuse = reuse


def _split(values: Sample) -> tuple[dict[str, Any], dict[str, StartValue]]:
    """Settings of the experiment, and start values."""
    settings = {name: value for name, value in values.items() if name in SCALARS}
    return settings, {name: value for name, value in values.items() if name not in SCALARS}


_runners: dict[tuple[str, int], Runner] = {}
_ended: set[str] = set()


def run_chunk(
    job: Job, runs: Sequence[tuple[int, Sample]], stopped: Callable[[], bool] = lambda: False, idle: float | None = None
) -> list[Outcome]:
    """Execute some runs of a sweep with the system of this thread."""
    key = (job.key, threading.get_ident())
    outcomes: list[Outcome] = []
    while job.key not in _ended:
        runner = _runners[key] = _runners.get(key) or Runner(job)
        with runner.busy:
            if _runners.get(key) is not runner:  # closed as it was idle
                continue
            for number, values in runs:
                if stopped() or job.key in _ended:
                    break
                outcomes.append(runner.run(number, values))
            runner.used = perf_counter()
        if idle is not None:
            timer = threading.Timer(idle, _close_idle, (key, idle))
            timer.daemon = True
            timer.start()
        break
    if job.key in _ended:
        _close_free(key)
    return outcomes


def close_runners(sweep: str) -> None:
    """Close the systems of a sweep in this process; a thread that is in a run closes its own after this run."""
    _ended.add(sweep)
    for key in [key for key in _runners if key[0] == sweep]:
        _close_free(key)


def _close_idle(key: tuple[str, int], idle: float) -> None:
    runner = _runners.get(key)
    if runner is not None and perf_counter() - runner.used >= 0.99 * idle:
        _close_free(key)


def _close_free(key: tuple[str, int]) -> None:
    """Close a system unless it is in a run."""
    runner = _runners.get(key)
    if runner is not None and runner.busy.acquire(blocking=False):
        try:
            if _runners.pop(key, None) is runner:
                runner.close()
        finally:
            runner.busy.release()


class _Collector(logging.Handler):
    """Log handler that collects the distinct messages of one thread."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._thread = threading.get_ident()
        self.messages: dict[str, None] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Store the message once, as a failing run may repeat it in every step."""
        if record.thread == self._thread and len(self.messages) < 10:
            self.messages[record.getMessage()] = None


_collecting = threading.Lock()
_collectors: list[_Collector] = []
_propagated: list[bool] = []


@contextmanager
def _collected_warnings() -> Iterator[Mapping[str, None]]:
    """Collect the warnings of this thread's run, which would otherwise appear on the screen for each run."""
    collector = _Collector()
    with _collecting:
        if not _collectors:
            _propagated.append(_LOG.propagate)
            _LOG.propagate = False
        _collectors.append(collector)
        _LOG.addHandler(collector)
    try:
        yield collector.messages
    finally:
        with _collecting:
            _LOG.removeHandler(collector)
            _collectors.remove(collector)
            if not _collectors:
                _LOG.propagate = _propagated.pop()
