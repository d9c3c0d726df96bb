"""Lines above the numbers of a table: headings in one to three rows, units, keys and values."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from friction_fmus.identification.data.column_headings import LONGEST, meaning_of
from friction_fmus.identification.data.record import unit_of
from friction_fmus.identification.data.text_file import is_moment, numeric

_HEADING = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*(\([^()]*\))?[^\[\]()]*)[\])]\s*")

_WIDE: Final = str.maketrans("（）［］【】", "()[][]")  # brackets of Chinese and Japanese texts

_DRIVE_UNITS: Final = re.compile(
    r"(qc|inc|incs|increments?|inkr?\.?|counts?|cnts?|pls|pulses?|ticks?|steps?|digits?|lsb|bits?|raw|"
    r"0[.,]1\s?%|1/10\s?%|‰|%+|per ?mille?|r/min|rev/min|/min|u/min|°|(deg|°)\s?[cf]|none|n/?a|-|unitless|bool|enum|"
    r"hex)",
    re.IGNORECASE,
)
"""Units as drives write them, besides those that have a value in SI."""

_TYPES = re.compile(
    r"(u|l|d|s|us|ud|ul)?(int|real)(8|16|32|64)?(_t)?|bool(ean)?|float(32|64)?|double|word|dword|byte|text|string|"
    r"(single|continuous|discrete)|number|numeric",
    re.IGNORECASE,
)
_INDEX = re.compile(r"(0x)?[0-9a-f]{1,4}(h?[:.][0-9a-f]{1,4})?h?|#?\d+(\.\d+)?", re.IGNORECASE)
_GENERIC = re.compile(
    r"(analog|digital|analogue|channel|kanal|chan|ch|signal|trace|var|variable|value|input|in|curve|kurve|data|axis|"
    r"plot|y|cond|monitor)[\s_.#-]*\d+",
    re.IGNORECASE,
)
"""Names of channels that say nothing about the signal."""

_PERIOD = re.compile(
    r"sampl|abtast|interval|intervall|cycle|zyklus|takt|period|delta.?[tx]\b|time.?step|increment|resolution|^dt$|^ts$"
    r"|scan|rate|frequen|freq\b",
    re.IGNORECASE,
)
_VALUE = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*([^\d;]*)\s*")

LONGEST_PREAMBLE: Final = 500  # largest number of keys that are kept


@dataclass(frozen=True)
class Headings:
    """What the rows above a table say."""

    names: list[str]  # unique names of all columns
    units: Mapping[str, str] = field(default_factory=dict)  # by name
    named: bool = True  # whether a row of headings was found
    preamble: Mapping[str, str] = field(default_factory=dict)
    period: float = 0.0  # [s]; 0 if unknown
    mismatch: str = ""  # row of headings with another number of cells than the table; empty if there is none
    given: frozenset[str] = frozenset()  # names that the file states


def split_unit(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading such as ``x [mm]`` or ``x (mm)``; the unit may be empty."""
    heading = heading.strip().strip('"').strip().translate(_WIDE)
    match = _HEADING.fullmatch(heading) if len(heading) <= LONGEST else None
    if not match or not match["name"] or match["unit"].isdigit():  # q[0]
        return heading, ""
    return match["name"].removesuffix("/").rstrip(), match["unit"].strip(" -")


