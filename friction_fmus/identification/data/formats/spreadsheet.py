"""Workbooks of spreadsheets: the sheet with the most numbers, with headings as in a text."""

import datetime
import re
import zipfile
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import made_table, object_columns
from friction_fmus.identification.data.heading_rows import headings
from friction_fmus.identification.data.tables import DataTable, limit_size

SUFFIXES: Final = (".xlsx", ".xlsm", ".xls")  # .xls for texts of this name only

CELL: Final = 40  # memory of a cell while a sheet is read, also of one that is empty [bytes]

_CELL = re.compile(rb"""\br\s*=\s*["']([A-Z]{1,3})(\d{1,7})["']""")


def read(path: Path) -> DataTable:
    """Read the table in a workbook."""
    if not zipfile.is_zipfile(path):
        raise RecordError(f"{path} is not a workbook of the format .xlsx; save it in this format, or as text.")
    from python_calamine import CalamineWorkbook

    with zipfile.ZipFile(path) as archive:
        limit_size(path, sum(info.file_size for info in archive.infolist()))
        for member in archive.namelist():
            if "sheet" in member.lower():
                with archive.open(member) as sheet:
                    limit_size(path, CELL * _area(sheet))
    best: list[list[Any]] = []
    name, count = "", 0
    try:
        with CalamineWorkbook.from_path(path) as book:
            for each in book.sheet_names:
                rows = book.get_sheet_by_name(each).to_python()
                numbers = sum(isinstance(cell, (float, int)) for row in rows for cell in row)
                if numbers > count:
                    best, name, count = rows, each, numbers
    except BaseException as error:  # the library raises its internal errors as exceptions of their own kind
        if isinstance(error, (Exception, KeyboardInterrupt)):
            raise
        raise ValueError(str(error)) from error
    if not count:
        raise RecordError(f"{path} has no sheet with numbers; save time, position and force in one.")
    return _table(path, best, name)


def _area(sheet: IO[bytes]) -> int:
    """Return the number of cells of the rectangle that a sheet fills, most of which may be empty."""
    rows, columns, rest = 1, 1, b""
    while piece := sheet.read(1 << 20):
        places = _CELL.findall(rest + piece)
        rows = max([rows, *(int(number) for _, number in places)])
        for letters in {letters for letters, _ in places}:
            columns = max(columns, reduce(lambda number, letter: 26 * number + letter - 64, letters, 0))
        rest = piece[-100:]
    return rows * columns


def _table(path: Path, rows: Sequence[Sequence[Any]], name: str) -> DataTable:
    width = max(map(len, rows))
    filled = [j for j in range(width) if any(row[j] != "" for row in rows if j < len(row))]
    rows = [[row[j] if j < len(row) else "" for j in filled] for row in rows]
    numbers = [sum(_is_value(cell) for cell in row) for row in rows]
    usual = float(np.median([count for count in numbers if count]))
    first = next(i for i, count in enumerate(numbers) if count and 2 * count > usual and _is_body(rows, numbers, i))
    body = [(i, row) for i, row in enumerate(rows[first:], start=first + 1) if any(cell != "" for cell in row)]
    last = max(k for k, (i, _) in enumerate(body) if numbers[i - 1])
    body = body[: last + 1]
    heading = headings([[str(cell).strip() for cell in row] for row in rows[:first] if any(row)], len(filled))
    columns = object_columns(heading.names, ([_cell(row[j]) for _, row in body] for j in range(len(filled))))
    lines = np.array([i for i, _ in body])
    return made_table(path, columns, heading, lines, (), f"{len(body)} rows, sheet {name!r}")


def _is_body(rows: Sequence[Sequence[Any]], numbers: Sequence[int], i: int) -> bool:
    """Return whether a row and the next ones have numbers in the same columns."""
    kinds = [[_is_value(cell) for cell in row] for row in rows[i : i + 3]]
    return all(2 * sum(a and b for a, b in zip(kinds[0], other, strict=True)) >= numbers[i] for other in kinds)


def _is_value(cell: Any) -> bool:
    return isinstance(cell, (float, int, datetime.datetime, datetime.time, datetime.timedelta))


def _cell(cell: Any) -> Any:
    """Return a cell as a number, an ISO date or a text."""
    if cell == "":
        return None
    if isinstance(cell, datetime.timedelta):
        return cell.total_seconds()
    if isinstance(cell, datetime.datetime):
        return cell.isoformat()
    if isinstance(cell, datetime.time):
        return 3600.0 * cell.hour + 60.0 * cell.minute + cell.second + 1e-6 * cell.microsecond
    return cell
