"""Text of a data file: its encoding, its content in pieces of limited size, and numbers and dates in its cells."""

import codecs
import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Array, RecordFinding

LARGEST_DATA: Final = 4 << 30  # largest size of a text [bytes]
LARGEST_TRACE: Final = 1 << 28  # largest size of a text that is not read in pieces [bytes]
HEAD: Final = 1 << 20  # size of the part that determines encoding, separator and headings [bytes]
PIECE: Final = 1 << 24  # number of characters that are parsed at once
LONGEST_LINE: Final = 1 << 20  # largest number of characters of a line


def encoding_of(head: bytes) -> str:
    """Return the encoding of a text from its beginning."""
    for mark, name in ((codecs.BOM_UTF8, "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if head.startswith(mark):
            return name
    for start, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(head) > 3 and head[start::2].count(0) > 0.4 * len(head) // 2 > 2 * head[1 - start :: 2].count(0):
            return name
    if _decoded(head, "utf-8") is not None:
        return "utf-8"
    return next((name for name in USUAL if _is_usual(head, name)), "cp1252")


USUAL: Final = {
    "gbk": (0xA1, ((0xA1A1, 0xA9FE), (0xB0A1, 0xD7F9))),
    "cp932": (0x40, ((0x8140, 0x84BE), (0x889F, 0x9872))),
}
"""Usual characters of encodings with two bytes: the least second byte, and the codes of signs with kana and of level 1
of GB 2312 and JIS X 0208.

Most pairs of a letter with an accent and another byte are codes of rare characters.
"""

NAMES: Final = {"utf-8": "UTF-8", "utf-8-sig": "UTF-8", "cp1252": "ISO-8859-1", "cp932": "Shift-JIS"}
"""Encodings as they are shown; others in capitals."""


def _decoded(head: bytes, encoding: str) -> str | None:
    """Return the beginning of a text; None if it has other bytes than the encoding."""
    try:
        return codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return None


def _is_usual(head: bytes, encoding: str) -> bool:
    """Return whether nine of ten characters beyond ASCII are usual ones of an encoding with two bytes each."""
    least, parts = USUAL[encoding]
    text = _decoded(head, encoding) or ""
    codes = [int.from_bytes(char.encode(encoding)) for char in text if char > "\x7f"]
    usual = sum(code & 0xFF >= least and any(a <= code <= b for a, b in parts) for code in codes)
    return bool(codes) and usual >= 0.9 * len(codes)


def head_text(path: Path) -> str:
    """Return the beginning of a text."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    return head.decode(encoding_of(head), errors="replace")


@contextmanager
def pieces(path: Path) -> Iterator[tuple[str, Iterator[str]]]:
    """Yield the encoding of a text and an iterator over its pieces, which consist of whole lines."""
    # The first piece has about the size `HEAD`, so that a table can be examined before most of it is read.
    size = path.stat().st_size
    if size > LARGEST_DATA:
        raise RecordError(f"{path} has {size} bytes of text, more than {LARGEST_DATA}; split the file.")
    with path.open("rb") as binary:
        encoding = encoding_of(binary.read(HEAD))
        binary.seek(0)
        with io.TextIOWrapper(binary, encoding, errors="replace", newline=None) as text:
            yield encoding, _pieces(path, text)


def _pieces(path: Path, text: io.TextIOWrapper) -> Iterator[str]:
    line, size = 1, HEAD
    while piece := text.read(size):
        if not piece.endswith("\n"):
            piece += (rest := text.readline(LONGEST_LINE))
            if len(rest) == LONGEST_LINE:
                raise RecordError(
                    f"Line {line + piece.count(chr(10))} of {path} has more than {LONGEST_LINE} characters; use a text "
                    "with one row of numbers per line."
                )
        if "\0" in piece:
            raise RecordError(f"{path} is not a text, it contains zero bytes; give it the suffix of its format.")
        yield piece
        line, size = line + piece.count("\n"), PIECE


def whole_text(path: Path, largest: int) -> str:
    """Return a text of limited size [bytes]."""
    size = path.stat().st_size
    if size > largest:
        raise RecordError(f"{path} has {size} bytes of text, more than {largest} in this format; split the file.")
    with pieces(path) as (_, parts):
        return "".join(parts)


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
        row = line.strip().rstrip(";")
        # the first and the last row of a matrix of MATLAB have one bracket
        cells = (row.strip("[]") if row.count("[") != row.count("]") else row).split()
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