def headings(rows: Sequence[Sequence[str]], width: int, loose: bool = False) -> Headings:
    """Return names and units of the columns of a table from the cells of the rows above it."""
    # Rows with one cell per column directly above the table are names, units, data types or indices, in any order. If
    # there are two rows of names, and the upper one only counts channels (``Analog 1``) or groups them, both are used.
    # A table with a `loose` end has an empty last column, whose cell may be missing.
    fitting: list[list[str]] = []
    begin = len(rows)
    while begin and len(fitting) < 8 and (row := _fitted(rows[begin - 1], width, loose)) is not None:
        fitting.insert(0, row)
        begin -= 1
    kinds = [_kind(row) for row in fitting]
    if "names" not in kinds and "units" in kinds:  # such as t;N;F
        units_only = kinds.index("units")
        if any(map(_is_signal, fitting[units_only])):
            kinds[units_only] = "names"
    named = [i for i, kind in enumerate(kinds) if kind == "names"]
    others = [row for i, row in enumerate(rows) if i < begin or kinds[i - begin] == "settings"]
    keys = _preamble(others)
    period = stated_period(keys)
    if stride := _stride(fitting):
        return _pairs(fitting, stride, keys, period)
    names, units = [""] * width, [""] * width
    if named:
        best = max(named, key=lambda i: (sum(map(_is_signal, fitting[i])), i))
        if best + 1 in named and _generic(fitting[best]):
            best += 1
        names = list(fitting[best])
        if best - 1 in named and (_generic(fitting[best - 1]) or _groups(fitting[best - 1], fitting[best])):
            names, units = _combined(fitting[best - 1], fitting[best])
        near = sorted((i for i, kind in enumerate(kinds) if kind == "units"), key=lambda i: (i < best, abs(i - best)))
    else:
        near = [i for i, kind in enumerate(kinds) if kind == "units"]
    for i in near[:1]:
        units = [_plain_unit(cell) or unit for cell, unit in zip(fitting[i], units, strict=True)]
    mismatch = ""
    if not fitting and rows and len(rows[-1]) > 1 and _kind(rows[-1]) == "names":
        mismatch = f"{len(rows[-1])} names"
    return named_columns(names, units, bool(named), keys, period, mismatch)


def named_columns(
    names: Sequence[str],
    units: Sequence[str],
    named: bool = True,
    preamble: Mapping[str, str] | None = None,
    period: float = 0.0,
    mismatch: str = "",
) -> Headings:
    """Return unique names of columns, without their units."""
    parts = [split_unit(name) for name in names]
    unique = unique_names([name for name, _ in parts])
    known = {
        name: unit or inside for name, unit, (_, inside) in zip(unique, units, parts, strict=True) if unit or inside
    }
    given = frozenset(name for name, (stated, _) in zip(unique, parts, strict=True) if stated)
    return Headings(unique, known, named, preamble or {}, period, mismatch, given)


def unique_names(names: Sequence[str]) -> list[str]:
    """Return names without repetitions; ``column 6`` for an empty one, ``x (2)`` for the second x."""
    found: dict[str, None] = {}
    for index, name in enumerate(names, start=1):
        base = name or f"column {index}"
        unique, count = base, 1
        while unique in found:
            count += 1
            unique = f"{base} ({count})"
        found[unique] = None
    return list(found)


def is_unit(cell: str) -> bool:
    """Return whether a cell is a unit, with or without brackets."""
    text = _plain_unit(cell)
    return bool(text) and len(text) <= 24 and (_DRIVE_UNITS.fullmatch(text) is not None or unit_of(text) is not None)


def stated_period(keys: Mapping[str, str]) -> float:
    """Return the sample time in the keys above a table [s], if it has a unit; otherwise 0."""
    for key, value in keys.items():
        name, inside = split_unit(key)
        match = _VALUE.match(value)
        if not match or not _PERIOD.search(name):
            continue
        text = (match[2].strip(" []()") or inside).strip() or "?"
        unit = unit_of(text) or unit_of(text.lower())  # such as nSec
        number = float(match[1].replace(",", "."))
        if unit is None or not 0.0 < number < 1e12:
            continue
        seconds = {unit_of("s").exponents: number * unit.factor, unit_of("Hz").exponents: 1.0 / (number * unit.factor)}  # type: ignore[union-attr]
        if 1e-9 < (found := seconds.get(unit.exponents, 0.0)) < 1e4:
            return found
    return 0.0


def _fitted(row: Sequence[str], width: int, loose: bool) -> list[str] | None:
    """Return the cells of a row above a table with one cell per column; None if there are more or fewer."""
    cells = list(row)
    while len(cells) > width and cells[-1].casefold() in ("", "comment"):
        cells.pop()
    if len(cells) == width - 1 and loose:
        cells.append("")
    return cells if len(cells) == width and any(cells) else None


