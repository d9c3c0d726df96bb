"""Cells of a table: numbers with decimal points or commas, truth values, dates and times of the day."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.identification.data.record import Array, RecordFinding

MISSING: Final = (
    *("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "n/a", "null", "NULL", "None", "#N/A", "#NV", "-", "--", "---"),
    *("-nan(ind)", "1.#QNAN", "-1.#IND", "1.#IND"),
)
"""Cells without a value."""

_NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_WORDS = dict.fromkeys(MISSING, math.nan) | {
    **dict.fromkeys(("true", "True", "TRUE", "on", "On", "ON"), 1.0),
    **dict.fromkeys(("false", "False", "FALSE", "off", "Off", "OFF"), 0.0),
}
_THOUSANDS: Final = {
    ",": re.compile(r"[-+]?\d{1,3}((,\d{3})+\.\d+|(,\d{3}){2,})"),
    ".": re.compile(r"[-+]?\d{1,3}((\.\d{3})+,\d+|(\.\d{3}){2,})"),
}
"""Numbers that certainly have thousands separators; a single one without decimals may be a decimal separator."""
_REGULAR: Final = {
    ",": re.compile(r"[-+]?(\d{1,3}(,\d{3})+|\d*)(\.\d*)?"),
    ".": re.compile(r"[-+]?(\d{1,3}(\.\d{3})+|\d*)(,\d*)?"),
}
_SUFFIXED = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([^\W\d_°%‰]{1,6}|[°%‰]\w{0,2}|[^\W\d_]{1,4}/\w{1,4})")
_DATE = re.compile(r"(\d{4}[-./]\d{1,2}[-./]\d{1,2}|\d{1,2}[-./]\d{1,2}[-./]\d{2,4})([T ,;]+\d.*)?")
_TIME = re.compile(r"\d{1,2}:\d{2}:\d{2}([.,:]\d+)?( ?[AaPp][Mm])?")


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line without spaces and quotes around them."""
    if separator == " ":
        cells = line.split()
    elif '"' in line and line.count('"') % 2 == 0:
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    else:
        cells = line.split(separator)
    return [cell.strip().strip('"').strip() for cell in cells]


def numeric(cell: str) -> bool:
    """Return whether a cell is a number, with a decimal point or a decimal comma."""
    return _NUMBER.fullmatch(cell) is not None


def is_moment(cell: str) -> bool:
    """Return whether a cell is a date or a time of the day."""
    return _DATE.fullmatch(cell) is not None or _TIME.fullmatch(cell) is not None


def is_value(cell: str) -> bool:
    """Return whether a cell can stand in a column of numbers or times."""
    return (
        numeric(cell)
        or cell in _WORDS
        or is_moment(cell)
        or any(form.fullmatch(cell) for form in _THOUSANDS.values())
        or _SUFFIXED.fullmatch(cell) is not None
    )


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


def any_numbers(cells: Sequence[str], comma: bool) -> tuple[Array, str] | None:
    """Return cells with thousands separators, or with the same unit behind each number, as numbers and their unit."""
    if (values := numbers(cells, comma)) is not None:
        return values, ""
    for separator, form in _THOUSANDS.items():
        if any(map(form.fullmatch, cells)) and all(map(_REGULAR[separator].fullmatch, cells)):
            plain = numbers([cell.replace(separator, "") for cell in cells], separator == ".")
            return None if plain is None else (plain, "")
    parts = [_SUFFIXED.fullmatch(cell) for cell in cells if cell not in MISSING]
    units = {part[2] if part else "" for part in parts}
    if len(units) != 1 or not (unit := units.pop()):
        return None
    values = numbers(["" if cell in MISSING else cell.removesuffix(unit).rstrip() for cell in cells], comma)
    return None if values is None else (values, unit)


FORMATS: Final = (
    *(f"{date} %H:%M:%S.%f" for date in ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%Y.%m.%d", "%d-%m-%Y")),
    *(f"{date} %I:%M:%S.%f %p" for date in ("%d/%m/%Y", "%m/%d/%Y", "%Y-%m-%d")),
    *("%d.%m.%y %H:%M:%S.%f", "%H:%M:%S.%f", "%I:%M:%S.%f %p"),
)
"""Forms of dates besides ISO 8601; day and month may be confused, which matters only if the date changes."""

_FRACTION = re.compile(r"(:\d{2}:\d{2})(?:[.,:](\d+))?")


def moments(cells: Sequence[str]) -> NDArray[np.int64] | None:
    """Return dates with times in ns since 1970, and times of the day since 1900; None if a cell is no such date."""
    import pandas as pd

    if not all(cell in MISSING or is_moment(cell) for cell in cells) or not any(":" in cell for cell in cells):
        return None
    plain = [
        None if cell in MISSING else _FRACTION.sub(lambda m: f"{m[1]}.{(m[2] or '0')[:9]}", cell, count=1)
        for cell in cells
    ]
    for form in ("ISO8601", *FORMATS):
        if form == "ISO8601" and any(cell is not None and _TIME.fullmatch(cell) for cell in plain):
            continue
        try:
            found = pd.to_datetime(pd.Series(plain, dtype=object), format=form, utc=True)
            return np.asarray(found.dt.as_unit("ns").astype("int64"))
        except (ValueError, OverflowError):
            continue
    return None


def is_time_of_day(moments: NDArray[np.int64]) -> bool:
    """Return whether moments are times without a date."""
    return bool(np.all(moments < -(2**60)))


def decimal_comma(name: Any) -> RecordFinding:
    """Return the finding that commas are read as decimal points."""
    what = f"Commas in the numbers of {name} are read as decimal points."
    return RecordFinding("decimal-comma", what, "Check a value of each column, or use decimal points.")
