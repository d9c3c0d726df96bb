"""Batches: copies of a system that are stepped together, with arrays of their inputs and outputs."""

from __future__ import annotations

import ctypes
import pickle
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harness.compiling.engine_library import library, mirror
from harness.engine.algorithm import Recorder, Ticks
from harness.engine.compiled import check_engine, pays, place_of
from harness.errors import ExperimentError, HarnessError, StartValueError, UnknownNameError, nearest
from harness.masters import find_master
from harness.parts.callable_part import CallablePart
from harness.parts.fmu import FmuPart
from harness.parts.guard import Guard
from harness.parts.part import Native, Part, Port, StartValue, Values
from harness.parts.series import SeriesPart
from harness.processors import available
from harness.system.assembly import Assembled, assembled
from harness.system.experiment import Experiment
from harness.system.graph import check_loops, find_feedthrough, make_plan, recorded_names, state_outputs
from harness.system.initialisation import Initialisation
from harness.system.wire import Wire, split_name
from harness.values import is_count, plain, shown

if TYPE_CHECKING:
    from harness.system.system import System

FEWEST: Final = 16  # copies that are worth a thread
_NOT_A_NUMBER: Final = 105  # of batch.h

Piece = mirror("Piece")
BatchData = mirror("Batch")


class HeldInputs(CallablePart):
    """The inputs of a batch, as held outputs of a part that exists in C only."""

    def __init__(self, name: str, ports: Sequence[Port]) -> None:
        self.starts = {port.name: float(port.start or 0.0) for port in ports}  # the values at the start of a run
        super().__init__(name, lambda t, u, x: [*self.starts.values()], outputs=ports, sampled=True)

    def native(self, inputs: Sequence[str], outputs: Sequence[str]) -> Native | None:
        """Return functions that do nothing."""
        functions = defaultdict[str, int](int, blockDirect=library().engine_inert())
        return Native(0, None, functions, (), (0,) * len(outputs), False, True, lambda *_: HarnessError("no part"))


