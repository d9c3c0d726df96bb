"""A run as the engine sees it: masters that are more than a list of operations, taps, and ticks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from harness.compiling.engine_library import mirror
from harness.engine.compiled import compiled_loop
from harness.engine.defect import Coupling
from harness.engine.manipulate import Manipulations
from harness.engine.native import NOT_CONVERGED, Engine
from harness.errors import ExperimentError, HarnessError
from harness.parts.part import Values
from harness.result import make_result
from harness.system.plan import MovingWire, Plan, Schedule, map_of
from harness.system.wire import Manipulator

if TYPE_CHECKING:
    from harness.result import Result

Reader: TypeAlias = Callable[[int], None]


@dataclass(frozen=True)
class Tap:
    """A function that receives values during a run.

    Parameters
    ----------
    read : callable
        ``read(t, values)`` with the time [s] and a float64 array, shape (len(names),). The array is reused: copy the
        values that you keep.
    names : tuple of str
        ``part.port`` of each value.
    every : int
        Number of communication steps between two calls; the first call is at the start.
    """

    read: Callable[[float, Values], None]
    names: tuple[str, ...]
    every: int = 1


class Progress(Protocol):
    """Interface to which a run reports its progress, such as a progress bar."""

    def update(self, done: int, total: int) -> None:
        """Report that ``done`` of ``total`` communication steps are done; called about 100 times and at the end.

        Parameters
        ----------
        done, total : int
            Numbers of communication steps.
        """


def tap_reader(plan: Plan, tap: Tap) -> Reader:
    """Return the tap as a function of the tick."""
    columns = np.array([plan.columns[name] for name in tap.names], dtype=np.int64)
    values = np.zeros(len(columns))

    def read(tick: int) -> None:
        np.take(plan.signals, columns, out=values, mode="clip")
        tap.read(plan.time(tick), values)

    return read


def event_reader(plan: Plan, recorder: Recorder) -> Reader:
    """Return a function of the tick that takes the events due then, records what they change, and undoes them."""
    # Of the inputs, those from parts without inputs, such as recorded series, have their values at this time.
    parts = [index for index, part in enumerate(plan.parts) if part.events and part.saves]
    known = {output for output, source in plan.owners.items() if not plan.parts[source].inputs}
    driven = {
        index: [i for i in range(*plan.inputs[index]) if plan.sources[i] in known and not plan.delays[i]]
        for index in parts
    }
    states: dict[int, object] = {}

    def read(tick: int) -> None:
        before = plan.signals.copy()
        for index in parts:
            if tick % plan.every[index]:
                continue
            part, calls = plan.parts[index], plan.calls[index]
            states[index] = part.save(states.get(index))
            for i in driven[index]:
                plan.signals[i] = map_of(plan.gains[i], plan.offsets[i], plan.signals[plan.sources[i]])
            if driven[index]:
                calls.set()
            part.event(plan.time(tick))
            calls.get()
            part.restore(states[index])
        recorder.add(before)
        plan.signals[:] = before

    return read


class Recorder:
    """Recorder that copies values to a preallocated table after every ``decimate`` ticks."""

    def __init__(
        self,
        plan: Plan,
        names: Sequence[str],
        decimate: int,
        begin: int = 0,
        attributes: Mapping[str, str | float] | None = None,
    ) -> None:
        self._first = -(-begin // decimate)
        self.names = tuple(names)
        self.attributes = dict(attributes or {})  # the run adds what it has measured
        self.decimate = decimate
        self._plan = plan
        self.filled = 0  # number of rows recorded so far
        self._end: float | None = None
        self._after: list[tuple[int, Values]] = []
        rows = plan.ticks // decimate + 1 - self._first
        try:
            self.rows = np.empty((max(rows, 0), len(self.names)))
        except (MemoryError, ValueError) as error:
            gigabytes = 8e-9 * rows * len(self.names)
            raise ExperimentError(
                f"recording {len(self.names)} variables at {rows} times takes {gigabytes:.3g} GB, more than is "
                "available: record fewer variables or increase decimate"
            ) from error
        self.columns = [plan.columns[name] for name in self.names]

    @property
    def read(self) -> Reader:
        """Return a function that records one row; it is not stored, as a reference cycle would keep the table alive."""
        columns = self.columns
        width = len(columns)
        if width and columns == list(range(columns[0], columns[0] + width)):
            # contiguous columns, as in a run that records everything: a plain copy is five times as fast
            source = memoryview(self._plan.signals.data)[columns[0] : columns[0] + width]
            table = memoryview(self.rows.reshape(-1).data)

            def copy(tick: int) -> None:
                row = self.filled
                table[row * width : (row + 1) * width] = source
                self.filled = row + 1

            return copy

        indices = np.array(columns, dtype=np.int64)
        signals, rows = self._plan.signals, self.rows

        def take(tick: int) -> None:
            signals.take(indices, out=rows[self.filled], mode="clip")
            self.filled += 1

        return take

    def add(self, before: Values) -> None:
        """Add a row at the time of the last one if these values before an event are no longer the present ones."""
        row = self._plan.signals[self.columns]
        if not np.array_equal(row, before[self.columns], equal_nan=True):
            self._after.append((self.filled, row))

    def read_end(self, time: float) -> None:
        """Record a last row at a time between two ticks."""
        self.rows = np.vstack([self.rows[: self.filled], self._plan.signals[self.columns]])
        self.filled, self._end = self.filled + 1, time

    def column(self, name: str) -> Values:
        """Return the recorded values of a variable."""
        return np.ascontiguousarray(self.rows[: self.filled, self.names.index(name)])

    @property
    def times(self) -> Values:
        """Time of each row that has been recorded [s]."""
        ticks = (self._first + np.arange(self.filled)) * self.decimate
        times: Values = self._plan.start + ticks * np.float64(self._plan.step)
        if self._end is not None:
            times[-1] = self._end
        return times

    def result(self) -> Result:
        """What has been recorded so far."""
        rows, times = self.rows[: self.filled], self.times
        if self._after:
            places, after = zip(*self._after, strict=True)
            rows, times = np.insert(rows, places, after, axis=0), np.insert(times, places, times[np.array(places) - 1])
        return make_result(times, rows, {name: self._plan.ports[name] for name in self.names}, self.attributes)


Line = mirror("Line")


def attach_lines(engine: Engine, wires: Sequence[MovingWire]) -> None:
    """Add a line for each of these connections to the engine."""
    lines = (Line * max(1, len(wires)))(*(Line(wire.input) for wire in wires))
    begins = np.searchsorted([wire.target for wire in wires], range(len(engine.plan.parts) + 1)).astype(np.int64)
    engine.data.lines, engine.data.lines_from = engine.keep_struct(lines), engine.keep(begins)


class Algorithm(ABC):
    """Data of a master in C, attached to an engine."""

    @abstractmethod
    def begin(self) -> None:
        """Begin a run at the start values of the plan; attach the data to the engine."""

    @abstractmethod
    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""

    def report(self) -> dict[str, str | float]:
        """Log warnings about the run that has ended, and return its attributes."""
        return {}

    def failure(self, number: int, time: float) -> HarnessError:
        """Return the error for a tick that has no solution."""
        return HarnessError(f"the master found no solution at t = {time:.12g} s; use a shorter step")


class Ticks:
    """The ticks of a run, in C."""

    def __init__(
        self, plan: Plan, schedule: Schedule, manipulators: Sequence[Manipulator], *, measured: bool = True
    ) -> None:
        self.engine, self._lines = Engine(plan, schedule.operations), schedule.lines
        self._algorithm = schedule.algorithm(self.engine) if schedule.algorithm else None
        coupling = Coupling(self.engine, schedule) if measured and not schedule.implicit else None
        self._mechanisms = [each for each in (self._algorithm, coupling) if each is not None]
        self._manipulations = Manipulations(plan, schedule, manipulators)
        self._loop: int | None = None

    def begin(self, recorder: Recorder) -> None:
        """Begin a run, whose parts have been started."""
        self._recorder = recorder
        self.engine.begin(recorder.rows, recorder.columns, recorder.decimate)
        self._manipulations.begin()
        self._manipulations.attach(self.engine)
        if self._lines:
            attach_lines(self.engine, self._lines)
        for mechanism in self._mechanisms:
            mechanism.begin()
        self.engine.data.compiled = self._loop
        remembering = (*self._mechanisms, self._manipulations)
        self.memory = {name: array for each in remembering for name, array in each.memory().items()}

    def compile(self, *, required: bool) -> None:
        """Compile the loop of this run and those that follow; raise a HarnessError if it is required and cannot be."""
        if self._loop is None:
            self._loop = compiled_loop(self.engine, required=required)
        self.engine.data.compiled = self._loop

    def run(self, first: int, last: int) -> None:
        """Run the ticks first, ..., last - 1."""
        data = self.engine.data
        data.filled = self._recorder.filled
        try:
            with self.engine.interruptible():
                if self.engine.run(first, last) < last:
                    raise self.failure()
        finally:
            self._recorder.filled = int(data.filled)

    def failure(self) -> BaseException:
        """Return the error of the last failed call."""
        data = self.engine.data
        if self._algorithm and self.engine.error is None and data.status == NOT_CONVERGED:
            return self._algorithm.failure(int(data.failed_part), float(data.failed_time))
        return self.engine.failure()

    def attributes(self) -> dict[str, str | float]:
        """Return what is to be known of the run, for the attributes of the result."""
        return {name: value for each in self._mechanisms for name, value in each.report().items()}

    def close(self) -> None:
        """Free the states that were saved within steps, and the table."""
        self.engine.end()
