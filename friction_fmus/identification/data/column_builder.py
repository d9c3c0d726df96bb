"""Columns of a table from cells added in parts or from arrays, with clocks, and counters and angles that wrap."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.errors import RecordError
from friction_fmus.identification.data import text_file
from friction_fmus.identification.data.heading_rows import Headings, unique_names
from friction_fmus.identification.data.record import Array, RecordFinding
from friction_fmus.identification.data.tables import EXACT, DataTable, limit_size

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

TICKS: Final = {"ns": (0, 10**9), "Windows": (-11_644_473_600, 10**7), ".NET": (-62_135_596_800, 10**7)}
"""Clocks of computers whose counts between 2001 and 2096 exclude each other: their start [s since 1970], and ticks per
second."""


def absolute(counts: NDArray[np.int64]) -> tuple[Array, str] | None:
    """Return 64-bit time stamps in seconds since 1970, and the date of the first; None if they are no such stamps."""
    first = int(counts[0]) if counts.size else 0
    for start, rate in TICKS.values():
        begin = start + first / rate
        if 1e9 < begin < 4e9 and int(np.abs(counts - first).max()) < 1e7 * rate:
            return begin + (counts - first) / rate, iso(first * 10**9 // rate + start * 10**9)
    return None


def iso(nanoseconds: int) -> str:
    """Return date and time in ISO 8601 of a time since 1970."""
    return (_EPOCH + timedelta(microseconds=nanoseconds // 1000)).isoformat()


def serial_days(values: Array) -> tuple[Array, str] | None:
    """Return the seconds since the first of some serial dates of a spreadsheet or of MATLAB; None for others."""
    # Seconds of the same size would have been sampled faster than at 500 kHz.
    steps = np.diff(values[:100_000])
    if len(values) < 3 or not np.all(np.isfinite(steps)) or not np.all(steps >= 0.0):
        return None
    for begin, end, offset in ((36526.0, 73051.0, 25569.0), (730486.0, 767011.0, 719529.0)):
        if begin < values[0] < end and 0.0 < float(np.mean(steps)) < 2e-6:
            return 86400.0 * (values - values[0]), iso(round((float(values[0]) - offset) * 86400e9))
    return None


DAY: Final = 86_400_000_000_000  # [ns]


def from_midnight(moments: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return times of the day that continue after midnight."""
    passed = np.concatenate([[0], np.cumsum(np.diff(moments) < -DAY // 2)])
    return np.asarray(moments + DAY * passed, dtype=np.int64)


_ANGLES: Final = (*(360.0 * 10.0**k for k in range(5)), 2.0 * np.pi, 400.0, 1.0, 6400.0)
_COUNTS: Final = tuple(float(2**bits) for bits in (*range(8, 25), 32))

NEAR: Final = 3.0  # largest ratio of the step at a wrap to the steps beside it
BESIDE: Final = 3  # number of steps on either side that are compared


def unwrapped(values: Array) -> tuple[Array, float, int] | None:
    """Return values without the jumps of a counter or an angle that wraps, its range, and the number of wraps."""
    # None if there are no jumps, or if one of them cannot be a wrap for certain: at each, the motion must go on as
    # before once the range is added, from one end of it to the other.
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size < 10:
        return None
    known = values[finite]
    low, high = float(known.min()), float(known.max())
    steps = np.diff(known)
    jumps = np.flatnonzero(np.abs(steps) > 0.5 * (high - low))
    if not jumps.size or jumps.size > 0.1 * steps.size:
        return None
    for period in [*_periods(known, (low, high), steps[jumps]), *_own_period(known, steps, jumps)]:
        turns = -np.round(steps[jumps] / period)
        rest = steps[jumps] + period * turns
        if not np.all(np.abs(turns) == 1.0):
            continue
        others = np.abs(steps)
        others[jumps] = 0.0
        padded = np.pad(others, BESIDE)
        around = np.max([padded[jumps + k] for k in range(2 * BESIDE + 1)], axis=0)
        inner = float(np.median(others[others > 0.0])) if np.any(others > 0.0) else 0.0
        if inner and np.all(np.abs(rest) <= NEAR * np.maximum(around, inner)) and np.max(np.abs(rest)) < 0.25 * period:
            moved = np.zeros(len(known))
            moved[jumps + 1] = period * turns
            if np.any(around > 0.0):
                result = values.copy()
                result[finite] = known + np.cumsum(moved)
                return result, period, int(jumps.size)
    return None


def _periods(values: Array, ends: tuple[float, float], jumps: Array) -> list[float]:
    """Return the ranges that values between these ends may have, unsigned or symmetrical."""
    # A range that is neither of a register nor of an angle counts only if the values jump both up and down, unlike
    # those of a counter that starts again.
    (low, high), jump = ends, float(np.abs(jumps).max())
    both_ways = bool(np.any(jumps > 0.0) and np.any(jumps < 0.0))
    whole = bool(np.all(values == np.round(values)))
    known = [*(_COUNTS if whole else ()), *_ANGLES]
    if whole and low >= 0.0 and both_ways:
        known += [size for unit in (1000.0, 100.0) if (size := unit * np.ceil((high + 1.0) / unit)) < 1.01 * high]
    return [
        period
        for period in known
        if period / 1.5 < jump <= period * (1.0 + 1e-9)
        and ((low >= 0.0 and high <= period) or (low >= -0.5 * period - 1e-9 and high <= 0.5 * period * (1.0 + 1e-9)))
    ]


def _own_period(values: Array, steps: Array, jumps: NDArray[np.intp]) -> list[float]:
    """Return the range of a symmetrical angle, such as -12.5 to 12.5, if the motion goes on through both ends."""
    beside = jumps[:, None] + np.array([*range(-BESIDE, 0), *range(1, BESIDE + 1)])
    if beside.min() < 0 or beside.max() >= len(steps) or np.all(steps[jumps] > 0.0) or np.all(steps[jumps] < 0.0):
        return []
    ahead = 0.5 * (steps[jumps - 1] + steps[jumps + 1])
    sizes = np.abs(steps[jumps] - ahead)
    period = float(f"{np.median(sizes):.3g}")
    onward = bool(np.all(steps[beside] * steps[jumps, None] < 0.0))  # otherwise it may be a signal that is switched
    exact = abs(float(np.median(sizes)) - period) < 0.1 * float(np.median(np.abs(ahead)))
    return [period] if onward and exact and np.abs(values).max() <= 0.5 * period * (1.0 + 1e-9) else []


def wrap_finding(name: str, period: float, count: int, file: Any) -> RecordFinding:
    """Return the finding about a column that was made continuous."""
    times = "once" if count == 1 else f"{count} times"
    what = f"Column {name!r} of {file} wraps around after {period:.6g}, {times}; it is made continuous."
    return RecordFinding("wrapped", what, "Nothing has to be done if the range is right.")


class ColumnBuilder:
    """Column of a table whose cells are added in parts: numbers, dates with times, or texts."""

    def __init__(self, name: str) -> None:
        self.name, self.unit, self.text = name, "", ""
        self._kind = ""  # number, moment or text; empty as long as all cells are
        self._parts: list[NDArray[Any]] = []

    @property
    def is_number(self) -> bool:
        """Whether the column has numbers."""
        return self._kind == "number"

    @property
    def empty(self) -> bool:
        """Whether all cells are empty."""
        return not self._kind

    def add(self, values: Any, lines: NDArray[np.int64], comma: bool) -> bool:
        """Add a pandas series or the texts of some cells; return whether they have decimal commas by exception."""
        if self._kind == "text":
            return False
        kind = getattr(getattr(values, "dtype", None), "kind", "O")
        if kind in "biuf":
            array = values.to_numpy(dtype=np.float64 if kind == "b" or values.dtype == np.uint64 else None)
            if kind == "f" and self._kind != "number" and np.all(np.isnan(array)):
                self._empty(len(array))
            else:
                self._append("number", array, lines, str(array[0]))
            return False
        if not isinstance(values, tuple):
            values = ["" if value != value else str(value).strip() for value in values.tolist()]
        if all(cell in text_file.MISSING for cell in values):
            self._empty(len(values))
            return False
        for decimal in (comma, not comma):
            if (found := text_file.any_numbers(values, decimal)) is not None:
                self.unit = found[1] or self.unit
                self._append("number", found[0], lines, values[0])
                return decimal and not comma and any("," in cell for cell in values)
        if (stamps := text_file.moments(values)) is not None:
            self._append("moment", stamps, lines, values[0])
        else:
            bad = next((i for i, cell in enumerate(values) if text_file.any_numbers([cell], comma) is None), 0)
            self._as_text(values[bad], int(lines[bad]))
        return False

    def add_array(self, values: NDArray[Any]) -> None:
        """Add an array of numbers, dates or durations, which become seconds."""
        if values.dtype.kind == "M":
            self._append("moment", values.astype("datetime64[ns]").astype(np.int64), _FIRST, "")
        elif values.dtype.kind == "m":
            self._append("number", values.astype("timedelta64[ns]").astype(np.int64) * 1e-9, _FIRST, "")
        else:
            kept = values.dtype.kind in "iu" and values.dtype != np.uint64
            self._append("number", values.astype(np.int64 if kept else np.float64), _FIRST, "")

    def add_objects(self, values: Sequence[Any]) -> None:
        """Add numbers, truth values, dates and texts of Python; None is a missing one."""
        if all(value is None or (isinstance(value, (bool, int, float))) for value in values):
            if all(isinstance(value, int) and abs(value) < 2**63 for value in values):
                self.add_array(np.array(values, dtype=np.int64))
            elif any(value is not None for value in values):
                self.add_array(np.array([math.nan if value is None else _float(value) for value in values]))
            else:
                self._empty(len(values))
        else:
            texts = tuple("" if value is None else str(value).strip() for value in values)
            self.add(texts, np.arange(1, len(texts) + 1), False)

    def finished(self) -> tuple[Array | None, str, str]:
        """Return the values, and date of the first one and ``"s"`` of a clock; None for texts. Release the parts."""
        parts, self._parts = self._parts, []
        if self._kind == "text":
            return None, "", ""
        joined: NDArray[Any] = np.concatenate(parts) if parts else np.zeros(0)
        del parts
        if self._kind == "moment":
            if text_file.is_time_of_day(joined):
                joined = from_midnight(joined)
                return (joined - joined[0]) * 1e-9, "", "s"
            seconds = (joined - joined[0]) * 1e-9
            seconds[joined == _MISSING] = np.nan
            return seconds, iso(int(joined[0])), "s"
        if joined.dtype.kind == "i":
            if joined.size and max(abs(int(joined.min())), abs(int(joined.max()))) > EXACT:
                if (stamps := absolute(joined)) is not None:
                    return *stamps, "s"
                self.text = "integers above 2^53, which are not exact as floating-point numbers"
                return None, "", ""
            return joined.astype(np.float64), "", ""
        if (days := serial_days(joined)) is not None:
            return *days, "s"
        return joined, "", ""

    def _append(self, kind: str, values: NDArray[Any], lines: NDArray[np.int64], first: str) -> None:
        if self._kind not in ("", kind):
            self._as_text(first, int(lines[0]))
            return
        if not self._kind and kind == "moment":
            self._parts = [np.full(len(part), _MISSING) for part in self._parts]
        self._kind = kind
        self._parts.append(values)

    def _empty(self, count: int) -> None:
        self._parts.append(np.full(count, _MISSING if self._kind == "moment" else np.nan))

    def _as_text(self, cell: str, line: int) -> None:
        self._kind, self._parts = "text", []
        self.text = f"{cell!r} in line {line}"


def object_columns(names: Sequence[str], cells: Iterable[Sequence[Any]]) -> list[ColumnBuilder]:
    """Return columns of numbers, truth values, dates and texts of Python."""
    columns = [ColumnBuilder(name) for name in names]
    for column, values in zip(columns, cells, strict=True):
        column.add_objects(values)
    return columns


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


_FIRST: Final = np.array([1])

_MISSING: Final = np.iinfo(np.int64).min  # of pandas, for a date


def made_table(
    path: Path,
    columns: Sequence[ColumnBuilder],
    heading: Headings,
    lines: NDArray[np.int64] | None,
    findings: Sequence[RecordFinding],
    what: str,
) -> DataTable:
    """Return the table of columns that were added in parts."""
    values: dict[str, Array] = {}
    units, texts, start, known = dict(heading.units), {}, "", []
    for column in columns:
        if column.empty and column.name not in heading.given:
            texts[column.name] = "only empty cells"
            column.finished()
            continue
        found, date, unit = column.finished()
        if found is None:
            texts[column.name] = column.text
            continue
        values[column.name] = found
        if unit:
            known.append(column.name)
        if unit or (column.unit and column.name not in units):
            units[column.name] = unit or column.unit
        start = start or date
    return DataTable(
        path,
        values,
        units,
        texts,
        lines,
        findings=tuple(findings),
        format=what,
        preamble=heading.preamble,
        period=heading.period,
        start=start,
        clocks=tuple(known),
        order=tuple(column.name for column in columns),
    )


NUMBERS = "biuf"  # kinds of arrays that are numbers


def columns_of(name: str, array: Any, form: str = "{}[{}]", first: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield a vector, the columns of a matrix, or the fields of a structured array, with their names."""
    if array.dtype.names:
        for each in array.dtype.names:
            yield from columns_of(f"{name}.{each}" if name else each, array[each], form, first)
        return
    if array.dtype.kind not in NUMBERS + "mM":
        return
    array = np.squeeze(array)
    if array.ndim == 1:
        yield name, array
    elif array.ndim in (2, 3):
        if array.ndim == 2 and array.shape[0] < array.shape[1] and array.shape[0] <= 64:
            array = array.T  # a channel per row
        flat = array.reshape(len(array), -1)
        if flat.shape[1] <= 1000:
            for column in range(flat.shape[1]):
                yield (form.format(name, column + first) if name else f"column {column + 1}"), flat[:, column]


def vector_table(path: Path, vectors: Iterable[tuple[str, Any]], units: Mapping[str, str], what: str) -> DataTable:
    """Return the vectors with the most frequent length; others, such as scalars and settings, are ignored."""
    found = [(name, values) for name, values in vectors if values.size >= 3]
    if not found:
        raise RecordError(f"{path} has no numeric vectors; save time, position and force as vectors or matrices.")
    sizes = [values.size for _, values in found]
    length = max(set(sizes), key=lambda size: (sizes.count(size), size))
    kept = [(name, values) for name, values in found if values.size == length]
    limit_size(path, 8 * length * len(kept))
    columns = []
    for name, (_, values) in zip(unique_names([name for name, _ in kept]), kept, strict=True):
        column = ColumnBuilder(name)
        column.add_array(values)
        columns.append(column)
    names = [column.name for column in columns]
    heading = Headings(names, {name: units[name] for name in names if units.get(name)}, given=frozenset(names))
    return made_table(path, columns, heading, None, (), f"{length} rows, {what}")
