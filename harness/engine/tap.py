"""Taps: functions that read the values of a running system."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from harness.errors import ExperimentError
from harness.parts.part import Values
from harness.result import Result, make_result
from harness.system.plan import Plan

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


class Recorder:
    """Recorder that copies values to a preallocated table after every ``decimate`` ticks.

    Attributes
    ----------
    attributes : dict
        The same, to which the run adds what it has measured.
    filled : int
        Number of rows recorded so far.
    rows : float64 array, shape (R, C)
        The table.
    columns : list of int, length C
        Recorded signals.
    """

    def __init__(
        self,
        plan: Plan,
        names: Sequence[str],
        decimate: int,
        begin: int = 0,
        attributes: Mapping[str, str | float] | None = None,
    ) -> None:
        """Allocate the table."""
        self._first = -(-begin // decimate)
        self.names = tuple(names)
        self.attributes = dict(attributes or {})
        self.decimate = decimate
        self._plan = plan
        self.filled = 0
        self._end: float | None = None
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
        return make_result(times, rows, {name: self._plan.ports[name] for name in self.names}, self.attributes)
