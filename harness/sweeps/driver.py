"""A sweep: many runs of one system on several workers, with results in a folder."""

import json
import pickle
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from contextlib import ExitStack
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, Final
from uuid import uuid4

import xarray as xr

from harness.engine.algorithm import Progress
from harness.engine.checkpoint import digest, function_identity, part_identity
from harness.engine.compiled import check_engine
from harness.errors import SweepError, nearest
from harness.extras import require
from harness.sweeps.columns import Columns, Memory, Storage
from harness.sweeps.measures import Builtin, Measure, find_measures, label
from harness.sweeps.pools import LOOK, Outcomes, Pool, ProcessPool, SerialPool, make_pool
from harness.sweeps.samples import Given, Sample, checked_samples, column_types, settable
from harness.sweeps.worker import Job, Outcome
from harness.system.experiment import SCALARS, Experiment, as_experiment
from harness.system.graph import find_port, recorded_names, stepping_order
from harness.system.system import System

TRIES: Final = 3  # number of workers that may die in a run before it counts as failed


class Queue:
    """Queue of the remaining runs."""

    # A chunk takes about 0.5 s or 2 % of the sweep's duration so far, and at most 10 s. This limits the work lost if
    # the sweep is killed, and also the number of files. Towards the end, chunks become smaller, so that all workers
    # finish at about the same time.

    def __init__(self, runs: Iterable[int], most: int) -> None:
        self._runs = deque(runs)
        self._most = most
        self._again: deque[list[int]] = deque()
        self._deaths: Counter[int] = Counter()
        self._seconds: float | None = None
        self._begin = monotonic()

    @property
    def left(self) -> bool:
        """Whether runs remain."""
        return bool(self._runs or self._again)

    def take(self, workers: int) -> list[int]:
        """Return the runs of the next chunk."""
        if self._again:
            return self._again.popleft()
        size = 1.0
        if self._seconds is not None:
            span = min(10.0, max(0.5, 0.02 * (monotonic() - self._begin)))
            size = max(0.05 / self._seconds, min(span / self._seconds, len(self._runs) / (2 * workers)))
        count = min(max(1, int(size)), self._most, len(self._runs))
        return [self._runs.popleft() for _ in range(count)]

    def note(self, outcomes: Sequence[Outcome]) -> None:
        """Update the estimated duration of a run."""
        if outcomes:
            self._seconds = max(1e-6, sum(outcome.wall_time for outcome in outcomes) / len(outcomes))

    def give_back(self, chunk: Sequence[int]) -> list[Outcome]:
        """Return a chunk whose worker died to the queue, in halves, to isolate the run that killed it."""
        if len(chunk) > 1:
            half = len(chunk) // 2
            self._again += [list(chunk[:half]), list(chunk[half:])]
            return []
        (run,) = chunk
        self._deaths[run] += 1
        if self._deaths[run] < TRIES:
            self._again.append([run])
            return []
        return [Outcome(run, error=f"{TRIES} worker processes died in this run: check whether an FMU crashes")]


def description(system: System, job: Job, samples: Sequence[Sample]) -> dict[str, Any]:
    """Return a description of a sweep as JSON, with hashes of its large elements."""
    content = {
        "parts": {name: part_identity(part) for name, part in system.parts.items()},
        "wires": sorted(repr(wire) for wire in system.wires),
        "start": dict(system.start),
    }
    experiment = {key.name: getattr(job.experiment, key.name) for key in fields(job.experiment)}
    return {
        "system": digest(json.dumps(content, sort_keys=True).encode()),
        "samples": digest(json.dumps(samples).encode()),
        "runs": len(samples),
        "experiment": experiment | {"manipulators": [repr(one) for one in job.experiment.manipulators]},
        "measures": [_measure(measure) for measure in job.measures],
        "keep": job.keep,
    } | ({"accuracy": True} if job.accuracy else {})


def _measure(measure: Measure) -> str:
    return str(measure) if isinstance(measure, Builtin) else f"{label(measure)} {function_identity(measure)}"


_MOST_BYTES = 32e6  # largest size of the trajectories in one file [bytes]


