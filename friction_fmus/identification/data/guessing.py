"""Mapping of columns to signals from unambiguous headings; otherwise a template of the mapping to complete."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from friction_fmus.identification.data.mapping import Column, DataMapping
from friction_fmus.identification.data.quantities import fits, unit_of
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError

#: Unambiguous headings of each role, in lower case.
NAMES = {
    "time": ("t", "time"),
    "position": ("x", "q", "pos", "position", "angle", "displacement"),
    "velocity": ("v", "vel", "velocity", "speed", "omega", "xd", "qd"),
    "reference": ("r", "ref", "reference", "setpoint", "position_reference", "reference_position", "x_ref", "q_ref"),
    "force": ("force", "torque", "drive_force", "motor_torque", "tau"),
    "friction": ("friction", "friction_force", "friction_torque"),
    "normal": ("normal", "normal_force", "fn"),
    "injected": ("injected", "injected_force", "injected_torque", "excitation_force"),
}


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
    for role, names in NAMES.items():
        fitting = []
        for heading in table.columns:
            name, unit = _parts(heading, table.units.get(heading, ""))
            if name in names:
                named.add(role)
                known = unit_of(unit)
                if known is None or not fits(role, known):
                    problem = f"the unit {unit}, which is not valid for a {role}" if unit else "no unit"
                    reasons.append(f"{heading!r} has {problem}")
                else:
                    fitting.append(Column(heading, unit))
        if len(fitting) > 1:
            reasons.append(f"{' and '.join(repr(c.column) for c in fitting)} could both be the {role}")
        elif fitting:
            found[role] = fitting[0]
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
    free = [name for name in table.columns if name not in {column.column for column in found.values()}]
    entries = []
    for role in ("time", "position", "force"):
        column = found.get(role)
        if column is None:
            named = [name for name in free if _parts(name, "")[0] in NAMES[role]]
            heading, unit = (named[0], table.units.get(named[0], "?")) if named else ("?", "?")
            free = [name for name in free if name != heading]
            column = Column(heading, unit)
        entries.append(_entry(role, column))
    entries += [_entry(role, column) for role, column in found.items() if role not in ("time", "position", "force")]
    return "\n".join(
        [
            "[data]",
            f"file = {json.dumps(path.name, ensure_ascii=False)}",
            "",
            "[columns]",
            *entries,
            '# if the column is a drive command: unit = "V", gain = "35.15 N/V"; if its sign is inverted: sign = -1',
            "# other roles: velocity, reference, normal (force), and friction instead of force if it was measured",
            f"# unused columns: {', '.join(free) or 'none'}",
        ]
    )


def _entry(role: str, column: Column) -> str:
    heading, unit = (json.dumps(text, ensure_ascii=False) for text in (column.column, column.unit))
    return f"{role} = {{ column = {heading}, unit = {unit} }}"


def _parts(heading: str, unit: str) -> tuple[str, str]:
    """Return name, in lower case, and unit of a heading; the unit of ``position_mm`` follows the last underscore."""
    name = heading.strip().lower().replace(" ", "_")
    if unit or any(name in names for names in NAMES.values()):
        return name, unit
    stem, underscore, last = heading.strip().rpartition("_")
    if underscore and unit_of(last) is not None and any(stem.lower() in names for names in NAMES.values()):
        return stem.lower(), last
    return name, unit
