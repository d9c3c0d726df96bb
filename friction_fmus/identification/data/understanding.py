"""What was understood of a data file, in lines that a user can check."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from friction_fmus.blocks.axis_units import LINEAR, ROTARY
from friction_fmus.identification.data.mapping import UNKNOWN, Column, DataMapping, gain_example, scale_text
from friction_fmus.identification.data.motion_tests import MOST, DriveShare, SampledColumns
from friction_fmus.identification.data.record import Record, unit_of
from friction_fmus.identification.data.tables import DataTable

POOR: Final = 0.3  # share of the variance of the drive below which the mapping deserves a look


def understood(
    table: DataTable, known: DataMapping, records: Sequence[Record], reasons: Mapping[str, str], notes: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Yield what was read and why, as subject and text."""
    record = max(records, key=len)
    rows = len(next(iter(table.columns.values()), ()))
    named = f" ({known.name})" if known.name not in ("", table.file.stem) else ""
    yield "read", f"{table.file.name}{named}: {table.format or f'{rows} rows'}, {1.0 / record.Ts:.6g} Hz"
    order = table.order or tuple(table.columns)
    for role, column in known.columns.items():
        if column.period:
            yield "time", f"no column; sample time {column.period}"
            continue
        place = f"column {order.index(column.column) + 1} " if column.column in order else ""
        name = f"{place}{column.column!r}" if column.column != place.strip() else place.strip()
        unit = f" [{_unit_text(column, table)}]" if _unit_text(column, table) else ""
        why = [reasons[role]] if reasons.get(role) else []
        if role == "force":
            drive = explained(record)
            why = [
                f"explains the motion: {100.0 * drive.share:.3g} % of its variance by inertia, direction and speed"
                if drive.share >= POOR
                else f"explains little of the motion ({100.0 * drive.share:.2g} %): check that it is the right column"
            ]
        yield _subject(role, column), "   ".join([f"{name}{unit}", *why])
    units = record.units
    for note in notes:
        yield "note", note
    if units.known:
        return
    if (force := known.columns.get("force")) is not None and force.gain == UNKNOWN:
        own = f"in {units.force}" if units.force != "1" else f"in the unit of {force.column!r}"
        axis = LINEAR if units.position == LINEAR.position else ROTARY
        constant = f"{axis.words.force} constant" if _is_current(force.unit) else "scale"
        yield "result", f'{own} ({constant} unknown: give --gain "{gain_example(force.unit, axis)}" for {axis.force})'
    way = known.columns.get("position", known.columns.get("velocity"))
    if way is not None and way.gain == UNKNOWN:
        per = units.position if units.position not in ("1", "u.s") else f"the unit of {way.column!r}"
        yield "result", f"lengths and speeds in {per}; give its scale with --columns, such as position=... 1/4096 rev"


def explained(record: Record) -> DriveShare:
    """Return how well the motion of a record explains its drive force."""
    motion = {name: value for name, value in (("q", record.q), ("v", record.v)) if value is not None}
    part = slice(0, MOST)
    values = {name: value[part] for name, value in (motion | {"force": record.column("force")}).items()}
    position = "" if record.q is None else "q"
    return SampledColumns(values, record.Ts).explained(position, "" if position else "v", ["force"])[0]


def _is_current(unit: str) -> bool:
    known, ampere = unit_of(unit) if unit else None, unit_of("A")
    return known is not None and ampere is not None and known.exponents == ampere.exponents


def _subject(role: str, column: Column) -> str:
    return "current" if role == "force" and _is_current(column.unit) else role


def _unit_text(column: Column, table: DataTable) -> str:
    scale = scale_text(column)
    if column.unit != "1" and column.gain not in ("", UNKNOWN):
        return f"{scale}, {column.gain}"
    return scale or ("" if column.gain else table.units.get(column.column, ""))
