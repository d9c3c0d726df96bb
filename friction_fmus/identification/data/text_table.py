"""Reading CSV and similar text files."""

from __future__ import annotations

import gzip
import lzma
import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError
from harness.storage.files import LARGEST_DATA

_COMMENTS = ("#", "%", "//", "!", '"#')
_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf(inity)?)|", re.IGNORECASE)
_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(\([^()]*\))?[^\[\]()]*)[\])]\s*")
_SEPARATORS = (";", "\t", ",", "|")
_MISSING = ("", "nan", "NaN", "NAN", "NA", "null", "-nan", "#N/A")
_WORDS = dict.fromkeys(_MISSING, math.nan) | {"true": 1.0, "True": 1.0, "false": 0.0, "False": 0.0}


def read_text(path: Path) -> Table:
    """Read a text table: columns separated by ; tab , | or spaces, after comments and a heading.

    Raises
    ------
    RecordError
        If there is no table, rows have different numbers of cells, or commas are both decimal points and separators.
    """
    full = [(n, line) for n, line in enumerate(_decoded(path).splitlines(), start=1) if line.strip()]
    numbered = [(n, line) for n, line in full if not line.lstrip().startswith(_COMMENTS)]
    if len(numbered) < 4:
        raise RecordError(f"{path} has too few lines for a table ({len(numbered)}); use a heading and rows of numbers.")
    separator = _separator([line for _, line in numbered])
    first = next((i for i, (_, line) in enumerate(numbered) if _is_data(_cells(line, separator))), None)
    if first is None:
        raise RecordError(f"{path} has no line of numbers; use a table with a heading and rows of numbers.")
    rows = [(n, _cells(line, separator)) for n, line in numbered[first:]]
    width = _width(path, rows)
    # the heading may be the last comment line, as written by numpy.savetxt
    remarks = [(n, line.lstrip(' #%/!"')) for n, line in full if n < numbered[0][0]] if first == 0 else []
    remarked = [row for row in remarks[-1:] if len(_cells(row[1], separator)) == width]
    headings = _headings(path, numbered[:first] or remarked, separator, width, not rows[0][1][-1])
    comma = separator != "," and any("," in line for _, line in numbered[first:])
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
    found: tuple[Finding, ...] = ()
    if comma:
        what = f"Commas in the numbers of {path.name} are read as decimal points."
        found = (Finding("decimal-comma", what, "Check a value of each column, or use decimal points."),)
    return replace(table, units={**units, **table.units}, findings=found)


def split_unit(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading such as ``x [mm]`` or ``x (mm)``; the unit may be empty."""
    heading = heading.strip().strip('"').strip()
    match = _HEADING.fullmatch(heading)
    return (match["name"], match["unit"].strip()) if match and match["name"] else (heading, "")


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


def _cells(line: str, separator: str) -> list[str]:
    cells = line.split() if separator == " " else line.split(separator)
    return [cell.strip().strip('"').strip() for cell in cells]


def _is_data(cells: list[str]) -> bool:
    """Return whether a line is a row of data: at least half of its cells are numbers."""
    numbers = [cell for cell in cells if cell and _NUMBER.fullmatch(cell)]
    return len(numbers) >= max(1, (len(cells) + 1) // 2)


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
    rows = [_cells(line, separator) for _, line in above]
    if separator == " " and len(rows[-1]) != width:
        rows = [re.split(r"\s{2,}|\t", line.strip()) for _, line in above]
    rows = [[*row, "unnamed"] if len(row) == width - 1 and loose_end else row for row in rows]
    fitting = [row for row in rows if len(row) == width]
    if not fitting:
        number, line = above[-1]
        cells = len(_cells(line, separator))
        decimal = separator == "," and width == 2 * cells
        raise RecordError(
            f"The heading in line {number} of {path} has {cells} names, but the numbers below have {width} columns; "
            + (
                "if the commas are decimal points, use semicolons between the columns."
                if decimal
                else "add a name for each column."
            )
        )
    *earlier, last = fitting
    unit_row = [cell.strip("[]() ") for cell in last]
    if earlier and len(earlier[-1]) == width and all(_looks_like_unit(unit) for unit in unit_row):
        return [f"{name} [{unit}]" for name, unit in zip(earlier[-1], unit_row, strict=True)]
    return last


def _looks_like_unit(text: str) -> bool:
    from friction_fmus.identification.data.quantities import unit_of

    return text in ("", "-") or unit_of(text) is not None


def _parsed(path: Path, names: list[str], rows: list[tuple[int, list[str]]], comma: bool) -> Table:
    columns, units, texts = {}, {}, {}
    for name, cells in zip(names, zip(*(row for _, row in rows), strict=True), strict=True):
        if (numbers := _numbers(cells, comma)) is not None:
            columns[name] = numbers
        elif (moments := _moments(cells)) is not None:
            columns[name], units[name] = moments, "s"
        else:
            number, cell = next((rows[i][0], cell) for i, cell in enumerate(cells) if _numbers([cell], comma) is None)
            texts[name] = f"{cell!r} in line {number}"
    return Table(path, columns, units, texts, np.array([number for number, _ in rows]))


def _numbers(cells: Sequence[str], comma: bool) -> Array | None:
    """Cells as numbers, nan where one is missing; None if one of them is a text."""
    if any("_" in cell or (comma and "." in cell) for cell in cells):  # Python takes 1_000 for a number
        return None
    if comma:
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        return np.array([_WORDS[cell] if cell in _WORDS else float(cell) for cell in cells])
    except ValueError:
        return None


def _moments(cells: Sequence[str]) -> Array | None:
    """Return the seconds since the first of some dates with times; None if a cell is no such date."""
    import pandas as pd

    if not all(cell in _MISSING or ":" in cell for cell in cells):
        return None
    try:
        found = pd.to_datetime(["NaT" if cell in _MISSING else cell for cell in cells], format="ISO8601", utc=True)
    except ValueError:
        return None
    counts = found.as_unit("ns")
    return np.asarray((counts - counts[0]) / pd.Timedelta(1, "ns"), dtype=np.float64) * 1e-9
