"""Workbooks of spreadsheets (extra ``xlsx``): the sheet with the most numbers, with headings as in a text."""

from __future__ import annotations

import datetime
import zipfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.columns import ColumnBuilder, made_table
from friction_fmus.identification.data.heading_rows import headings
from friction_fmus.identification.data.tables import DataTable, limit_size
from harness.extras import missing

SUFFIXES: Final = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")

CELL: Final = 40  # memory of a cell while a sheet is read [bytes]


def read(path: Path) -> DataTable:
    """Read the table in a workbook."""
    if find_spec("python_calamine") is None:
        raise missing("python-calamine", "reading workbooks needs it")
    from python_calamine import CalamineWorkbook

    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            limit_size(path, sum(info.file_size for info in archive.infolist()))
    with CalamineWorkbook.from_path(path) as book:
        best, name, count = [], "", 0
        for each in book.sheet_names:
            sheet = book.get_sheet_by_name(each)
            limit_size(path, CELL * sheet.total_height * sheet.total_width)
            rows = sheet.to_python()
            numbers = sum(isinstance(cell, (float, int)) for row in rows for cell in row)
            if numbers > count:
                best, name, count = rows, each, numbers
    if not count:
        raise RecordError(f"{path} has no sheet with numbers; save time, position and force in one.")
    return _table(path, best, name)


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
    columns = []
    for j, column in enumerate(heading.names):
        builder = ColumnBuilder(column)
        builder.add_objects([_cell(row[j]) for _, row in body])
        columns.append(builder)
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
