"""Measurement files of LabVIEW (.lvm): segments with their own header, times in columns or as a step."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.cells import any_numbers, split_cells
from friction_fmus.identification.data.heading_rows import is_unit, split_unit, unique_names
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import ChannelGroup, DataTable, on_one_clock
from friction_fmus.identification.data.text_file import LARGEST_TRACE, whole_text

SUFFIXES: Final = (".lvm",)

END: Final = "***End_of_Header***"


def recognises(head: str) -> bool:
    """Return whether a text is a measurement file of LabVIEW."""
    return head.lstrip().startswith("LabVIEW Measurement")


def read(path: Path) -> DataTable:
    """Read the segments with the channels of the first one; their times continue."""
    sections = whole_text(path, LARGEST_TRACE).split(END)
    if len(sections) < 3:
        raise RecordError(f"{path} has no segment of a LabVIEW measurement; export it again.")
    separator = {"comma": ",", "semicolon": ";"}.get(_keys(sections[0], "\t,;").get("Separator", "").lower(), "\t")
    about = _keys(sections[0], separator)
    comma = about.get("Decimal_Separator", ".") == ","
    names: list[str] = []
    parts: list[list[tuple[Array, Array]]] = []
    header = _keys(sections[1], separator)
    for section, following in pairwise(sections[1:]):
        keys, rows = _keys(section, separator), _rows(following, separator)
        channels = int(keys.get("Channels", "0") or 0) or len(rows[0]) - 2
        if not names:
            names = _names(rows[0], channels)
        if len(rows) > 1:
            part = _channels(path, rows[1:], keys, about.get("X_Columns", "One"), channels, comma)
            if len(part) == len(names):
                parts.append(part)
    if not parts:
        raise RecordError(f"{path} is a LabVIEW measurement without numbers; export it again.")
    groups: list[ChannelGroup] = []
    units = {}
    for index, name in enumerate(names):
        t, values = (np.concatenate([part[index][k] for part in parts]) for k in (0, 1))
        plain, inside = split_unit(name)
        label = _per_channel(header, "Y_Unit_Label", index)
        units[plain] = label if is_unit(label) else inside
        same = next((k for k, group in enumerate(groups) if np.array_equal(group.t, t)), None)
        if same is None:
            groups.append(ChannelGroup(t, {plain: values}))
        else:
            groups[same] = ChannelGroup(t, {**groups[same].signals, plain: values})
    in_seconds = header.get("X_Dimension", "Time").split(separator)[0].strip() in ("", "Time")
    found = on_one_clock(path, groups, "X_Value", "s" if in_seconds else "")
    known = {name: unit for name, unit in {**found.units, **units}.items() if unit}
    what = f"{len(groups[0].t)} rows, {len(names)} channels of LabVIEW"
    start = f"{about.get('Date', '').replace('/', '-')}T{about.get('Time', '').replace(',', '.')[:15]}".strip("T")
    return replace(found, units=known, format=what, preamble=about, start=start)


def _keys(section: str, separators: str) -> dict[str, str]:
    """Return the keys of a header with their values, which separators may divide."""
    found = {}
    for line in section.split("\n"):
        key, _, value = re.sub(f"[{separators}]", "\t", line, count=1).partition("\t")
        if re.fullmatch(r"[A-Za-z_ ]+\d?", key):
            found[key] = value.strip(" \r\n")
    return found


def _per_channel(keys: Mapping[str, str], key: str, index: int) -> str:
    cells = re.split(r"[\t;]", keys.get(key, ""))
    return cells[index].strip() if index < len(cells) else ""


def _rows(section: str, separator: str) -> list[list[str]]:
    """Return headings and rows of a segment, which ends at an empty line or at the next header."""
    rows: list[list[str]] = []
    for line in section.strip("\n").split("\n"):
        if not line.strip() or line.startswith("Channels" + separator):
            break
        rows.append(split_cells(line, separator))
    return rows or [[]]


def _names(row: Sequence[str], channels: int) -> list[str]:
    cells = [cell for cell in row[1:] if cell and cell != "X_Value" and cell != "Comment"]
    names = cells[:channels] if len(cells) >= channels else [f"channel {i + 1}" for i in range(channels)]
    return unique_names(names)


def _channels(
    path: Path, rows: Sequence[Sequence[str]], keys: Mapping[str, str], times: str, channels: int, comma: bool
) -> list[tuple[Array, Array]]:
    """Return times and values of the channels of a segment; a channel may end before the others."""
    found = []
    for index in range(channels):
        column = 2 * index + 1 if times == "Multi" else index + 1
        cells = [row[column] if column < len(row) else "" for row in rows]
        clock = 2 * index if times == "Multi" else 0
        stamps = [row[clock] if clock < len(row) else "" for row in rows]
        numbers = any_numbers(cells, comma)
        begin, step = (any_numbers([_per_channel(keys, key, index) or "0"], comma) for key in ("X0", "Delta_X"))
        t = any_numbers(stamps, comma)
        if numbers is None or t is None or begin is None or step is None:
            raise RecordError(f"{path} has a text among the numbers of channel {index + 1}; correct the file.")
        if times == "No" or not any(stamps):
            t = (begin[0] + step[0] * np.arange(len(cells)), "")
        there = np.isfinite(numbers[0]) & np.isfinite(t[0])
        found.append((t[0][there], numbers[0][there]))
    return found