def _kind(row: Sequence[str]) -> str:
    filled = [cell for cell in row if cell]
    if filled[0].endswith((":", "=")):
        return "settings"
    if sum(map(is_unit, filled)) >= max(1, len(filled) - (len(filled) > 3)) and all(len(each) < 25 for each in filled):
        return "units"
    if all(map(_TYPES.fullmatch, filled)):
        return "types"
    if all(map(_INDEX.fullmatch, filled)) and any(any(c.isdigit() for c in cell) for cell in filled):
        return "indices"
    if any(numeric(cell) or is_moment(cell) for cell in filled):
        return "settings"
    return "names"


def _stride(rows: Sequence[Sequence[str]]) -> int:
    """Return the number of columns of each channel if keys and values alternate in several rows; otherwise 0."""
    if len(rows) < 2:
        return 0
    for stride in range(2, len(rows[0]) // 2 + 1):
        keyed = [row for row in rows if row[0] and len({row[i] for i in range(0, len(row), stride)}) == 1]
        if len(rows[0]) % stride == 0 and len(keyed) >= 2 and len({row[0] for row in keyed}) == len(keyed):
            return stride
    return 0


def _pairs(rows: Sequence[Sequence[str]], stride: int, keys: Mapping[str, str], period: float) -> Headings:
    """Return the columns of channels with a time each, whose rows repeat a key before each value."""
    keyed = [row for row in rows if len({row[i] for i in range(0, len(row), stride)}) == 1]
    width = len(rows[0])
    names, units = [""] * width, [""] * width
    at = range(0, width, stride)
    clock = next((row[0] for row in keyed if re.match("x|time|zeit", row[0], re.I)), "time")
    for i in at:
        names[i] = clock
    for row in keyed:
        values = [row[j] for j in range(width) if j not in at]
        if any(values) and all(not value or is_unit(value) for value in values):
            units = ["" if j in at else _plain_unit(row[j]) for j in range(width)]
        elif not any(numeric(value) or is_moment(value) for value in values) and len(set(values)) == len(values):
            names = [names[j] if j in at else row[j] for j in range(width)]
    known = dict(keys) | {row[0]: row[1] for row in keyed}
    return named_columns(names, units, True, known, period or stated_period(known))


def _combined(upper: Sequence[str], lower: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return names and units from two rows of names, where the upper one numbers or groups the columns."""
    if _groups(upper, lower):
        last = ""
        upper = [last := cell or last for cell in upper]
    names, units = [], []
    for above, below in zip(upper, lower, strict=True):
        generic = not above or _GENERIC.fullmatch(above) is not None or above == below
        if not generic and is_unit(below):
            names.append(above)
            units.append(_plain_unit(below))
        else:
            names.append(below if generic and below else f"{above} {below}".strip())
            units.append("")
    return names, units


def _generic(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return 2 * sum(_GENERIC.fullmatch(cell) is not None for cell in filled) >= len(filled)


def _groups(upper: Sequence[str], lower: Sequence[str]) -> bool:
    """Return whether a row groups the columns of the next one, which has names more than once."""
    often, below = Counter(cell for cell in upper if cell), Counter(cell for cell in lower if cell)
    return max(below.values(), default=0) > 1 and (max(often.values()) > 1 or "" in upper[1:])


def _preamble(rows: Sequence[Sequence[str]]) -> dict[str, str]:
    """Return keys and values of the rows above the headings."""
    found: dict[str, str] = {}
    for row in rows[:LONGEST_PREAMBLE]:
        filled = [cell for cell in row if cell]
        if len(filled) == 1 and (split := re.fullmatch(r"([^:=]{1,60}?)\s*[:=]\s*(.+)", filled[0])):
            filled = [split[1], split[2]]
        if said := re.fullmatch(r"(\D{1,60}) is (\S+ \S+)", " ".join(filled)):  # a sentence of LinuxCNC
            filled = [said[1], said[2]]
        if len(filled) >= 2 and len(filled[0]) <= 80:
            found.setdefault(filled[0].rstrip(" :="), "; ".join(filled[1:])[:200])
    return found


def _is_signal(cell: str) -> bool:
    """Return whether a cell of the rows above the numbers names a signal."""
    return meaning_of(*split_unit(cell)) is not None


def _plain_unit(cell: str) -> str:
    return cell.strip().strip("[]() ") if not cell.strip().startswith("-") else cell.strip()
