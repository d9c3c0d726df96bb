"""Exports of TwinCAT Scope as text: a column of times for each channel, with its name above."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from friction_fmus.identification.data.formats import text
from friction_fmus.identification.data.heading_rows import Headings, named_columns
from friction_fmus.identification.data.tables import DataTable
from friction_fmus.identification.data.text_file import numeric, split_cells

SUFFIXES: Final = ()

SEPARATORS: Final = ";\t,|"

KEY: Final = "Name"  # first cell of the row with the names of the channels; it is repeated above each column of times

TICKS: Final = 1e4  # ticks of a time stamp of Windows in a millisecond
STAMP: Final = 1e16  # smallest time stamp of Windows

LONGEST_HEAD: Final = 200  # largest number of lines above the numbers; comments of symbols can have several lines


def recognises(head: str) -> bool:
    """Return whether two rows of names, that of the scope and those of its channels, precede the numbers."""
    if not head.startswith(tuple(KEY + separator for separator in SEPARATORS)):
        return False
    rows = [split_cells(line, head[len(KEY)]) for line in head.split("\n")[:LONGEST_HEAD]]
    first = next((i for i, row in enumerate(rows) if numeric(row[0])), 0)
    return sum(row[0] == KEY for row in rows[:first]) > 1


def read(path: Path) -> DataTable:
    """Read a text export; time stamps of Windows, in 100 ns since 1601, are counted from the first one."""
    table = text.read(path, named=_headings, ragged=True)
    columns = {
        name: (values - values[0]) / TICKS if name.startswith("time") and values[0] > STAMP else values
        for name, values in table.columns.items()
    }
    return replace(table, columns=columns, format=f"TwinCAT Scope, {table.format}")


def _headings(rows: Sequence[Sequence[str]], width: int, loose: bool) -> Headings:
    """Return the names of the channels, or of their symbols if channels have the same name, and their units."""
    at = max(i for i, row in enumerate(rows) if row[0] == KEY)
    head = {row[0]: [*row, *[""] * width][:width] for row in rows[at:]}
    names, units = head[KEY], head.get("Unit", [""] * width)
    columns = [
        ("time", "ms")
        if name == KEY
        else (name if names.count(name) == 1 else symbol, re.sub(r"\s*\([^()]*\)$|^None$", "", unit))  # mm (Length)
        for name, symbol, unit in zip(names, head.get("SymbolName", names), units, strict=True)
    ]
    return named_columns([name for name, _ in columns], [unit for _, unit in columns])
