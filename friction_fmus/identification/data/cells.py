"""Cells of a text table."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.record import Array

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


def decimal_comma(path: Path) -> Finding:
    """Return the finding that commas are read as decimal points."""
    what = f"Commas in the numbers of {path.name} are read as decimal points."
    return Finding("decimal-comma", what, "Check a value of each column, or use decimal points.")
