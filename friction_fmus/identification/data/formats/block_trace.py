"""Traces of controllers (CODESYS, ctrlX) as text: keys and values, with a block of times and values per variable."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.cells import any_numbers, decimal_comma
from friction_fmus.identification.data.heading_rows import is_unit, split_unit, stated_period, unique_names
from friction_fmus.identification.data.tables import ChannelGroup, DataTable, on_one_clock
from friction_fmus.identification.data.text_file import LARGEST_TRACE, whole_text

SUFFIXES: Final = ()

_NAME = re.compile(r"[ \t]*(?:(\d+)\.)?(variable|signal|channel|symbol|name|path)[ \t]*[;,:=\t][ \t]*(\S.*)", re.I)
_DATA = re.compile(r"[ \t]*(?:(\d+)\.)?(data|values|samples|daten|werte)[ \t]*[;,:=\t]*[ \t]*", re.I)
_KEY = re.compile(r"[ \t]*(?:\d+\.)?([^;,:=\t]{1,60}?)[ \t]*[;,:=\t][ \t]*(\S.*?)[ \t;,]*")
_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?"
_ROW = re.compile(
    rf"[;,\t ]*({_NUMBER})[ \t]*(?:[;\t]|,[ \t]|,|[ \t])[ \t]*({_NUMBER}|true|false|nan|inf)[;,\t ]*", re.I
)


def recognises(head: str) -> bool:
    """Return whether a block of data without headings follows the name of a variable."""
    lines = [line for line in head.split("\n") if line.strip()]
    at = next((i for i, line in enumerate(lines) if _DATA.fullmatch(line)), None)
    if at is None or at + 1 >= len(lines) or _ROW.fullmatch(lines[at + 1]) is None:
        return False
    return any(_NAME.fullmatch(line) for line in lines[:at])


def read(path: Path) -> DataTable:
    """Read the blocks of a trace."""
    names: list[str] = []
    blocks: list[tuple[list[str], list[str]]] = []
    keys: dict[str, str] = {}
    units: list[str] = []
    pending: dict[str, str] = {}
    rows: tuple[list[str], list[str]] | None = None
    for line in whole_text(path, LARGEST_TRACE).split("\n"):
        if rows is not None and (match := _ROW.fullmatch(line)) is not None:
            rows[0].append(match[1])
            rows[1].append(match[2])
        elif _DATA.fullmatch(line):
            rows = ([], [])
            blocks.append(rows)
            names.append(pending.get("variable", f"column {len(blocks)}"))
            units.append(next((pending[key] for key in pending if "unit" in key and is_unit(pending[key])), ""))
            pending = {}
        elif (named := _NAME.fullmatch(line)) is not None:
            rows = None
            pending.setdefault("variable", named[3].strip(" ;,\t\"'"))
            if not blocks:
                keys[named[2]] = named[3]
            if named[2].lower() in ("variable", "signal", "channel", "symbol"):
                pending["variable"] = named[3].strip(" ;,\t\"'")
        elif (pair := _KEY.fullmatch(line)) is not None:
            rows = None
            pending[pair[1].lower()] = pair[2]
            keys.setdefault(pair[1], pair[2])
    return _table(path, unique_names(names), units, blocks, keys)


def _table(
    path: Path, names: list[str], units: list[str], blocks: list[tuple[list[str], list[str]]], keys: dict[str, str]
) -> DataTable:
    groups: list[ChannelGroup] = []
    known: dict[str, str] = {}
    comma = any("," in cell for _, values in blocks for cell in values[:100])
    for name, unit, block in zip(names, units, blocks, strict=True):
        numbers = [any_numbers(cells, comma) for cells in block]
        if not block[0]:
            continue
        if numbers[0] is None or numbers[1] is None:
            raise RecordError(f"{path} has a text among the values of {name!r}; correct the file.")
        t, values = (each[0] for each in numbers if each is not None)
        plain, inside = split_unit(name)
        known[plain] = unit or inside
        groups.append(ChannelGroup(t, {plain: values}))
    if not groups:
        raise RecordError(f"{path} is a trace without values; export it again.")
    clock = next((value for key, value in keys.items() if re.search("time.*unit|time ?base|zeit", key, re.I)), "")
    table = on_one_clock(path, groups, "time", clock if is_unit(clock) else "")
    found: dict[str, Any] = {name: unit for name, unit in {**table.units, **known}.items() if unit}
    what = f"{len(table.columns['time'])} rows, trace with {len(blocks)} blocks"
    findings = (decimal_comma(path.name),) if comma else ()
    return replace(table, units=found, findings=findings, format=what, preamble=keys, period=stated_period(keys))
