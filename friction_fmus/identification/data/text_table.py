"""Reading CSV and similar text files."""

from __future__ import annotations

import gzip
import lzma
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from friction_fmus.identification.data.cells import MISSING, decimal_comma, numbers, numeric, split_cells
from friction_fmus.identification.data.headings import meaning_of
from friction_fmus.identification.data.quantities import unit_of
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.scope_export import is_scope_export, read_scope_export
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError
from harness.storage.files import LARGEST_DATA

_COMMENTS = ("#", "%", "//", "!", '"#')
_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(\([^()]*\))?[^\[\]()]*)[\])]\s*")
_SEPARATORS = (";", "\t", ",", "|")


def read_text(path: Path) -> Table:
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


def _parsed(path: Path, names: list[str], rows: list[tuple[int, list[str]]], comma: bool) -> Table:
    columns, units, texts = {}, {}, {}
    for name, cells in zip(names, zip(*(row for _, row in rows), strict=True), strict=True):
        if (values := numbers(cells, comma)) is not None:
            columns[name] = values
        elif (moments := _moments(cells)) is not None:
            columns[name], units[name] = moments, "s"
        else:
            number, cell = next((rows[i][0], cell) for i, cell in enumerate(cells) if numbers([cell], comma) is None)
            texts[name] = f"{cell!r} in line {number}"
    return Table(path, columns, units, texts, np.array([number for number, _ in rows]))


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
