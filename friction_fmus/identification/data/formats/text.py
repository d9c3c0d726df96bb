"""Text with any separator, decimal commas, text above the table, a line of units, dates; exports of TwinCAT Scope."""

from __future__ import annotations

import gzip
import lzma
import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_headings import meaning_of
from friction_fmus.identification.data.record import Array, RecordFinding, unit_of
from friction_fmus.identification.data.tables import ChannelGroup, DataTable, on_one_clock
from harness.storage.files import LARGEST_DATA

SUFFIXES: Final = tuple(f".{kind}{zip}" for kind in ("csv", "tsv", "txt", "dat", "asc") for zip in ("", ".gz", ".xz"))

MISSING: Final = ("", "nan", "NaN", "NAN", "NA", "null", "-nan", "#N/A")
"""Cells without a value."""

_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_WORDS = dict.fromkeys(MISSING, math.nan) | {"true": 1.0, "True": 1.0, "false": 0.0, "False": 0.0}


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line without spaces and quotes around them."""
    cells = line.split() if separator == " " else line.split(separator)
    return [cell.strip().strip('"').strip() for cell in cells]


def numeric(cell: str) -> bool:
    """Return whether a cell is a number, with a decimal point or a decimal comma."""
    return _NUMBER.fullmatch(cell) is not None


def numbers(cells: Sequence[str], comma: bool) -> Array | None:
    """Return cells as numbers, nan where one is missing; None if one of them is a text."""
    if any("_" in cell or (comma and "." in cell) for cell in cells):  # Python takes 1_000 for a number
        return None
    if comma:
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        return np.array([_WORDS[cell] if cell in _WORDS else float(cell) for cell in cells])
    except ValueError:
        return None


def decimal_comma(path: Path) -> RecordFinding:
    """Return the finding that commas are read as decimal points."""
    what = f"Commas in the numbers of {path.name} are read as decimal points."
    return RecordFinding("decimal-comma", what, "Check a value of each column, or use decimal points.")


KEY = "Name"  # first cell of the row with the names of the channels; it is repeated above each column of times

TICKS = 1e4  # ticks of a time stamp of Windows in a millisecond

LONGEST_HEAD = 200  # largest number of lines above the numbers; comments of symbols can have several lines

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


def read_scope_export(path: Path, lines: Sequence[tuple[int, str]], separator: str) -> DataTable:
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
        same = next((group for group in groups if np.array_equal(group.t, t)), None)
        if same is not None:
            groups[groups.index(same)] = ChannelGroup(t, {**same.signals, **signals})
        else:
            groups.append(ChannelGroup(t, signals))
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


_COMMENTS = ("#", "%", "//", "!", '"#')
_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(\([^()]*\))?[^\[\]()]*)[\])]\s*")
_SEPARATORS = (";", "\t", ",", "|")


def read(path: Path) -> DataTable:
    """Read a text table: columns separated by ; tab , | or spaces, after comments and a heading."""
    full = [(n, line) for n, line in enumerate(_decoded(path).splitlines(), start=1) if line.strip()]
    numbered = [(n, line) for n, line in full if not line.lstrip().startswith(_COMMENTS)]
    if len(numbered) < 4:
        raise RecordError(f"{path} has too few lines for a table ({len(numbered)}); use a heading and rows of numbers.")
    separator = _separator([line for _, line in numbered])
    if is_scope_export(numbered, separator):
        return read_scope_export(path, numbered, separator)
    cells = [split_cells(line, separator) for _, line in numbered]
    if len(cells[-1]) == 1 and len(cells[-2]) > 1 and not numeric(cells[-1][0]):
        del cells[-1], numbered[-1]  # EOF
    first = _first_row(cells)
    if first is None:
        raise RecordError(f"{path} has no line of numbers; use a table with a heading and rows of numbers.")
    rows = [(n, row) for (n, _), row in zip(numbered[first:], cells[first:], strict=True)]
    width = _width(path, rows)
    # the heading may be the last comment line, as written by numpy.savetxt
    remarks = [(n, line.lstrip(' #%/!"')) for n, line in full if n < numbered[0][0]] if first == 0 else []
    remarked = [row for row in remarks[-1:] if len(split_cells(row[1], separator)) == width]
    headings = _headings(path, numbered[:first] or remarked, separator, width, not rows[0][1][-1])
    comma = separator != "," and any("," in cell and numeric(cell) for _, row in rows for cell in row)
    units = {}
    names = []
    for heading in headings:
        name, unit = split_unit(heading)
        names.append(name)
        if unit:
            units[name] = unit
    if len(set(names)) < len(names):
        (double, _), *_ = Counter(names).most_common(1)
        raise RecordError(f"{path} has two columns with the heading {double!r}; rename one.")
    table = _parsed(path, names, rows, comma)
    return replace(table, units={**units, **table.units}, findings=(decimal_comma(path),) if comma else ())


def split_unit(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading such as ``x [mm]`` or ``x (mm)``; the unit may be empty."""
    heading = heading.strip().strip('"').strip()
    match = _HEADING.fullmatch(heading)
    if not match or not match["name"]:
        return heading, ""
    return match["name"].removesuffix("/").rstrip(), match["unit"].strip(" -")


