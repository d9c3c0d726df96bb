"""Text with any separator, decimal commas, lines above the table, several rows of headings, dates."""

import io
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.errors import RecordError
from friction_fmus.identification.data import text_file as cell
from friction_fmus.identification.data.column_builder import ColumnBuilder, made_table
from friction_fmus.identification.data.heading_rows import Headings, headings
from friction_fmus.identification.data.record import RecordFinding
from friction_fmus.identification.data.tables import DataTable, limit_size
from friction_fmus.identification.data.text_file import NAMES, pieces, split_cells

SUFFIXES: Final = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".prn", ".tab", ".out", ".trc", ".trace")

COMMENTS: Final = ("#", "%", "//", "!", '"#')
SEPARATORS: Final = {";": "semicolons", "\t": "tabs", ",": "commas", "|": "bars", " ": "spaces"}

Naming = Callable[[Sequence[Sequence[str]], int, bool], Headings]

EXAMINED: Final = 200  # number of lines at the end of the first piece that determine the separator


@dataclass
class TextLayout:
    """How the lines of a table are read."""

    separator: str
    first: int  # index of the first row among the lines of the first piece
    width: int
    heading: Headings
    comma: bool  # whether the examined numbers have decimal commas
    valued: tuple[int, ...]  # columns of numbers and times
    loose: bool  # whether the last column is empty, so that its separator may be missing
    comments: tuple[str, ...] = COMMENTS  # beginnings of lines that are no rows
    above: frozenset[str] = field(default_factory=frozenset)  # lines above the table, which may be repeated in it
    ragged: bool = False  # whether empty cells at the end of a row may be missing


def read(path: Path, others: tuple[str, ...] = (), named: Naming = headings, ragged: bool = False) -> DataTable:
    """Read a text table: columns separated by ; tab , | or spaces, after comments, keys and headings."""
    # Lines that start with one of the `others` are no rows either, and the rows above the table are `named`.
    with pieces(path) as (encoding, parts):
        head = next(parts, "")
        lines = head.split("\n")
        layout = find_layout(path, lines, COMMENTS + others, named, ragged)
        table = _Body(path, layout)
        start = 1 + layout.first
        table.add("\n".join(lines[layout.first :]), start)
        start += len(lines) - layout.first - 1
        for part in parts:
            table.add(part, start)
            start += part.count("\n")
        return table.finished(NAMES.get(encoding, encoding.upper()))