def sweep(
    system: System | str | Path | Callable[[], System],
    samples: Iterable[Given],
    *,
    measure: str | Measure | Iterable[str | Measure] = "final(*)",
    output: str | Path | None = None,
    executor: Any = "processes",
    workers: int | None = None,
    experiment: Experiment | Mapping[str, Any] | None = None,
    keep: Sequence[str] = (),
    resolve: Callable[[str], Path] | None = None,
    progress: Progress | None = None,
    accuracy: bool = False,
    engine: str = "auto",
) -> xr.Dataset:
    """Run a system with many parameter sets.

    Parameters
    ----------
    system : System, path-like or callable
        The system, its TOML file or SSP archive, or a module-level function that returns it.
    samples : iterable of mapping of str to value, or of ParameterSet
        A parameter set for each run: start values "part.port" and settings of the experiment (``start``, ``stop``,
        ``step``, ``master``, ``decimate``, ``tolerance``, ``extrapolation``, ``loop_tolerance``,
        ``coupling_tolerance``, ``step_tolerance``). See `grid`, `latin_hypercube`, `sobol` and `read_samples`.
    measure : str, callable, or several of them
        Results of each run: ``final``, ``min``, ``max``, ``max_abs``, ``mean`` or ``rms`` over the recorded rows of a
        variable, such as ``rms(part.port)``, where ``*`` and ``?`` match outputs; or module-level functions that return
        a mapping of names to numbers for the result of a run.
    output : path-like or None
        Folder for the results; an interrupted sweep in it resumes where it stopped. None writes no files.
    executor : {"processes", "threads", "serial"} or distributed.Client
        Where the runs are executed.
    workers : int or None
        Number of processes or threads; None uses one per processor.
    experiment : Experiment, mapping or None
        Settings of each run; None uses those of the system, or stop and step of the samples. Functions in ``measure``
        receive the variables that it records.
    keep : sequence of str
        Variables whose trajectories are also stored in the folder; ``*`` and ``?`` match outputs.
    resolve : callable or None
        See `System.from_toml`.
    progress : Progress or None
        Receives the number of completed runs.
    accuracy : bool
        Whether each run is repeated with other steps, which gives each measure ``x`` an error bound ``x.bound``.
    engine : {"auto", "general", "compiled"}
        See `System.run`; "auto" counts the steps of all runs.

    Returns
    -------
    xarray.Dataset
        The table of runs, see `read_sweep`; it contains the error of each failed run.

    Raises
    ------
    SweepError
        If the sweep is invalid or the folder contains another sweep.
    HarnessError
        If a name is unknown or the system is invalid.
    """
    check_engine(engine)
    with ExitStack() as stack:
        if isinstance(system, (str, Path)):
            archive = Path(system).suffix.lower() == ".ssp"
            system = stack.enter_context(System.from_ssp(system) if archive else System.from_toml(system, resolve))
        model = system if isinstance(system, System) else stack.enter_context(system())
        parameter_sets = checked_samples(samples, model)
        types = column_types(parameter_sets)
        units = _check_names(model, parameter_sets)
        base = as_experiment(experiment) or model.experiment
        if base is None and all({"stop", "step"} <= sample.keys() for sample in parameter_sets):
            base = as_experiment({key: parameter_sets[0][key] for key in ("stop", "step")})  # each run replaces them
        job = replace(_make_job(system, model, measure, base, keep), accuracy=accuracy)
        if output is None:
            if keep:
                raise SweepError("keep names trajectories to store, but there is no folder: give an output folder")
            storage: Storage = Memory(Columns(types, units))
        else:
            require("pyarrow", "the folder of a sweep, which has Parquet files, needs it")
            from harness.sweeps.folder import SweepFolder, sole_writer

            folder = Path(output).absolute()  # an FMU may change the working directory
            stack.enter_context(sole_writer(folder))
            kinds = {name: find_port(model.parts, name, "keep").type for name in job.keep}
            storage = SweepFolder(folder, description(model, job, parameter_sets), types, units, kinds)
        pending = [run for run in range(len(parameter_sets)) if run not in storage.done]
        if progress is not None:
            progress.update(len(storage.done), len(parameter_sets))
        job = replace(job, engine=engine, runs=len(pending))
        if pending:
            pool = make_pool(executor, workers)
            try:
                _check_portable(job, pool)
                _drive(job, parameter_sets, Queue(pending, _most_runs(job)), pool, storage, progress)
            finally:
                pool.close(job)
        return storage.read()


