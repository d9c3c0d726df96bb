"""Mapping of columns to signals from unambiguous headings; otherwise a template of the mapping to complete."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.identification.data.headings import meaning_of
from friction_fmus.identification.data.mapping import Column, DataMapping
from friction_fmus.identification.data.quantities import axis_units, factor, fits, unit_of, wanted_unit
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError

EPOCH_UNITS: Final = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Units of times since 1970 without a unit, as computers log them; their size leaves no choice."""


def guess_mapping(table: Table, path: Path) -> DataMapping:
    """Return the mapping implied by headings with units.

    Raises
    ------
    RecordError
        If the headings are ambiguous; the message contains a template of the mapping.
    """
    found: dict[str, Column] = {}
    reasons = []
    named = set()
    for role, columns in _columns_by_role(table).items():
        named.add(role)
        fitting = []
        for column in columns:
            known = unit_of(column.unit)
            if known is None or not fits(role, known):
                problem = f"the unit {column.unit}, which is not valid for a {role}" if column.unit else "no unit"
                reasons.append(f"{column.column!r} has {problem}")
            else:
                fitting.append(column)
        if len(fitting) > 1:
            reasons.append(f"{' and '.join(repr(c.column) for c in fitting)} could both be the {role}")
        elif fitting:
            found[role] = fitting[0]
    reasons += _other_axis(found)
    for need in (("time",), ("position", "velocity"), ("force", "friction")):
        if not (found.keys() | named) & set(need):
            reasons.append(f"no heading is recognised as {' or '.join(need)}")
    if reasons:
        raise RecordError(
            f"The headings of {path} do not identify its columns: {'; '.join(reasons)}. Save the following text as "
            f"{path.stem}.toml in the same folder, correct it, and use that file instead:\n\n"
            f"{mapping_to_write(table, path, found)}"
        )
    return DataMapping(path, columns=found)


def mapping_to_write(table: Table, path: Path, found: Mapping[str, Column]) -> str:
    """Return a template of a mapping as TOML, with the recognised columns, and ? for unknown entries."""
    by_role = _columns_by_role(table)
    free = [name for name in (*table.columns, *table.texts) if name not in {column.column for column in found.values()}]
    entries = []
    for role in ("time", "position", "force"):
        column = found.get(role)
        if column is None:
            column = next(iter(by_role.get(role, ())), Column("?", "?"))
            column = replace(column, unit=column.unit or "?")
            free = [name for name in free if name != column.column]
        entries.append(_entry(role, column))
    entries += [_entry(role, column) for role, column in found.items() if role not in ("time", "position", "force")]
    return "\n".join(
        [
            "[data]",
            f"file = {json.dumps(path.name, ensure_ascii=False)}",
            "",
            "[columns]",
            *entries,
            '# a drive command: unit = "V", gain = "35.15 N/V"; a motor torque on a linear axis: gain = "314 N/(N.m)";',
            '# increments of an encoder: unit = "1", gain = "0.5 um"; an inverted sign: sign = -1',
            "# other roles: velocity, reference, normal (force), and friction instead of force if it was measured",
            f"# unused columns: {', '.join(free) or 'none'}",
        ]
    )


def _entry(role: str, column: Column) -> str:
    heading, unit = (json.dumps(text, ensure_ascii=False) for text in (column.column, column.unit))
    return f"{role} = {{ column = {heading}, unit = {unit} }}"


def _columns_by_role(table: Table) -> dict[str, list[Column]]:
    """Return the columns that could have each role; a fallback only if there is no other column."""
    found: dict[str, list[tuple[bool, Column]]] = {}
    for heading in (*table.columns, *table.texts):
        meaning = meaning_of(heading, table.units.get(heading, ""))
        if meaning is not None:
            unit = meaning.unit
            if meaning.role == "time" and not unit and heading in table.columns:
                unit = _epoch_unit(table.columns[heading])
            found.setdefault(meaning.role, []).append((meaning.fallback, Column(heading, unit)))
    return {
        role: [column for fallback, column in columns if fallback == all(later for later, _ in columns)]
        for role, columns in found.items()
    }


def _other_axis(found: dict[str, Column]) -> list[str]:
    """Remove the columns whose unit is not one of the axis, such as a motor torque beside a position in mm.

    Returns
    -------
    list of str
        What is wrong with the removed columns that the identification needs.
    """
    role = next((role for role in ("position", "reference", "velocity") if role in found), None)
    known = None if role is None else unit_of(found[role].unit)
    if role is None or known is None:
        return []
    units = axis_units(role, known)
    reasons = []
    for other, column in list(found.items()):
        unit = unit_of(column.unit)
        if unit is not None and units is not None and factor(other, unit, units) is None:
            del found[other]
            if other in ("force", "friction"):
                gain = f'gain = "100 {wanted_unit(other, units)}/({column.unit})"'
                reasons.append(
                    f"{column.column!r} is in {column.unit}, but the {role} in {found[role].unit}, so the former needs "
                    f"a gain, such as {gain}"
                )
    return reasons


def _epoch_unit(times: Array) -> str:
    """Return the unit of times since 1970 that lie between the years 2001 and 2096; empty for others."""
    first = float(times[np.argmax(np.isfinite(times))]) if times.size else 0.0
    return next((unit for unit, factor in EPOCH_UNITS.items() if 1e9 * factor < first < 4e9 * factor), "")
