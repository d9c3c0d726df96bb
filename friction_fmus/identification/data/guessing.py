"""Mapping of columns to signals from unambiguous headings; otherwise a template of the mapping to complete."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.identification.data.headings import meaning_of
from friction_fmus.identification.data.mapping import ROLES, Column, DataMapping
from friction_fmus.identification.data.quantities import axis_units, factor, fits, unit_of, wanted_unit
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError

EPOCH_UNITS: Final = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Units of times since 1970 without a unit, as computers log them; their size leaves no choice."""

NEEDED: Final = (("time",), ("position", "velocity"), ("force", "friction"))
"""Roles of which an identification needs one each."""


@dataclass(frozen=True)
class Guess:
    """What the headings of a file say."""

    columns: dict[str, Column]
    """Columns with a unit that fits, by role."""
    suggestions: dict[str, Column]
    """Recognised columns that lack a unit or a gain, or are one of several, by role."""
    problems: dict[str, list[str]]
    """What is missing or ambiguous, by role."""


def guess_columns(table: Table) -> Guess:
    """Return the roles of the columns of a table, as far as the headings determine them."""
    guess = Guess({}, {}, {})
    for role, columns in _columns_by_role(table).items():
        fitting = []
        for column in columns:
            known = unit_of(column.unit)
            if known is None or not fits(role, known):
                problem = f"the unit {column.unit}, which is not valid for a {role}" if column.unit else "no unit"
                guess.problems.setdefault(role, []).append(f"{column.column!r} has {problem}")
            else:
                fitting.append(column)
        if len(fitting) > 1:
            both = f"{' and '.join(repr(column.column) for column in fitting)} could both be the {role}"
            guess.problems.setdefault(role, []).append(both)
        elif fitting:
            guess.columns[role] = fitting[0]
        if role not in guess.columns:
            guess.suggestions[role] = columns[0]
    _remove_other_axis(guess)
    named = guess.columns.keys() | guess.suggestions.keys()
    for need in NEEDED:
        if not named & set(need):
            guess.problems[need[0]] = [f"no heading is recognised as {' or '.join(need)}"]
    return guess


def guess_mapping(table: Table, path: Path) -> DataMapping:
    """Return the mapping implied by headings with units."""
    guess = guess_columns(table)
    if guess.problems:
        reasons = "; ".join(problem for problems in guess.problems.values() for problem in problems)
        raise RecordError(
            f"The headings of {path} do not identify its columns: {reasons}. Run friction-fmus study --init "
            f"{path.name}, which asks for them, or save the following text as {path.stem}.toml in the same folder, "
            f"correct it, and use that file instead:\n\n[data]\nfile = {quoted(path.name)}\n\n"
            f"{columns_text(table, guess.columns, guess.suggestions)}"
        )
    return DataMapping(path, columns=guess.columns)


def columns_text(table: Table, known: Mapping[str, Column], suggestions: Mapping[str, Column]) -> str:
    """Return the table ``[columns]`` of a mapping as TOML, with ? for unknown entries."""
    entries = dict(known)
    for role in ("time", "position", "force"):
        if not (entries.keys() & set(next((need for need in NEEDED if role in need), ()))):
            entries[role] = suggestions.get(role, Column("?", "?"))
    used = {column.column for column in entries.values()}
    free = [name for name in (*table.columns, *table.texts) if name not in used]
    order = sorted(entries, key=ROLES.index)
    return "\n".join(
        [
            "[columns]",
            *(_entry(role, entries[role]) for role in order),
            '# a drive command: unit = "V", gain = "35.15 N/V"; a motor torque on a linear axis: gain = "314 N/(N.m)";',
            '# increments of an encoder: unit = "1", gain = "0.5 um"; an inverted sign: sign = -1',
            "# other roles: velocity, reference, normal (force), and friction instead of force if it was measured",
            f"# unused columns: {', '.join(free) or 'none'}",
        ]
    )


def quoted(text: str) -> str:
    """Return a text as a string of TOML."""
    return json.dumps(text, ensure_ascii=False)


def _entry(role: str, column: Column) -> str:
    if column.period:
        return f"{role} = {{ period = {quoted(column.period)} }}"
    keys = [f"column = {quoted(column.column)}", f"unit = {quoted(column.unit or '?')}"]
    keys += [f"gain = {quoted(column.gain)}"] if column.gain else []
    keys += [f"sign = {column.sign}"] if column.sign != 1 else []
    return f"{role} = {{ {', '.join(keys)} }}"


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


def _remove_other_axis(guess: Guess) -> None:
    """Remove the columns whose unit is not one of the axis, such as a motor torque beside a position in mm."""
    found = guess.columns
    role = next((role for role in ("position", "reference", "velocity") if role in found), None)
    known = None if role is None else unit_of(found[role].unit)
    if role is None or known is None:
        return
    units = axis_units(role, known)
    for other, column in list(found.items()):
        unit = unit_of(column.unit)
        if unit is not None and units is not None and factor(other, unit, units) is None:
            del found[other]
            if other in ("force", "friction"):
                gain = f'gain = "100 {wanted_unit(other, units)}/({column.unit})"'
                guess.suggestions[other] = replace(column, gain="?")
                guess.problems[other] = [
                    f"{column.column!r} is in {column.unit}, but the {role} in {found[role].unit}, so the former needs "
                    f"a gain, such as {gain}"
                ]


def _epoch_unit(times: Array) -> str:
    """Return the unit of times since 1970 that lie between the years 2001 and 2096; empty for others."""
    first = float(times[np.argmax(np.isfinite(times))]) if times.size else 0.0
    return next((unit for unit, factor in EPOCH_UNITS.items() if 1e9 * factor < first < 4e9 * factor), "")
