"""Exports of TwinCAT Scope as text: a column of times for each channel, with its name above."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.cells import decimal_comma, numbers, numeric, split_cells
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import ChannelGroup, DataTable, on_one_clock
from friction_fmus.identification.data.text_file import LARGEST_TRACE, whole_text

SUFFIXES: Final = ()

SEPARATORS: Final = ";\t,|"

KEY = "Name"  # first cell of the row with the names of the channels; it is repeated above each column of times

TICKS = 1e4  # ticks of a time stamp of Windows in a millisecond

LONGEST_HEAD = 200  # largest number of lines above the numbers; comments of symbols can have several lines

_NO_UNIT = ("", "(None)", "None")


def recognises(head: str) -> bool:
    """Return whether a text is an export of TwinCAT Scope."""
    lines = _lines(head)
    if not head.startswith(KEY) or len(lines) < 4 or head[len(KEY)] not in SEPARATORS:
        return False
    separator = head[len(KEY)]
    names = _names_row(lines, separator)
    first = _first_number(lines, separator, names + 1)
    if names == 0 or first is None:
        return False
    width, wanted = (len(split_cells(lines[row][1], separator)) for row in (first, names))
    return abs(width - wanted) <= 1  # older versions end lines with a separator


def _lines(text: str) -> list[tuple[int, str]]:
    return [(n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]


def read(path: Path) -> DataTable:
    """Read a text export of TwinCAT Scope."""
    text = whole_text(path, LARGEST_TRACE)
    lines, separator = _lines(text), text[len(KEY)]
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
    groups: list[ChannelGroup] = []
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
        groups.append(ChannelGroup(t, signals))
    if not any(group.signals for group in groups):
        raise RecordError(f"{path} is an export of TwinCAT Scope without channels; export the chart again.")
    table = on_one_clock(path, groups, "time", "ms")
    findings = (decimal_comma(path.name),) if comma else ()
    what = f"{len(rows)} rows, {len(starts)} channels of TwinCAT Scope"
    return replace(table, units={**table.units, **known}, findings=findings, format=what)


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
