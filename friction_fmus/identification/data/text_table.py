"""Reading CSV and similar text files."""

from __future__ import annotations

import gzip
import io
import lzma
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.tables import Table, from_arrow
from friction_fmus.identification.errors import RecordError
from harness.storage.files import LARGEST_DATA

_COMMENTS = ("#", "%", "//", "!", '"#')
_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf(inity)?)|", re.IGNORECASE)
_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(\([^()]*\))?[^\[\]()]*)[\])]\s*")
_SEPARATORS = (";", "\t", ",", "|")


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
    width = _width(path, numbered[first:], separator)
    # the heading may be the last comment line, as written by numpy.savetxt
    remarks = [(n, line.lstrip(' #%/!"')) for n, line in full if n < numbered[0][0]] if first == 0 else []
    remarked = [row for row in remarks[-1:] if len(_cells(row[1], separator)) == width]
    headings = _headings(
        path, numbered[:first] or remarked, separator, width, not _cells(numbered[first][1], separator)[-1]
    )
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
    table = _parsed(path, names, numbered[first:], separator, comma)
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


def _width(path: Path, numbered: list[tuple[int, str]], separator: str) -> int:
    """Return the number of cells per line, which must be equal; the last cell may be empty."""
    widths = [len(_cells(line, separator)) for _, line in numbered]
    width = Counter(widths).most_common(1)[0][0]
    other = next((i for i, found in enumerate(widths) if found != width), None)
    if other is not None:
        raise RecordError(
            f"Line {numbered[other][0]} of {path} has {widths[other]} cells, but the others have {width}; correct or "
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


def _parsed(path: Path, names: list[str], numbered: list[tuple[int, str]], separator: str, comma: bool) -> Table:
    import pyarrow as pa
    from pyarrow import csv

    lines = np.array([number for number, _ in numbered])
    joined = "\n".join("\t".join(line.split()) if separator == " " else line for _, line in numbered)
    if separator in ",;|":
        joined = re.sub(rf"[ \t]*{re.escape(separator)}[ \t]*", separator, joined)
    try:
        table = csv.read_csv(
            io.BytesIO(joined.encode()),
            read_options=csv.ReadOptions(column_names=names, use_threads=False),
            parse_options=csv.ParseOptions(delimiter="\t" if separator == " " else separator, quote_char='"'),
            convert_options=csv.ConvertOptions(
                null_values=["", "nan", "NaN", "NAN", "NA", "null", "-nan", "#N/A"],
                decimal_point="," if comma else ".",
            ),
        )
    except pa.ArrowInvalid as error:
        raise RecordError(f"{path} cannot be read as a table ({error}); export it again.") from error
    return from_arrow(path, table, lines)
