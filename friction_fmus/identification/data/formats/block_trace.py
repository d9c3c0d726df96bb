"""Traces of controllers (CODESYS, ctrlX) as text: keys and values, with a block of times and values per variable."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.heading_rows import is_unit, split_unit, stated_period, unique_names
from friction_fmus.identification.data.tables import ChannelGroup, DataTable, on_one_clock
from friction_fmus.identification.data.text_file import LARGEST_TRACE, any_numbers, decimal_comma, whole_text

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
    blocks: list[tuple[str, str, list[tuple[str, str]]]] = []  # name, unit and rows of each variable
    keys: dict[str, str] = {}
    pending: dict[str, str] = {}
    inside = False
    for line in whole_text(path, LARGEST_TRACE).split("\n"):
        if inside and (match := _ROW.fullmatch(line)) is not None:
            blocks[-1][2].append((match[1], match[2]))
        elif _DATA.fullmatch(line):
            inside = True
            unit = next((pending[key] for key in pending if "unit" in key and is_unit(pending[key])), "")
            blocks.append((pending.get("variable", f"column {len(blocks) + 1}"), unit, []))
            pending = {}
        elif (named := _NAME.fullmatch(line)) is not None:
            inside = False
            pending.setdefault("variable", named[3].strip(" ;,\t\"'"))
            if not blocks:
                keys[named[2]] = named[3]
            if named[2].lower() in ("variable", "signal", "channel", "symbol"):
                pending["variable"] = named[3].strip(" ;,\t\"'")
        elif (pair := _KEY.fullmatch(line)) is not None:
            inside = False
            pending[pair[1].lower()] = pair[2]
            keys.setdefault(pair[1], pair[2])
    groups: list[ChannelGroup] = []
    known: dict[str, str] = {}
    comma = any("," in value for *_, rows in blocks for _, value in rows[:100])
    for name, (_, unit, rows) in zip(unique_names([name for name, *_ in blocks]), blocks, strict=True):
        numbers = [found[0] for cells in zip(*rows, strict=True) if (found := any_numbers(cells, comma)) is not None]
        if len(numbers) < 2 and rows:
            raise RecordError(f"{path} has a text among the values of {name!r}; correct the file.")
        plain, its_unit = split_unit(name)
        known[plain] = unit or its_unit
        groups += [ChannelGroup(numbers[0], {plain: numbers[1]})] if rows else []
    if not groups:
        raise RecordError(f"{path} is a trace without values; export it again.")
    clock = next((value for key, value in keys.items() if re.search("time.*unit|time ?base|zeit", key, re.I)), "")
    table = on_one_clock(path, groups, "time", clock if is_unit(clock) else "")
    units = {name: unit for name, unit in {**table.units, **known}.items() if unit and name in table.columns}
    what = f"{len(table.columns['time'])} rows, trace with {len(blocks)} blocks"
    findings = (decimal_comma(path.name),) if comma else ()
    return replace(table, units=units, findings=findings, format=what, preamble=keys, period=stated_period(keys))
