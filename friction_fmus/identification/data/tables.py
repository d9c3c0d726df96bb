"""Numeric columns of a data file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Array, RecordFinding

EXACT = 2**53  # largest integer below which all integers are exact as floating-point numbers
UNPACKED: Final = 2**30  # largest size of the numbers in a file [bytes]


def limit_size(path: Path, size: int) -> None:
    """Raise RecordError for contents that would fill the memory."""
    if size > UNPACKED:
        raise RecordError(
            f"{path} unpacks to more than {UNPACKED // 2**20} MiB (at least {size / 2**20:.0f} MiB); save only the "
            "columns that are needed, or fewer samples."
        )


@dataclass(frozen=True, eq=False)
class DataTable:
    """Columns of a data file."""

    file: Path  # path of the file
    columns: Mapping[str, Array]  # numeric columns by heading, with NaN for empty cells
    units: Mapping[str, str] = field(default_factory=dict)  # units by heading, if the file states them
    texts: Mapping[str, str] = field(default_factory=dict)
    """First non-numeric cell of each other column and its location, by heading."""
    lines: NDArray[np.int64] | None = None  # line number of each row in the file
    findings: tuple[RecordFinding, ...] = ()  # problems found in the file
    notes: Mapping[str, RecordFinding] = field(default_factory=dict)  # problems of one column only, by heading
    format: str = ""  # what was read, in one line, such as ``12000 rows, UTF-16, semicolons, preamble of 11 lines``
    preamble: Mapping[str, str] = field(default_factory=dict)  # keys and values above the table, such as scale factors
    period: float = 0.0  # sample time that the file states beside its columns [s]; 0 if there is none
    start: str = ""  # date and time of the first row (ISO 8601); empty if unknown
    clocks: tuple[str, ...] = ()  # headings of columns that are times for certain, such as dates, in s from the first

    order: tuple[str, ...] = ()  # headings of all columns in the order of the file; empty if it is that of `columns`

    def place(self, row: int) -> str:
        """Return the location of a row in the file, for messages."""
        return f"line {self.lines[row]}" if self.lines is not None else f"row {row + 1}"


@dataclass(frozen=True, eq=False)
class ChannelGroup:
    """Signals sampled at the same times."""

    t: Array  # times; they increase
    signals: Mapping[str, Array]  # values by heading


def on_one_clock(path: Path, groups: Sequence[ChannelGroup], time: str, unit: str) -> DataTable:
    """Return the signals of all groups at the times of the group with the most signals."""
    # The signals of other groups are interpolated linearly, and missing outside of their times. Each of them has a
    # note, because interpolation smooths a force and distorts the derivatives of a position.
    merged: list[ChannelGroup] = []
    for group in groups:
        at = next((i for i, each in enumerate(merged) if np.array_equal(each.t, group.t)), len(merged))
        signals = merged[at].signals if at < len(merged) else {}
        merged[at : at + 1] = [ChannelGroup(group.t, {**signals, **group.signals})]
    base = max(merged, key=lambda group: len(group.signals))
    columns: dict[str, Array] = {time: base.t}
    notes = {}
    for group in groups:
        for name, values in group.signals.items():
            columns[name] = values
            if name not in base.signals:
                columns[name] = np.interp(base.t, group.t, values, left=np.nan, right=np.nan)
                what = f"{name!r} was sampled at other times than most signals of {path.name}, and is interpolated."
                notes[name] = RecordFinding("other-clock", what, "Log all signals of the axis with one sample time.")
    return DataTable(path, columns, {time: unit}, notes=notes)


def one_clock(table: DataTable) -> DataTable:
    """Return a table with one clock, instead of one before the signals of each channel under the same heading."""
    names = list(table.columns)
    base = names[0] if names else ""
    starts = [i for i, name in enumerate(names) if re.fullmatch(rf"{re.escape(base)}( \(\d+\))?", name)]
    if len(starts) < 2 or any(b - a < 2 for a, b in pairwise([*starts, len(names)])):
        return table
    groups = []
    for start, end in pairwise([*starts, len(names)]):
        t = table.columns[names[start]]
        there = np.isfinite(t)
        if np.count_nonzero(there) < 3 or np.any(np.diff(t[there]) <= 0.0):
            return table
        groups.append(ChannelGroup(t[there], {name: table.columns[name][there] for name in names[start + 1 : end]}))
    merged = on_one_clock(table.file, groups, base, table.units.get(base, ""))
    units = {name: unit for name, unit in table.units.items() if name in merged.columns}
    lines = table.lines if len(merged.columns[base]) == len(table.columns[base]) else None
    clocks = tuple(name for name in table.clocks if name in merged.columns)
    return replace(table, columns=merged.columns, notes=merged.notes, units=units, lines=lines, clocks=clocks)
