"""Reading text exports of TwinCAT Scope: a time column for each channel, below rows that describe the channels."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from friction_fmus.identification.data.cells import decimal_comma, numbers, numeric, split_cells
from friction_fmus.identification.data.clocks import Group, on_one_clock
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError

KEY = "Name"
"""First cell of the row with the names of the channels; it is repeated above each column of times."""

TICKS = 1e4
"""Ticks of a time stamp of Windows in a millisecond."""

LONGEST_HEAD = 200
"""Largest number of lines above the numbers; comments of symbols can have several lines."""

_NO_UNIT = ("", "(None)", "None")


def is_scope_export(lines: Sequence[tuple[int, str]], separator: str) -> bool:
    """Return whether a text is an export of TwinCAT Scope."""
    if not lines[0][1].startswith(KEY + separator):
        return False
    names = _names_row(lines, separator)
    first = _first_number(lines, separator, names + 1)
    if names == 0 or first is None:
        return False
    width, wanted = (len(split_cells(lines[row][1], separator)) for row in (first, names))
    return abs(width - wanted) <= 1  # older versions end lines with a separator


def read_scope_export(path: Path, lines: Sequence[tuple[int, str]], separator: str) -> Table:
    """Read a text export of TwinCAT Scope (`is_scope_export`)."""
    names_row = _names_row(lines, separator)
    first = _first_number(lines, separator, names_row + 1)
    assert first is not None
    names = split_cells(lines[names_row][1], separator)
    head = {row[0]: row for row in (split_cells(line, separator) for _, line in lines[names_row + 1 : first])}
    symbols, units = head.get("SymbolName", names), head.get("Unit", [])
    rows = []
    for number, line in lines[first:]:
        cells = split_cells(line, separator)
        if cells[0] and not numeric(cells[0]):
            break  # the mark at the end, or a table of triggers
        rows.append((number, (cells + [""] * len(names))[: len(names)]))
    comma = separator != "," and any("," in cell and numeric(cell) for _, row in rows for cell in row)
    starts = [i for i, name in enumerate(names) if name == KEY]
    groups: list[Group] = []
    known: dict[str, str] = {}
    for start, end in zip(starts, [*starts[1:], len(names)], strict=True):
        there = [i for i, (_, row) in enumerate(rows) if row[start]]
        t = _times(path, [rows[i] for i in there], start, comma)
        signals = {}
        for column in range(start + 1, end):
            if not names[column]:
                continue  # older versions end each line with a separator
            name = names[column] if names.count(names[column]) == 1 else symbols[column]
            cells = [rows[i][1][column] for i in there]
            signals[name] = _column(path, name, [rows[i][0] for i in there], cells, comma)
            unit = re.sub(r"\s*\([^()]*\)$", "", units[column]) if column < len(units) else ""
            if unit not in _NO_UNIT:
                known[name] = unit
        same = next((group for group in groups if np.array_equal(group.t, t)), None)
        if same is not None:
            groups[groups.index(same)] = Group(t, {**same.signals, **signals})
        else:
            groups.append(Group(t, signals))
    if not any(group.signals for group in groups):
        raise RecordError(f"{path} is an export of TwinCAT Scope without channels; export the chart again.")
    table = on_one_clock(path, groups, "time", "ms")
    return replace(table, units={**table.units, **known}, findings=(decimal_comma(path),) if comma else ())


def _names_row(lines: Sequence[tuple[int, str]], separator: str) -> int:
    """Return the index of the last row of names in the head; the first row names the scope."""
    head = lines[: min(len(lines), LONGEST_HEAD)]
    return max(i for i, (_, line) in enumerate(head) if line.startswith(KEY + separator))


def _first_number(lines: Sequence[tuple[int, str]], separator: str, begin: int) -> int | None:
    rows = enumerate(lines[begin : begin + LONGEST_HEAD], start=begin)
    return next((i for i, (_, line) in rows if numeric(split_cells(line, separator)[0])), None)


def _times(path: Path, rows: Sequence[tuple[int, list[str]]], column: int, comma: bool) -> Array:
    """Return times in ms; time stamps of Windows, in 100 ns since 1601, are counted from the first one."""
    cells = [row[column] for _, row in rows]
    if cells and cells[0].isdigit() and len(cells[0]) >= 17:
        ticks = [int(cell) if cell.isdigit() else None for cell in cells]
        if None not in ticks:
            return np.array([(tick - int(cells[0])) / TICKS for tick in ticks if tick is not None])
    return _column(path, "time", [number for number, _ in rows], cells, comma)


def _column(path: Path, name: str, lines: Sequence[int], cells: Sequence[str], comma: bool) -> Array:
    values = numbers(cells, comma)
    if values is None:
        number, cell = next((n, c) for n, c in zip(lines, cells, strict=True) if numbers([c], comma) is None)
        raise RecordError(f"{path} has the text {cell!r} in line {number}, channel {name!r}; correct the file.")
    return values