def find_layout(path: Path, lines: Sequence[str], comments: tuple[str, ...], named: Naming, ragged: bool) -> TextLayout:
    """Return separator, headings and first row of the table in the first lines of a text."""
    numbered = [(i, line) for i, line in enumerate(lines) if line.strip()]
    rows = [(i, line) for i, line in numbered if not line.lstrip().startswith(comments)]
    if len(rows) < 4:
        raise RecordError(f"{path} has too few lines for a table ({len(rows)}); use a heading and rows of numbers.")
    separator = _separator([line for _, line in rows[-max(3, min(EXAMINED, len(rows) // 2)) :]])
    split = [(i, split_cells(line, separator)) for i, line in rows]
    if len(split[-1][1]) == 1 and len(split[-2][1]) > 1 and not cell.numeric(split[-1][1][0]):
        del split[-1]  # EOF
    if ragged:
        widest = max(len(row) for _, row in split)
        split = [(i, row + [""] * (widest - len(row))) for i, row in split]
    at = _first_row([row for _, row in split])
    if at is None:
        raise RecordError(f"{path} has no line of numbers; use a table with a heading and rows of numbers.")
    first, body = split[at][0], [row for _, row in split[at:]]
    width = Counter(map(len, body)).most_common(1)[0][0]
    whole = [row for row in body if len(row) == width]
    comma = separator != "," and any("," in each and cell.numeric(each) for row in whole for each in row)
    comma = comma or (any('"' in line for line in lines[first : first + 3]) and _quoted_commas(whole))
    # a comment may be the heading, as written by numpy.savetxt
    above = [
        line.lstrip("#%/! \t" if line.lstrip().startswith(COMMENTS) else " \t") for i, line in numbered if i < first
    ]
    keys = comments[len(COMMENTS) :]  # of a format that has no headings among them
    cells = [_heading_cells(line, separator, width) for line in above]
    cells = [[f"{row[0]}:", *row[1:]] if row and row[0].startswith(keys) else row for row in cells]
    if [row[0] for row in whole[:3]] == ["1", "2", "3"]:  # numbers of rows, which R gives no heading
        cells = [["", *row] if len(row) == width - 1 else row for row in cells]
    loose, repeated = not any(row[-1] for row in whole), frozenset(line.strip() for line in lines[:first])
    heading = named(cells, width, loose)
    if not heading.named and width % 2 == 0:  # the scope of LinuxCNC writes the name of each value before it
        before = [
            each[0] if len(set(each)) == 1 and not cell.is_value(each[0]) else "" for each in zip(*whole, strict=True)
        ][::2]
        if all(before):
            heading = named([*cells, [name for each in before for name in ("", each)]], width, loose)
    if not heading.named and heading.mismatch and separator == "," and width == 2 * int(heading.mismatch.split()[0]):
        raise RecordError(
            f"The heading of {path} has {heading.mismatch}, but the numbers below have {width} columns; if the commas "
            "are decimal points, use semicolons between the columns."
        )
    valued = tuple(j for j in range(width) if 2 * sum(cell.is_value(row[j]) for row in whole) > len(whole))
    return TextLayout(separator, first, width, heading, comma, valued, loose, comments, repeated, ragged)


def _heading_cells(line: str, separator: str, width: int) -> list[str]:
    cells = split_cells(line, separator)
    if separator == " " and len(cells) != width:
        for other in (r"\s{2,}|\t", r"[;,\t]\s*", r"(?<=[\])])\s+"):
            parts = [part.strip().strip('"') for part in re.split(other, line.strip())]
            if len(parts) == width:
                return parts
    return cells


def _quoted_commas(rows: Sequence[Sequence[str]]) -> bool:
    found = [each for row in rows for each in row if "," in each]
    return bool(found) and all(map(cell.numeric, found))


def _separator(lines: Sequence[str]) -> str:
    """Return the separator with the most numbers in the most lines of equal length; a space if there is none."""
    best, found = (0.0, 0), " "
    for separator in SEPARATORS:
        rows = [split_cells(line, separator) for line in lines]
        width, often = Counter(map(len, rows)).most_common(1)[0]
        if width < 2:
            continue
        rows = [row for row in rows if len(row) == width]
        values = sum(cell.is_value(each) for row in rows for each in row) / (width * len(rows))
        score = (round(often / len(lines) * (0.2 + values), 2), -list(SEPARATORS).index(separator))
        if score > best:
            best, found = score, separator
    return found


def _first_row(rows: Sequence[Sequence[str]]) -> int | None:
    """Return the index of the first row of data: as wide as the last rows, with numbers where they have numbers."""
    for size in (50, 8, 3):  # the table may be shorter than the lines above it
        tail = rows[-size:]
        width = Counter(map(len, tail)).most_common(1)[0][0]
        tail = [row for row in tail if len(row) == width]
        filled = [
            i for i in range(width) if 2 * sum(row[i] != "" and cell.is_value(row[i]) for row in tail) > len(tail)
        ]
        if any(cell.numeric(row[i]) for row in tail for i in filled):
            break
    else:
        return None

    def is_row(row: Sequence[str]) -> bool:
        return len(row) == width and 2 * sum(cell.is_value(row[i]) and row[i] != "" for i in filled) >= len(filled)

    last = len(rows) - 1
    starts = (i for i, row in enumerate(rows) if is_row(row) and is_row(rows[min(i + 1, last)]))
    first = next((i for i in starts if cell.is_value(rows[i][filled[0]])), None)
    if first and first < last and _is_count(rows[first]) and cell.numeric(rows[first + 1][0]):
        first += float(rows[first + 1][0].replace(",", ".")) <= float(rows[first][0])
    return first


def _is_count(row: Sequence[str]) -> bool:
    """Return whether a row counts its cells."""
    return len(row) > 2 and any(list(row) == [str(i) for i in range(k, k + len(row))] for k in (0, 1))


class _Body:
    """Rows of a table, which are added in pieces."""

    def __init__(self, path: Path, layout: TextLayout) -> None:
        self.path, self.layout = path, layout
        names = layout.heading.names
        self.columns = [ColumnBuilder(name) for name in names]
        self.lines: list[NDArray[np.int64]] = []
        self.rows = 0
        self.comma = layout.comma
        self.cut: RecordFinding | None = None  # about an incomplete row at the end
        self.ended = False

    def add(self, text: str, start: int) -> None:
        """Add lines of text, the first of which has this number in the file."""
        if self.ended or not text.strip():
            return
        count = text.count("\n") + (not text.endswith("\n"))
        frame = None if self.cut is not None or self._irregular(text) else self._frame(text)
        if frame is not None and frame.shape == (count, self.layout.width) and self._complete(frame):
            numbers = np.arange(start, start + count)
        else:
            kept = self._selected(text, start)
            if not kept:
                return
            numbers = np.array([number for number, _ in kept])
            frame = dict(enumerate(zip(*(row for _, row in kept), strict=True)))
        self.rows += len(numbers)
        limit_size(self.path, 8 * self.rows * self.layout.width)
        for index, column in enumerate(self.columns):
            self.comma |= column.add(frame[index], numbers, self.layout.comma)
        self.lines.append(numbers)

    def _irregular(self, text: str) -> bool:
        """Return whether there may be empty lines, comments, or rows of different length."""
        if text.startswith(("\n", *self.layout.comments)) or any(
            f"\n{mark}" in text for mark in ("\n", *self.layout.comments, " #", " %")
        ):
            return True
        separator = self.layout.separator
        if '"' in text or separator == " ":
            return '"' in text
        lines = text.count("\n") + (not text.endswith("\n"))
        return text.count(separator) != lines * (self.layout.width - 1)

    def _frame(self, text: str) -> Any:
        """Return the cells of a text as a data frame; None if its rows differ."""
        import pandas as pd

        exact: Any = {} if int(pd.__version__.split(".")[0]) >= 3 else {"float_precision": "round_trip"}
        try:
            return pd.read_csv(
                io.StringIO(text),
                sep=r"\s+" if self.layout.separator == " " else self.layout.separator,
                header=None,
                decimal="," if self.layout.comma else ".",
                na_values=list(cell.MISSING),
                keep_default_na=False,
                skipinitialspace=True,
                skip_blank_lines=False,
                low_memory=False,
                **exact,
            )
        except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError, OverflowError):
            return None

    def _complete(self, frame: Any) -> bool:
        """Return whether no row is shorter than the others and no column of numbers has texts."""
        texts = [i for i in self.layout.valued if frame[i].dtype.kind not in "biuf" and self.columns[i].is_number]
        short = self.layout.separator == " " and bool(frame[self.layout.width - 1].isna().any())
        return not short and not texts

    def _selected(self, text: str, start: int) -> list[tuple[int, list[str]]]:
        """Return the rows among some lines with their numbers, and remember an incomplete last one."""
        width, found = self.layout.width, []
        lines = text.split("\n")
        for number, line in enumerate(lines, start=start):
            plain = line.strip()
            if not plain or plain.startswith(self.layout.comments) or plain in self.layout.above:
                continue
            if self.cut is not None:
                raise RecordError(
                    f"Line {self.cut_line} of {self.path} has {self.cut_cells} cells, but the others have {width}; "
                    "correct or remove it."
                )
            row = split_cells(line, self.layout.separator)
            if len(row) > width and not any(row[width:]):
                row = row[:width]
            if len(row) != width:
                if (
                    len(row) < max(2, width)
                    and not any(map(cell.is_value, row))
                    and self._is_end(lines[number - start :])
                ):
                    self.ended = True
                    break
                if len(row) < width and (self.layout.ragged or (len(row) == width - 1 and self.layout.loose)):
                    row += [""] * (width - len(row))
                else:
                    self._cut(number, len(row))
                    continue
            found.append((number, row))
        return found

    def _is_end(self, rest: Sequence[str]) -> bool:
        """Return whether no more rows of the table follow."""
        return not any(len(split_cells(line, self.layout.separator)) == self.layout.width for line in rest)

    def _cut(self, number: int, cells: int) -> None:
        self.cut_line, self.cut_cells = number, cells
        what = f"The last row of {self.path.name}, line {number}, is incomplete; it is ignored."
        self.cut = RecordFinding("incomplete-row", what, "The log may have been cut off there.")

    def finished(self, encoding: str) -> DataTable:
        """Return the table."""
        layout = self.layout
        if not self.rows:
            raise RecordError(f"{self.path} has no rows of numbers; use a table with a heading and rows of numbers.")
        findings = [self.cut] if self.cut is not None else []
        if self.comma:
            findings.insert(0, cell.decimal_comma(self.path.name))
        if layout.heading.mismatch:
            what = (
                f"The headings of {self.path.name} do not fit its {layout.width} columns ({layout.heading.mismatch})."
            )
            findings.append(RecordFinding("headings", what, "The columns are counted instead; give each a heading."))
        words = [f"{self.rows} rows", encoding, SEPARATORS[layout.separator]]
        words += ["decimal commas"] if self.comma else []
        words += [f"preamble of {layout.first} lines"] if layout.first > 1 else []
        words += ["no headings"] if not layout.heading.named else []
        lines = np.concatenate(self.lines)
        return made_table(self.path, self.columns, layout.heading, lines, findings, ", ".join(words))
