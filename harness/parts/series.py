"""Parts that play back a recorded time series."""

from __future__ import annotations

import math
import struct
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from harness.errors import PartError, SeriesError
from harness.parts.part import Calls, Part, Port, StartValue, Values
from harness.storage.files import reason

LOST: Final = 0.05
"""Tolerated part of the range of a held signal that no step sees."""


@dataclass(frozen=True)
class SeriesArrays:
    """A recorded series as arrays."""

    times: Values  # times of the samples [s]
    values: Values
    slopes: Values
    """Row k applies from sample k on; its values change by ``slopes`` per second."""
    slack: float  # time by which rounding may put a communication point before its sample [s]
    end: float  # last time that a step may reach [s]


class SeriesPart(Part):
    """A part whose outputs play back recorded columns.

    Parameters
    ----------
    name : str
        Name within the system.
    times : array_like, shape (n,)
        Times of the samples [s], strictly increasing.
    columns : mapping of str to array_like, shape (n,)
        Values of each output.
    units : mapping of str to str
        Units of the columns.
    interpolation : {"linear", "previous"}
        Value between two samples: interpolated linearly, or held at the earlier sample.
    beyond : {"error", "hold"}
        Behaviour outside the record: raise an error, or hold the first or last value.
    path : Path or None
        The file from which the series was read, if any.

    Raises
    ------
    SeriesError
        If times or columns are not finite or differ in length, or if the times do not increase.
    """

    def __init__(
        self,
        name: str,
        times: ArrayLike,
        columns: Mapping[str, ArrayLike],
        units: Mapping[str, str] | None = None,
        *,
        interpolation: Literal["linear", "previous"] = "linear",
        beyond: Literal["error", "hold"] = "error",
        path: Path | None = None,
    ) -> None:
        self.name = name
        self.path = path
        self.interpolation = interpolation
        self.beyond = beyond
        held = interpolation == "previous"
        self.outputs = tuple(Port(column, (units or {}).get(column), held=held) for column in columns)
        self.inputs = ()
        self.dependencies = {column: frozenset() for column in columns}
        remedy = "give seconds, such as (index - index[0]).total_seconds()"
        self._times = _numbers(name, "times", times, remedy).reshape(-1)
        remedy = "give numbers in the unit of the column"
        self._values = np.array(
            [_numbers(name, f"values '{each}'", values, remedy) for each, values in columns.items()]
        ).T
        self._check()
        self._grid: list[float] = self._times.tolist()
        # rounding can put a communication point slightly before the sample that it should meet
        self._reach = 1e-9 * max(abs(self._grid[0]), abs(self._grid[-1]), self._grid[-1] - self._grid[0])
        self._slack = 1e-6 * float(np.diff(self._times).min()) if len(self._grid) > 1 else 0.0
        self._now = self._grid[0]

    @classmethod
    def from_csv(
        cls,
        name: str,
        path: str | Path,
        *,
        interpolation: Literal["linear", "previous"] = "linear",
        beyond: Literal["error", "hold"] = "error",
    ) -> SeriesPart:
        """Read a series from a CSV file with the headings ``time [s]`` and ``name [unit]``.

        Parameters
        ----------
        name : str
            Name within the system.
        path : path-like
            The CSV file.
        interpolation, beyond
            See `SeriesPart`.

        Returns
        -------
        SeriesPart
            The part.

        Raises
        ------
        SeriesError
            If the file is not such a table.
        """
        path = Path(path)
        times, columns, units = _read_csv(path)
        return cls(name, times, columns, units, interpolation=interpolation, beyond=beyond, path=path)

    def content(self) -> bytes:
        """Return names, times and values as bytes, which are the same for equal records."""
        names = "\n".join(port.name for port in self.outputs)
        return names.encode() + self._times.tobytes() + self._values.tobytes()

    def table(self) -> SeriesArrays:
        """Return the record as arrays."""
        slopes = np.zeros_like(self._values)
        if self.interpolation == "linear":
            slopes[:-1] = np.diff(self._values, axis=0) / np.diff(self._times)[:, None]
        end = self._grid[-1] + self._reach if self.beyond == "error" else math.inf
        return SeriesArrays(self._times, self._values, slopes, self._slack, end)

    def missed(self, start: float, step: float, ticks: int) -> tuple[str, float] | None:
        """Return a column and a time at which a held value beyond its neighbours begins and ends between two steps."""
        if self.interpolation == "linear":
            return None
        values, numbers = self._values, np.arange(len(self._times))
        seen = np.ceil((self._times - self._slack - start) / step)  # number of the first step with the sample
        before, after = np.searchsorted(seen, seen) - 1, np.searchsorted(seen, seen, "right") - 1
        ends = np.stack([values[before.clip(0)], values[after]])
        beyond = np.maximum(values - ends.max(axis=0), ends.min(axis=0) - values)
        within = (seen > 0.0) & (seen <= ticks) & (before >= 0) & (after > numbers)
        lost = np.argwhere((beyond > LOST * np.ptp(values, axis=0)) & within[:, None])
        return (self.outputs[lost[0, 1]].name, self._grid[lost[0, 0]]) if len(lost) else None

    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        """Go to the start time; raise an error for a run that the record does not cover."""
        first, last = self._grid[0], self._grid[-1]
        slack = self._reach
        if self.beyond == "error" and (start < first - slack or (math.isfinite(stop) and stop > last + slack)):
            raise SeriesError(
                f"the record '{self.name}' covers {first:.12g} to {last:.12g} s, but the run goes "
                f'from {start:.12g} to {stop:.12g} s: shorten the run or set beyond = "hold"'
            )
        self._now = start

    def bind(self, inputs: Sequence[str], outputs: Sequence[str], u: Values, y: Values) -> Calls:
        """Connect to the signal vector."""
        names = [port.name for port in self.outputs]
        table = self.table()
        places = [names.index(name) for name in outputs]
        rows, slopes = (np.ascontiguousarray(values[:, places]) for values in (table.values, table.slopes))
        grid = self._grid
        last = len(grid) - 1

        def get() -> None:
            index = bisect_right(grid, self._now + self._slack) - 1
            if index < 0 or index >= last:
                y[:] = rows[0 if index < 0 else last]
            else:
                y[:] = rows[index] + (self._now - grid[index]) * slopes[index]

        return Calls(lambda: None, self._step, get)  # there are no inputs to set

    def save(self, state: object | None = None) -> object:
        """Return the current time, which is the complete state."""
        return self._now

    def restore(self, state: object) -> None:
        """Return to a saved time."""
        assert isinstance(state, float)
        self._now = state

    def serialise(self) -> bytes:
        """Return the current time as bytes."""
        return struct.pack("<d", self._now)

    def deserialise(self, data: bytes) -> None:
        """Go to a time from `serialise`."""
        try:
            (now,) = struct.unpack("<d", data)
        except struct.error as error:
            raise PartError(
                self.name, "deserialise", f"the state has {len(data)} bytes and belongs to another part"
            ) from error
        if not math.isfinite(now):
            raise PartError(self.name, "deserialise", f"the state has the time {now} and belongs to another part")
        self._now = now

    def _step(self, t: float, h: float) -> None:
        self._now = t + h
        if self.beyond == "error" and self._now > self._grid[-1] + self._reach:
            raise PartError(self.name, "step", f"the record ends at {self._grid[-1]:.12g} s", t)

    def _check(self) -> None:
        if self.interpolation not in ("linear", "previous"):
            raise SeriesError(
                f"the record '{self.name}' has the interpolation '{self.interpolation}': use linear or previous"
            )
        if self.beyond not in ("error", "hold"):
            raise SeriesError(f"the record '{self.name}' has the setting beyond = '{self.beyond}': use error or hold")
        if self._times.size == 0 or self._values.size == 0:
            raise SeriesError(f"the record '{self.name}' is empty: give at least one time and one column")
        if self._values.shape[0] != self._times.size:
            raise SeriesError(
                f"the record '{self.name}' has {self._times.size} times but {self._values.shape[0]} values "
                "in a column: give columns of the same length"
            )
        if not (np.isfinite(self._times).all() and np.isfinite(self._values).all()):
            raise SeriesError(
                f"the record '{self.name}' contains values that are not finite: remove or repair those rows"
            )
        if (np.diff(self._times) <= 0).any():
            row = int(np.argmax(np.diff(self._times) <= 0)) + 1
            raise SeriesError(f"the times of the record '{self.name}' do not increase at row {row}: sort the record")


def _numbers(part: str, column: str, values: ArrayLike, remedy: str) -> Values:
    """Return numbers as an array, durations in seconds; numpy would turn them and dates into nanoseconds."""
    found = np.asarray(values)
    try:
        if found.dtype.kind == "m":
            found = found / np.timedelta64(1, "s")
        if found.dtype.kind == "M":
            raise TypeError("they are dates")
        return found.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise SeriesError(f"the {column} of the record '{part}' are no numbers ({reason(error)}): {remedy}") from error


def _read_csv(path: Path) -> tuple[Values, dict[str, Values], dict[str, str]]:
    """Return the times, columns and units of a CSV file."""
    from harness.results.formats import from_csv  # with xarray, which takes longer to import than the rest

    try:
        table = from_csv(path)
    except (OSError, ValueError) as error:
        raise SeriesError(f"cannot read the record {path}: {reason(error)}; give a CSV file with times") from error
    if (unit := table["time"].attrs["units"]) != "s":
        raise SeriesError(f"the times of the record {path} have the unit {unit}: give seconds")
    columns = {str(name): column.to_numpy() for name, column in table.data_vars.items()}
    units = {name: unit for name in columns if (unit := table[name].attrs.get("units"))}
    return table["time"].to_numpy(), columns, units
