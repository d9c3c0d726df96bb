"""Columns of a table whose cells are added in parts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.identification.data import cells, clocks
from friction_fmus.identification.data.heading_rows import Headings
from friction_fmus.identification.data.record import Array, RecordFinding
from friction_fmus.identification.data.tables import EXACT, DataTable


class ColumnBuilder:
    """Column of a table whose cells are added in parts: numbers, dates with times, or texts."""

    def __init__(self, name: str) -> None:
        """Start a column with this name."""
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
        if all(cell in cells.MISSING for cell in values):
            self._empty(len(values))
            return False
        for decimal in (comma, not comma):
            if (found := cells.any_numbers(values, decimal)) is not None:
                self.unit = found[1] or self.unit
                self._append("number", found[0], lines, values[0])
                return decimal and not comma and any("," in cell for cell in values)
        if (stamps := cells.moments(values)) is not None:
            self._append("moment", stamps, lines, values[0])
        else:
            bad = next((i for i, cell in enumerate(values) if cells.any_numbers([cell], comma) is None), 0)
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
        """Return the values, the date of the first one of a clock, and ``"s"`` for a clock; None for a column of texts.

        Memory for the parts is released.
        """
        parts, self._parts = self._parts, []
        if self._kind == "text":
            return None, "", ""
        joined: NDArray[Any] = np.concatenate(parts) if parts else np.zeros(0)
        del parts
        if self._kind == "moment":
            if cells.is_time_of_day(joined):
                joined = clocks.from_midnight(joined)
                return (joined - joined[0]) * 1e-9, "", "s"
            seconds = (joined - joined[0]) * 1e-9
            seconds[joined == _MISSING] = np.nan
            return seconds, clocks.iso(int(joined[0])), "s"
        if joined.dtype.kind == "i":
            if joined.size and max(abs(int(joined.min())), abs(int(joined.max()))) > EXACT:
                if (stamps := clocks.absolute(joined)) is not None:
                    return *stamps, "s"
                self.text = "integers above 2^53, which are not exact as floating-point numbers"
                return None, "", ""
            return joined.astype(np.float64), "", ""
        if (days := clocks.serial_days(joined)) is not None:
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