def _decoded(path: Path) -> str:
    opener: Callable[..., IO[bytes]] = {".gz": gzip.open, ".xz": lzma.open}.get(path.suffix.lower(), open)  # type: ignore[assignment]
    with opener(path, "rb") as file:
        content = file.read(LARGEST_DATA + 1)
    if len(content) > LARGEST_DATA:
        raise RecordError(f"{path} has more than {LARGEST_DATA} bytes of text; split the file.")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _separator(lines: list[str]) -> str:
    """Return the separator with the same count in most of the last lines; a space if there is none."""
    tail = lines[-50:]
    for separator in _SEPARATORS:
        counts = Counter(line.count(separator) for line in tail)
        count, often = counts.most_common(1)[0]
        if count and often > 0.5 * len(tail):
            return separator
    return " "


def _first_row(cells: list[list[str]]) -> int | None:
    """Return the index of the first row of data: as wide as the last rows, with numbers where they have numbers."""
    tail = cells[-50:]
    width = Counter(map(len, tail)).most_common(1)[0][0]
    tail = [row for row in tail if len(row) == width]
    columns = [i for i in range(width) if 2 * sum(numeric(row[i]) for row in tail) > len(tail)]
    if not columns:
        return None

    def is_row(row: list[str]) -> bool:
        return len(row) == width and 2 * sum(numeric(row[i]) for i in columns) >= len(columns)

    first = next((i for i, row in enumerate(cells) if is_row(row) and numeric(row[columns[0]])), None)
    while first and is_row(cells[first - 1]):
        first -= 1  # its first cell is a text, which is reported
    return first


def _width(path: Path, rows: list[tuple[int, list[str]]]) -> int:
    """Return the number of cells per line, which must be equal; the last cell may be empty."""
    widths = [len(row) for _, row in rows]
    width = Counter(widths).most_common(1)[0][0]
    other = next((i for i, found in enumerate(widths) if found != width), None)
    if other is not None:
        raise RecordError(
            f"Line {rows[other][0]} of {path} has {widths[other]} cells, but the others have {width}; correct or "
            "remove it."
        )
    return width


def _headings(path: Path, above: list[tuple[int, str]], separator: str, width: int, loose_end: bool) -> list[str]:
    """Return the headings of the columns, including units from a separate line of units."""
    if not above:
        return [f"column {index + 1}" for index in range(width)]
    rows = [split_cells(line, separator) for _, line in above]
    if separator == " " and len(rows[-1]) != width:
        rows = [re.split(r"\s{2,}|\t", line.strip()) for _, line in above]
    rows = [[*row, "unnamed"] if len(row) == width - 1 and loose_end else row for row in rows]
    fitting = [row for row in rows if len(row) == width]
    if not fitting:
        number, line = above[-1]
        cells = len(split_cells(line, separator))
        decimal = separator == "," and width == 2 * cells
        raise RecordError(
            f"The heading in line {number} of {path} has {cells} names, but the numbers below have {width} columns; "
            + (
                "if the commas are decimal points, use semicolons between the columns."
                if decimal
                else "add a name for each column."
            )
        )
    best = max(range(len(fitting)), key=lambda i: (sum(map(_is_signal, fitting[i])), not _is_units(fitting[i]), i))
    units = next((row for row in fitting[best + 1 :] if _is_units(row)), None)
    if units is None:
        return fitting[best]
    return [f"{name} [{unit.strip('[]() ')}]" for name, unit in zip(fitting[best], units, strict=True)]


def _is_signal(cell: str) -> bool:
    """Return whether a cell of the lines above the numbers names a signal."""
    return meaning_of(*split_unit(cell)) is not None


def _is_units(row: list[str]) -> bool:
    units = [cell.strip("[]() ") for cell in row]
    return any(units) and all(unit in ("", "-") or unit_of(unit) is not None for unit in units)


def _parsed(path: Path, names: list[str], rows: list[tuple[int, list[str]]], comma: bool) -> DataTable:
    columns, units, texts = {}, {}, {}
    for name, cells in zip(names, zip(*(row for _, row in rows), strict=True), strict=True):
        if (values := numbers(cells, comma)) is not None:
            columns[name] = values
        elif (moments := _moments(cells)) is not None:
            columns[name], units[name] = moments, "s"
        else:
            number, cell = next((rows[i][0], cell) for i, cell in enumerate(cells) if numbers([cell], comma) is None)
            texts[name] = f"{cell!r} in line {number}"
    return DataTable(path, columns, units, texts, np.array([number for number, _ in rows]))


def _moments(cells: Sequence[str]) -> Array | None:
    """Return the seconds since the first of some dates with times; None if a cell is no such date."""
    import pandas as pd

    if not all(cell in MISSING or ":" in cell for cell in cells):
        return None
    try:
        found = pd.to_datetime(["NaT" if cell in MISSING else cell for cell in cells], format="ISO8601", utc=True)
    except ValueError:
        return None
    counts = found.as_unit("ns")
    return np.asarray((counts - counts[0]) / pd.Timedelta(1, "ns"), dtype=np.float64) * 1e-9
