"""Results as CSV."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from harness.result import Result, heading, quoted, split_heading, unquoted
from harness.results.table import from_columns, require_distinct
from harness.storage.files import atomic_path, read_csv

_TRUTHS: Final = {"true": True, "false": False}


def to_csv(result: Result, path: str | Path) -> None:
    """Write a result as CSV: ``time [s]`` and one column per variable, with all digits.

    A heading that begins with =, +, - or @ gets a leading apostrophe, so that a spreadsheet does not read it as a
    formula; `from_csv` removes it.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like
        The file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    names = ["time", *result.data_vars]
    columns = [result[name].to_numpy().tolist() for name in names]
    with atomic_path(Path(path)) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(quoted(heading(result, str(name))) for name in names)
        writer.writerows(
            # most readers would not take true and false for numbers
            ([int(value) if value is True or value is False else value for value in row])
            for row in zip(*columns, strict=True)
        )


def from_csv(path: Path) -> Result:
    """Read a result from CSV; a column of whole numbers without a decimal point becomes an Integer."""
    first, *rows = read_csv(path) or [[]]
    for number, row in enumerate(rows, start=1):
        if len(row) != len(first):
            raise ValueError(f"its row {number} has {len(row)} cells instead of {len(first)}")
    headings = [split_heading(unquoted(text)) for text in first]
    require_distinct([name for name, _ in headings])
    cells = zip(*rows, strict=True) if rows else [()] * len(first)
    columns = {name: _column(column) for (name, _), column in zip(headings, cells, strict=True)}
    return from_columns(columns, {name: {"units": unit} for name, unit in headings}, {})


def _column(cells: Sequence[str]) -> NDArray[Any]:
    """Whole numbers, numbers of which empty cells are gaps, truth values, or else texts."""
    for parse in (int, lambda cell: float(cell or "nan"), lambda cell: _TRUTHS[cell.lower()]):
        with suppress(KeyError, ValueError):
            return np.array([parse(cell) for cell in cells])
    return np.array(cells)