class _Engine:
    """An engine for one thread, with its own parts."""

    def __init__(self, system: System, experiment: Experiment, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        self._system = _with_inputs(system, inputs)
        parts, wires = self._system.parts, self._system.wires
        self._guard = Guard([*parts.values()])
        with self._guard.running():
            find_feedthrough(self._system, experiment)
        master = find_master(experiment.master)
        plan = self._plan = make_plan(
            self._system, experiment, [*outputs, *(state_outputs(parts) if master.implicit else ())]
        )
        schedule = master.schedule(plan, experiment)
        check_loops(parts, wires, implicit=schedule.implicit)
        self._initialisation = Initialisation(plan, self._system, experiment, self._guard, open_end=True)
        self._ticks = Ticks(plan, schedule, (), measured=False)
        for part in parts.values():
            if isinstance(part, FmuPart):
                part.reuse = True
        self._columns = np.array([plan.columns[name] for name in outputs], dtype=np.int64)
        self._held = [part for part in plan.parts if isinstance(part, HeldInputs)]
        names = [f"{part.name}.{name}" for part in self._held for name in inputs]
        self._inputs = np.array([plan.columns[name] for name in names], dtype=np.int64)

    def start(self, values: Mapping[str, StartValue], varied: Collection[str]) -> NDArray[np.uint8]:
        """Begin a run and return the state at its start, with the parameters of the varied parts."""
        for part in self._held:
            part.starts |= {name: float(values[name]) for name in part.starts.keys() & values.keys()}
        with self._guard.running():
            self._initialisation.start({**self._system.start, **values})
        self._ticks.begin(Recorder(self._plan, (), 1))
        places = [
            (row.ctypes.data, row.nbytes)
            for array in self._ticks.memory.values()
            for row in (array if array.ndim > 1 else [array])
        ]
        places.append((self._plan.signals.ctypes.data, 8 * int(self._plan.inputs.max(initial=len(self._plan.signals)))))
        places += self._places(varied)
        self.pieces = (Piece * len(places))(*(Piece(*place) for place in places))
        self.data = BatchData(ctypes.addressof(self.pieces), len(places), 0, sum(size for _, size in places))
        self.data.targets, self.data.input_count = self._inputs.ctypes.data, len(self._inputs)
        self.data.columns, self.data.output_count = self._columns.ctypes.data, len(self._columns)
        return np.concatenate([np.frombuffer(ctypes.string_at(*place), dtype=np.uint8) for place in places])

    def _places(self, varied: Collection[str]) -> list[tuple[int, int]]:
        """Return what steps may change of each FMU, and the parameters of the varied ones."""
        found = []
        for part, native in zip(self._plan.parts, self._ticks.engine.parts, strict=True):
            if isinstance(part, HeldInputs):
                continue
            if not native.direct:
                raise HarnessError(_refusal(part))
            place, size, fixed = place_of(native)
            skipped = 0 if part.name in varied else fixed
            found.append((place + skipped, size - skipped))
        return found

    def compile(self, *, required: bool) -> None:
        """Let the loop be compiled."""
        self._ticks.compile(required=required)

    def outputs(self) -> Values:
        """Return the outputs at the start of the run."""
        return self._plan.signals[self._columns]

    def step(self, batch: Batch, inputs: Values, steps: int, first: int, last: int) -> dict[int, Exception]:
        """Step some copies; return the errors of those that fail."""
        data, errors = self.data, dict[int, Exception]()
        data.size = batch._states.shape[1]
        data.states, data.ticks, data.steps = batch._states.ctypes.data, batch._ticks.ctypes.data, steps
        data.inputs, data.outputs = inputs.ctypes.data, batch.values.ctypes.data
        run, engine = library().engine_batch, ctypes.addressof(self._ticks.engine.data)
        while (first := run(engine, ctypes.addressof(data), first, last)) < last:
            errors[first] = self._failure(batch, inputs[first])
            first += 1
        return errors

    def _failure(self, batch: Batch, row: Values) -> Exception:
        data = self._ticks.engine.data
        if data.status != _NOT_A_NUMBER:
            error = self._ticks.failure()
            assert isinstance(error, Exception)
            return error
        number = int(data.failed_part)
        return ExperimentError(f"the input {batch.inputs[number]} is {row[number]}: give a finite number")

    def close(self) -> None:
        """Free the instances and unload the FMUs."""
        self._ticks.close()
        for part in self._system.parts.values():
            part.terminate()
            part.close()


class Batch:
    """Copies of a system that are stepped together; `System.batch` makes it.

    Parameters
    ----------
    system : System
        The system.
    n : int
        Number of copies.
    inputs, outputs : sequence of str
        ``part.port`` of each column of the arrays.
    start : mapping of str to value or array_like of shape (n,)
        Further start values.
    threads : int or None
        Number of threads; None chooses it.
    experiment : Experiment
        Settings, of which step, start and master count.
    engine : {"auto", "general", "compiled"}
        See `System.run`; "auto" compiles once 1e9 steps of parts have been taken.

    Attributes
    ----------
    values : float64 array, shape (n, len(outputs))
        The outputs of all copies; `step` and `reset` write to it.
    failures : dict of int to Exception
        Why copies kept their state in the last call of `step`, by their index.
    """

    def __init__(
        self,
        system: System,
        n: int,
        inputs: Sequence[str],
        outputs: Sequence[str],
        start: Mapping[str, ArrayLike],
        threads: int | None,
        experiment: Experiment,
        engine: str,
    ) -> None:
        check_engine(engine)
        if not is_count(n):
            raise ExperimentError(f"a batch of {shown(n)} copies: give an integer number, 1 or more")
        if threads is not None and not is_count(threads):
            raise ExperimentError(f"{shown(threads)} threads: give an integer number, 1 or more")
        self.n, self.inputs, self._experiment = int(n), tuple(inputs), experiment
        self._engine, self._parts, self._taken = engine, len(system.parts), 0  # steps of parts so far
        self.outputs = tuple(recorded_names(system.parts, outputs, "outputs"))
        for part in system.parts.values():
            if not isinstance(part, FmuPart):
                raise HarnessError(_refusal(part))
        self.failures: dict[int, Exception] = {}
        same = {name: plain(value) for name, value in start.items() if np.isscalar(value)}
        self._varied = {name: _column(name, value, self.n) for name, value in start.items() if name not in same}
        whole = system.with_start({**same, **self._start_of(0)})
        count = min(threads or available(), max(1, self.n // FEWEST))
        self._bounds = np.linspace(0, self.n, count + 1).astype(int).tolist()
        self._pool = ThreadPoolExecutor(count - 1) if count > 1 else None
        self._engines: list[_Engine] = []
        try:
            for _ in range(count):
                self._engines.append(_Engine(pickle.loads(pickle.dumps(whole)), experiment, self.inputs, self.outputs))
            self._begin()
            self._compile()
        except BaseException:
            self.close()
            raise

    def _begin(self) -> None:
        """Start all copies."""
        parts = {split_name(name)[0] for name in self._varied}
        size = min(engine.start({}, parts).size for engine in self._engines)  # all are equal
        kinds = self.n if self._varied else 1  # of starts
        try:
            self._starts, self._states = (
                np.zeros((rows, -(-size // 8)), dtype=np.int64).view(np.uint8) for rows in (kinds, self.n)
            )
            self._shown, self.values = (np.zeros((rows, len(self.outputs))) for rows in (kinds, self.n))
        except MemoryError as error:
            raise ExperimentError(f"{self.n} copies of {size} bytes do not fit into memory: take fewer") from error
        self._ticks = np.zeros(self.n, dtype=np.int64)
        self._restart(range(kinds))
        self._return(np.arange(self.n))

    def _start_of(self, copy: int) -> dict[str, StartValue]:
        """Return the start values of a copy that differ from those of others."""
        return {name: column[copy].item() for name, column in self._varied.items()}

    def _restart(self, kinds: Iterable[int]) -> None:
        """Compute states at the start."""
        parts, engine = {split_name(name)[0] for name in self._varied}, self._engines[0]
        for row in kinds:
            state = engine.start(self._start_of(row), parts)
            self._starts[row, : state.size], self._shown[row] = state, engine.outputs()

    def _return(self, which: NDArray[np.int64]) -> None:
        """Return copies to their start."""
        rows = which if self._varied else np.zeros_like(which)
        self._states[which], self.values[which], self._ticks[which] = self._starts[rows], self._shown[rows], 0

    @property
    def time(self) -> Values:
        """Time of each copy [s]."""
        return np.asarray(self._experiment.start + self._ticks * self._experiment.step)

    @property
    def size(self) -> int:
        """Memory of a copy [bytes], without the row of its outputs."""
        return int(self._states.shape[1] + self._ticks.itemsize + (self._starts.shape[1] if self._varied else 0))

    def step(self, inputs: ArrayLike = (), steps: int = 1) -> Values:
        """Step all copies.

        A copy whose step fails keeps its state and its values, and an error is in ``failures``; the others go on.

        Parameters
        ----------
        inputs : array_like, shape (n, len(inputs))
            Inputs, which hold during the steps. A contiguous array of float64 is not copied.
        steps : int
            Number of communication steps.

        Returns
        -------
        float64 array, shape (n, len(outputs))
            The array `values`.

        Raises
        ------
        ExperimentError
            If the inputs have another shape or the number of steps is none; nothing is stepped then.
        """
        self._require_open()
        if not is_count(steps):
            raise ExperimentError(f"{shown(steps)} steps: give an integer number, 1 or more")
        rows = _table(inputs, (self.n, len(self.inputs)), "inputs")
        self._compile()
        spans = list(zip(self._engines, self._bounds, self._bounds[1:], strict=False))

        def run(span: tuple[_Engine, int, int]) -> dict[int, Exception]:
            engine, first, last = span
            return engine.step(self, rows, int(steps), first, last)

        others = self._pool.map(run, spans[1:]) if self._pool else ()
        self.failures = run(spans[0])
        for found in others:
            self.failures |= found
        self._taken += self.n * int(steps) * self._parts
        return self.values

    def _compile(self) -> None:
        """Compile the loop of each engine as soon as the steps so far make it worth while."""
        if pays(self._engine, self._taken):
            for engine in self._engines:
                engine.compile(required=self._engine == "compiled")

    def reset(self, which: ArrayLike | None = None, start: Mapping[str, ArrayLike] | None = None) -> Values:
        """Return copies to their start.

        Parameters
        ----------
        which : array_like of int or bool, or None
            Indices of the copies, or a mask of all; None takes all.
        start : mapping of str to array_like
            New start values of these copies, of variables to which `System.batch` has given an array.

        Returns
        -------
        float64 array, shape (n, len(outputs))
            The array `values`.

        Raises
        ------
        ExperimentError, StartValueError
            If there is no such copy or a start value is not accepted.
        """
        self._require_open()
        chosen = self._chosen(which)
        for name in start or {}:
            if name not in self._varied:
                raise UnknownNameError(
                    f"{name} has no start value for each copy: give the batch an array of them, "
                    f"or {nearest(name, self._varied)}"
                )
        given = {name: _column(name, value, len(chosen)) for name, value in (start or {}).items()}
        before = {name: self._varied[name].copy() for name in given}
        for name, column in given.items():
            self._varied[name][chosen] = column
        try:
            if given:
                self._restart(chosen.tolist())
        except BaseException:
            self._varied |= before
            self._restart(chosen.tolist())
            raise
        self._return(chosen)
        return self.values

    def _require_open(self) -> None:
        if not self._engines:
            raise HarnessError("the batch is closed: make another one with System.batch")

    def _chosen(self, which: ArrayLike | None) -> NDArray[np.int64]:
        """Return the indices of copies."""
        if which is None:
            return np.arange(self.n)
        found = np.asarray(which)
        if found.dtype == bool and found.shape == (self.n,):
            return np.flatnonzero(found)
        if found.ndim != 1 or not (found.size == 0 or found.dtype.kind in "iu"):
            raise ExperimentError(f"{shown(which)} names no copies: give their indices, or a mask of {self.n}")
        for index in found:
            if not 0 <= index < self.n:
                raise ExperimentError(f"there is no copy {index}: give indices from 0 to {self.n - 1}")
        return found.astype(np.int64)

    def close(self) -> None:
        """Free the parts."""
        if self._pool:
            self._pool.shutdown()
        for engine in self._engines:
            engine.close()
        self._engines = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _table(values: ArrayLike, shape: tuple[int, int], what: str) -> Values:
    """Return numbers as a contiguous array of this shape."""
    try:
        table = np.ascontiguousarray(np.asarray(values).astype(np.float64, casting="same_kind", copy=False))
    except (TypeError, ValueError) as error:
        raise ExperimentError(f"the {what} are not numbers ({error}): give an array of float64") from error
    if table.shape != shape and not (table.size == 0 and 0 in shape):
        raise ExperimentError(f"the {what} have the shape {table.shape}: give {shape}, a row for each copy")
    return table.reshape(shape)


def _column(name: str, values: ArrayLike, n: int) -> NDArray[Any]:
    try:
        column = np.array(values)
    except ValueError as error:
        raise StartValueError(f"the start values of {name} are no array ({error}): give {n} numbers") from error
    if column.shape != (n,) or column.dtype.kind not in "fiub":
        raise StartValueError(
            f"the start values of {name} have the shape {column.shape}: give a number, or {n} of them"
        )
    return column.astype(np.float64)  # the first ones may be integers, and those of a reset not


def _refusal(part: Part) -> str:
    """Return why a part cannot be in a batch."""
    if isinstance(part, SeriesPart):
        return f"'{part.name}' is a recorded series: list its outputs among the inputs of the batch"
    if isinstance(part, FmuPart):
        return (
            f"'{part.name}' is no block or law of this project: build {part.path.name} again if it is one, or run the "
            "system in a sweep"
        )
    return f"'{part.name}' is a part in Python, which would be called for each copy: replace it with a law or a .c file"


def _with_inputs(system: System, inputs: Sequence[str]) -> Assembled:
    """Return the system with a part that drives these inputs."""
    driven = {wire.target: wire.source for wire in system.wires}
    ports = {f"{part.name}.{port.name}": port for part in system.parts.values() for port in part.inputs}
    for number, name in enumerate(inputs):
        if name in inputs[:number]:
            raise ExperimentError(f"the input {name} is listed twice: list it once")
        if name in driven:
            raise ExperimentError(f"the input {name} is driven by {driven[name]}: list unconnected inputs")
        if name not in ports:
            raise UnknownNameError(f"there is no input '{name}': {nearest(name, ports)}")
    if not inputs:
        return assembled(system)
    own = "inputs"
    while own in system.parts:
        own += "_"
    part = HeldInputs(
        own,
        [
            replace(ports[name], name=name, start=system.start.get(name, ports[name].start), held=True)
            for name in inputs
        ],
    )
    wires = [*system.wires, *(Wire(f"{own}.{name}", name) for name in inputs)]
    start = {name: value for name, value in system.start.items() if name not in inputs}
    return assembled(system, parts={**system.parts, own: part}, wires=wires, start=start)
