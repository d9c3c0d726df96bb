"""Output of microcontrollers on a serial port: ``t: 0.01, pos: 3`` in each line, perhaps behind the time of the day."""

import re
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import ColumnBuilder, made_table
from friction_fmus.identification.data.heading_rows import named_columns
from friction_fmus.identification.data.record import RecordFinding
from friction_fmus.identification.data.tables import DataTable, limit_size
from friction_fmus.identification.data.text_file import LARGEST_TRACE, whole_text

SUFFIXES: Final = ()

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf|true|false"
_PAIR = re.compile(
    rf"([A-Za-z_][\w./\[\]-]*(?: [A-Za-z_]\w*)?)\s*[:=]\s*({_NUMBER})\s*([^\W\d_]{{1,5}}(?:/\w+)?|[°%])?"
)
_LINE = re.compile(rf"\s*{_PAIR.pattern}(?:[\s,;|]+{_PAIR.pattern})+[\s,;|]*")
_STAMP = re.compile(r"\s*(\d{1,2}:\d{2}:\d{2}[.,]\d+)\s*->\s*")
_CELLS = re.compile(r"[\s,;]+")

EXAMINED: Final = 200  # number of lines that are examined
LONGEST: Final = 1000  # largest number of characters of a line that is read


def recognises(head: str) -> bool:
    """Return whether most lines have names beside their numbers, or the time of the day in front of an arrow."""
    lines = [line[:LONGEST] for line in head.split("\n")[:-1] if line.strip()][-EXAMINED:]
    return len(lines) > 2 and sum(bool(_STAMP.match(line) or _LINE.fullmatch(line)) for line in lines) > 0.8 * len(
        lines
    )


def read(path: Path) -> DataTable:
    """Read the lines with the most frequent names, or number of cells; others are ignored."""
    rows: list[tuple[int, str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = []
    headings: list[tuple[str, ...]] = []
    others = 0
    for number, line in enumerate(whole_text(path, LARGEST_TRACE).split("\n"), start=1):
        stamp = _STAMP.match(line)
        rest = line[stamp.end() :] if stamp else line
        if not rest.strip():
            continue
        if len(rest) > LONGEST:
            others += 1
            continue
        pairs = _PAIR.findall(rest)
        if pairs and _PAIR.sub("", rest).strip(" \t,;|") == "":
            rows.append((number, stamp[1] if stamp else "", *zip(*pairs, strict=True)))  # type: ignore[arg-type]
            continue
        cells = tuple(cell for cell in _CELLS.split(rest.strip()) if cell)
        if all(re.fullmatch(_NUMBER, cell) for cell in cells):
            rows.append((number, stamp[1] if stamp else "", ("",) * len(cells), cells, ("",) * len(cells)))
        else:
            headings.append(cells)
            others += 1
    if len(rows) < 3:
        raise RecordError(f"{path} has no lines with numbers; use a table with a heading and rows of numbers.")
    names = Counter(row[2] for row in rows).most_common(1)[0][0]
    kept = [row for row in rows if row[2] == names]
    limit_size(path, 8 * len(kept) * len(names))
    others += len(rows) - len(kept)
    units = [next((row[4][j] for row in kept if row[4][j]), "") for j in range(len(names))]
    if not any(names):
        names = next((each for each in headings if len(each) == len(names)), names)
    stamped = all(row[1] for row in kept)
    heading = named_columns((["time of day"] if stamped else []) + list(names), ([""] if stamped else []) + units)
    columns = [ColumnBuilder(name) for name in heading.names]
    lines = np.array([row[0] for row in kept])
    for column, j in zip(columns, range(-1 if stamped else 0, len(names)), strict=True):
        column.add(tuple(row[1] if j < 0 else row[3][j] for row in kept), lines, False)
    findings = []
    if others:
        what = f"{others} lines of {path.name} have no such numbers as the others and are ignored."
        findings.append(RecordFinding("other-lines", what, "Check that no samples are lost there."))
    return made_table(path, columns, heading, lines, findings, f"{len(kept)} rows, lines of a serial port")