def _drive(
    job: Job, samples: Sequence[Sample], queue: Queue, pool: Pool, storage: Storage, progress: Progress | None
) -> None:
    """Distribute chunks and store their outcomes until all runs are done."""
    running: dict[Outcomes, list[int]] = {}
    while running or queue.left:
        while len(running) < pool.capacity() and queue.left:
            chunk = queue.take(pool.capacity())
            running[pool.submit(job, [(run, samples[run]) for run in chunk])] = chunk
        finished, _ = wait(running, LOOK, FIRST_COMPLETED)
        for future in finished:
            chunk = running.pop(future)
            try:
                outcomes: Sequence[Outcome] = future.result()
                queue.note(outcomes)
            except pool.losses:
                outcomes = queue.give_back(chunk)
            storage.add(outcomes, samples)
        if progress is not None:
            progress.update(len(storage.done), len(samples))


def _check_names(model: System, samples: Iterable[Sample]) -> dict[str, str]:
    """Return the units of the swept start values; check each set of names once, and values in the runs."""
    tried: set[frozenset[str]] = set()
    for sample in samples:
        names = frozenset(sample)
        if names in tried:
            continue
        tried.add(names)
        for name in names:
            if "." not in name and name not in SCALARS:
                raise SweepError(
                    f"'{name}' is neither a variable 'part.port' nor a setting of the experiment: "
                    f"{nearest(name, SCALARS)}"
                )
        model.with_start({name: value for name, value in sample.items() if name not in SCALARS})
    swept = set().union(*tried)
    ports = settable(model)
    units = {name: ports[name].unit for name in swept if name in ports}
    seconds = {name: "s" for name in ("start", "stop", "step") if name in swept}
    return {name: unit for name, unit in units.items() if unit} | seconds


def _make_job(
    system: System | Callable[[], System],
    model: System,
    measure: str | Measure | Iterable[str | Measure],
    base: Experiment | None,
    keep: Sequence[str],
) -> Job:
    if base is None:
        raise SweepError(f"the system '{model.name}' has no experiment: give one with stop and step")
    measures = find_measures(measure, model.parts)
    kept = recorded_names(model.parts, keep)
    names = [one.name for one in measures if isinstance(one, Builtin)]
    if len(names) < len(measures):
        names += recorded_names(model.parts, base.record)
    record = tuple(dict.fromkeys((*names, *kept)))
    # found once for all runs, unless it depends on their start values
    declared = not any(part.undeclared for part in model.parts.values())
    order = base.order or (tuple(stepping_order(model.parts, model.wires)) if declared else ())
    return Job(uuid4().hex, _opener(system), replace(base, record=record, order=order), measures, tuple(kept))


def _opener(system: System | Callable[[], System]) -> Callable[[], System]:
    """Return the function that makes a system for one worker."""
    if not isinstance(system, System):
        return system
    try:
        return partial(pickle.loads, pickle.dumps(system))
    except Exception:  # a user's function can contain anything
        return partial(_itself, system)


def _itself(system: System) -> System:
    """Return a system that cannot be copied; only one thread can use it."""
    return system


def _check_portable(job: Job, pool: Pool) -> None:
    """Raise a SweepError unless everything that a worker needs can be sent to it."""
    if isinstance(pool, SerialPool):
        return
    if isinstance(job.open, partial) and job.open.func is _itself:
        raise SweepError(
            "the system cannot be copied for several workers, as one of its parts uses functions that are not at "
            "module level: give a function that returns the system, or use the executor 'serial'"
        )
    if not isinstance(pool, ProcessPool):
        return
    what: Mapping[str, object] = {"function that makes the system": job.open} | {
        f"measure {label(measure)}": measure for measure in job.measures
    }
    for name, thing in what.items():
        try:
            pickle.dumps(thing)
        except Exception as error:
            raise SweepError(
                f"the {name} cannot be sent to another process: define it at module level or use the executor 'threads'"
            ) from error


def _most_runs(job: Job) -> int:
    """Return the largest number of runs in a chunk whose trajectories fit into memory."""
    size = 8 * (1 + len(job.keep)) * (job.experiment.ticks // job.experiment.decimate + 1)
    return max(1, int(_MOST_BYTES / size)) if job.keep else 100_000
