"""Reading records from data files, the sampling of their columns, and what was understood of a file."""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.integrate import cumulative_trapezoid

from friction_fmus.blocks.axis_units import LINEAR, ROTARY, AxisUnits, units_of_channels
from friction_fmus.errors import AmbiguousColumnsError, RecordError, visible
from friction_fmus.identification.data.column_choice import chosen_columns
from friction_fmus.identification.data.column_guess import with_actual_position
from friction_fmus.identification.data.excitation import position_jumps
from friction_fmus.identification.data.formats import read_table
from friction_fmus.identification.data.mapping import (
    UNKNOWN,
    Column,
    DataMapping,
    combined_unit,
    gain_example,
    load_mapping,
    read_mapping,
    scale_text,
)
from friction_fmus.identification.data.motion_tests import MOST, DriveShare, SampledColumns
from friction_fmus.identification.data.other_records import other_record
from friction_fmus.identification.data.record import (
    ROLES,
    Array,
    Record,
    RecordFinding,
    RecordWarning,
    axis_units,
    factor,
    parse_quantity,
    unit_of,
    wanted_unit,
)
from friction_fmus.identification.data.sampling import SHORTEST, equally_spaced, in_order, without_held_samples
from friction_fmus.identification.data.tables import DataTable
from harness.units import BaseUnit

LOADS: Final = re.compile(r"(load|external|ext)([ _.-]?(force|torque|tau))?\b(?!.*%)", re.IGNORECASE)
"""Headings of what may be a known force on the axis."""

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
        subject = "current" if role == "force" and _is_current(column.unit) else role
        yield subject, "   ".join([f"{name}{unit}", *why])
    units = record.units
    for note in notes:
        yield "note", note
    used = {column.column for column in known.columns.values()}
    for name in order:
        if LOADS.match(name) and name in table.columns and name not in used and "load" not in known.columns:
            yield "note", f'{name!r} is not used; a known force on the axis, forward, needs --columns "load={name}"'
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


def _unit_text(column: Column, table: DataTable) -> str:
    scale = scale_text(column)
    if column.unit != "1" and column.gain not in ("", UNKNOWN):
        return f"{scale}, {column.gain}"
    return scale or ("" if column.gain else table.units.get(column.column, ""))


TRAIN: Final = 0.6  # fraction of a record that is fitted; the rest is validation data
FILTERED: Final = 150  # smallest number of samples of which the filter of a drive force leaves enough


def default_windows(records: Sequence[Record]) -> dict[str, tuple[float, float]]:
    """Return the windows of records for which none are given."""
    begin, end = float(records[0].t[0]), float(records[-1].t[-1])
    middle = begin + TRAIN * (end - begin)
    least = SHORTEST if records[0].force is None else FILTERED

    def enough(low: float, high: float) -> bool:
        return any(np.count_nonzero((r.t >= low) & (r.t <= high)) >= least for r in records)

    if not (enough(begin, middle) and enough(middle, end)):
        return {"train": (begin, end)}
    return {"train": (begin, middle), "validation": (middle, end)}


#: Largest plausible travel and speed of a machine, by unit of the position.
LARGEST_PLAUSIBLE = {"m": (100.0, 100.0), "rad": (1e6, 1e5)}

FACTOR = 3.0  # ratio of two columns above which one of their units counts as wrong


def plausible(records: Sequence[Record], columns: Mapping[str, Column]) -> Iterator[RecordFinding]:
    """Yield findings about units and signs of a measurement."""
    longest = max(records, key=len).with_total_force()
    yield from _velocity(longest)
    yield from _reference(longest)
    yield from _size(longest)
    yield from _sign(longest, columns)


def _velocity(record: Record) -> Iterator[RecordFinding]:
    if record.q is None or record.v is None:
        return
    travelled = cumulative_trapezoid(record.v, record.t, initial=0)
    a, b = _without_line(record.q, record.t), _without_line(travelled, record.t)
    if not (np.any(a) and np.any(b)):
        return
    ratio = float(a @ b) / float(b @ b)
    if 1.0 / FACTOR < ratio < FACTOR:
        return
    units = record.units
    what = (
        f"The position [{units.position}] changes by {ratio:.3g} times the integral of the velocity [{units.velocity}]."
    )
    yield RecordFinding(
        "position-and-velocity-disagree", what, "Correct the unit or the sign of one of the two columns."
    )


def _reference(record: Record) -> Iterator[RecordFinding]:
    if record.q is None or record.reference is None or not np.ptp(record.reference):
        return
    ratio = float(np.ptp(record.q) / np.ptp(record.reference))
    if 0.1 < ratio < 10.0:
        return
    what = f"The range of the position is {ratio:.3g} times the range of its reference."
    yield RecordFinding("position-and-reference-disagree", what, "Correct the unit of one of the two columns.")


def _size(record: Record) -> Iterator[RecordFinding]:
    distance, speed = LARGEST_PLAUSIBLE.get(record.units.position, (np.inf, np.inf))
    found = float(np.ptp(record.q)) if record.q is not None else 0.0
    v = record.v if record.v is not None else np.gradient(record.column("q"), record.Ts)
    fast = float(np.quantile(np.abs(v), 0.99))
    if found <= distance and fast <= speed:
        return
    what = (
        f"The axis moves by {found:.3g} {record.units.position} at up to {fast:.3g} {record.units.velocity}, which is "
        "implausible."
    )
    yield RecordFinding("implausible-motion", what, "Correct the unit of the position, of the velocity or of the time.")


def _sign(record: Record, columns: Mapping[str, Column]) -> Iterator[RecordFinding]:
    """Yield findings about signs: over whole cycles, the mean of drive or friction force times velocity is positive."""
    v = record.v if record.v is not None else np.gradient(record.column("q"), record.Ts)
    back, forth = np.quantile(v, (0.05, 0.95))
    both = back < 0.0 < forth  # in one direction, an offset such as gravity is not the mean
    for role, force in (("force", record.force if both else None), ("friction", record.friction)):
        if force is None:
            continue
        power = (force - (np.mean(force) if both else 0.0)) * v
        lost = float(np.mean(power))
        if lost < -0.2 * float(np.mean(np.abs(power))) < 0.0:
            heading = columns[role].column if role in columns else role
            what = (
                f"The sign of the {role} in column {heading!r} seems to be inverted: the contact would deliver power "
                f"({lost:.3g} W on average)."
            )
            other = -columns[role].sign if role in columns else -1
            yield RecordFinding(f"{role}-of-other-sign", what, f"Set sign = {other} for this column.")


def _without_line(values: Array, t: Array) -> Array:
    """Return values minus their linear trend, which a velocity offset causes."""
    return np.asarray(values - np.polynomial.Polynomial.fit(t, values, 1)(t), dtype=np.float64)


#: Largest value of a measurement in SI units, and one over the smallest, so that computations do not overflow.
LARGEST = 1e50

EPOCH = 1e8  # start of a time that is counted from the first sample on, because it is a date [s]


@dataclass(frozen=True, eq=False)
class Measurement:
    """Contents of a data file.

    Attributes
    ----------
    records : tuple of Record
        Segments between gaps; a single record if there are no gaps.
    mapping : DataMapping
        Mapping of the columns, as given or derived from the headings.
    findings : tuple of RecordFinding
        Problems found in the data; for the excitation, see `examine`.
    understood : tuple of (str, str)
        What was read and why, as subject and text.
    static : bool
        Whether the record shows friction over velocity only, so that models with state cannot be identified.
    """

    records: tuple[Record, ...]
    mapping: DataMapping
    findings: tuple[RecordFinding, ...]
    understood: tuple[tuple[str, str], ...] = ()
    static: bool = False

    def window(self, begin: float, end: float) -> tuple[Record, ...]:
        """Return the parts of the records with begin <= t <= end.

        Parameters
        ----------
        begin, end : float
            Start and end of the window [s].

        Returns
        -------
        tuple of Record
            Parts with at least `SHORTEST` samples.

        Raises
        ------
        RecordError
            If no segment has `SHORTEST` samples in the window.
        """
        least = min(SHORTEST, max(map(len, self.records)))
        inside = [r for r in self.records if np.count_nonzero((r.t >= begin) & (r.t <= end)) >= least]
        if not inside:
            raise RecordError(
                f"The window {begin:g} .. {end:g} s has fewer than {SHORTEST} samples of the record "
                f"{self.records[0].name!r}, which extends from {self.records[0].t[0]:g} to "
                f"{self.records[-1].t[-1]:g} s; choose another one."
            )
        # tolerance of a thousandth of a sample for times without exact binary representation
        return tuple(r.window(begin - 1e-3 * r.Ts, end + 1e-3 * r.Ts) for r in inside)


def read_records(
    path: str | Path, mapping: str | Path | Mapping[str, Any] | DataMapping | None = None
) -> tuple[Record, ...]:
    """Read the records of a data file.

    Parameters
    ----------
    path : path-like
        Data file in one of the `formats`, or mapping (.toml) that names one.
    mapping : path-like, mapping or DataMapping, optional
        Mapping of the columns: a TOML file, its tables, or the result of `read_mapping`. Without a mapping, the
        headings must identify the signals and contain units.

    Returns
    -------
    tuple of Record
        Segments between gaps, in SI units.

    Raises
    ------
    RecordError
        If a file or a column is missing or does not agree with the mapping, a unit is of the wrong quantity, or the
        time does not increase.

    Warns
    -----
    RecordWarning
        For each finding, such as ``gaps`` or ``irregular-sampling``; `read_measurement` returns the findings instead.
    """
    measurement = read_measurement(path, mapping)
    for finding in measurement.findings:
        warnings.warn(str(finding), RecordWarning, stacklevel=2)
    return measurement.records


def read_measurement(
    source: str | Path | DataMapping, mapping: str | Path | Mapping[str, Any] | DataMapping | None = None
) -> Measurement:
    """Read a data file with its mapping and findings.

    Parameters
    ----------
    source : path-like or DataMapping
        Data file, or mapping that names one, see `read_records`.
    mapping : path-like, mapping or DataMapping, optional
        Mapping of the columns, see `read_records`.

    Returns
    -------
    Measurement
        Records, mapping and findings.

    Raises
    ------
    RecordError
        As `read_records`.
    """
    known, path = _located(source, mapping)
    if known.more:
        return _read_runs(replace(known, file=path))
    table = with_actual_position(read_table(path))
    reasons: Mapping[str, str] = {}
    notes: tuple[str, ...] = ()
    if not known.columns:
        try:
            chosen, reasons, notes = chosen_columns(table, path, known.option, known.gain)
        except AmbiguousColumnsError as refusal:
            if known.option:
                raise
            return _other(table, replace(known, file=path, name=known.name or visible(path.stem)), refusal)
        known = replace(known, columns=chosen)
    known = replace(known, file=path, name=known.name or " ".join(visible(path.stem).split()))
    findings = list(table.findings)
    columns, units = _converted(table, known, path, findings)
    t, columns = _complete(table, columns, findings, path)
    t, columns = in_order(table, t, columns, findings)
    if t[0] > EPOCH:
        shift = float(t[0])
        t = t - shift
        windows = {w: (a - shift, b - shift) if a > EPOCH else (a, b) for w, (a, b) in known.windows.items()}
        known = replace(known, windows=windows)
        what = f"The time starts at {shift:.0f} s."
        findings.append(RecordFinding("absolute-time", what, "It is counted from the first sample on."))
    quantum = _quantum(columns["q"]) if "q" in columns else 0.0
    held = "force" in known.columns and known.columns["force"].held
    segments, about_time = equally_spaced(t, columns, units.words)
    segments, about_position = without_held_samples(segments)
    findings += about_time + about_position
    if "q" in columns and any(finding.name == "irregular-sampling" for finding in about_time):
        findings += position_jumps(columns["q"], t, quantum, units.words.m)  # which the resampling spreads
    if not segments:
        raise RecordError(f"{path} has no {SHORTEST} samples without a gap; log longer without interruption.")
    names = [known.name] if len(segments) == 1 else [f"{known.name}, segment {i + 1}" for i in range(len(segments))]
    about = {"units": units, "citation": known.citation, "quantum": quantum, "held": held}
    records = tuple(
        Record(name, each.t, **about, **each.columns)  # type: ignore[arg-type]
        for name, each in zip(names, segments, strict=True)
    )
    findings += plausible(records, known.columns)
    lines = tuple(understood(table, known, records, reasons, notes))
    return Measurement(records, known, tuple(findings), lines)


def _other(table: DataTable, known: DataMapping, refusal: AmbiguousColumnsError) -> Measurement:
    """Return a record without a drive force over time."""
    found = other_record(table, known, refusal)
    lines = (("read", f"{table.file.name}: {table.format}"), *found.lines)
    read = Measurement((found.record,), replace(known, columns=found.columns), table.findings, lines, static=True)
    # a part of the speeds would predict others
    windows = {"train": (0.0, float(len(found.record)))} if found.record.steady and not known.windows else known.windows
    return replace(read, mapping=replace(read.mapping, windows=windows))


def _read_runs(known: DataMapping) -> Measurement:
    """Return several files with the same columns as one measurement; the last files are validation data."""
    assert known.file is not None
    first = read_measurement(replace(known, more=()))
    columns = replace(known, columns=first.mapping.columns, option="", gain="", more=(), name="")
    runs = [first, *(read_measurement(replace(columns, file=file)) for file in known.more)]
    if any(run.records[0].units != first.records[0].units for run in runs):
        raise RecordError(f"{known.file} and the other files have different units; give files of one axis.")
    records: list[Record] = []
    ends = []
    for run in runs:
        shift = (records[-1].t[-1] + 1.0 if records else run.records[0].t[0]) - run.records[0].t[0]
        records += [replace(record, t=record.t + shift) for record in run.records]
        ends.append((float(records[-len(run.records)].t[0]), float(records[-1].t[-1])))
    fitted = min(max(1, round(TRAIN * len(runs))), len(runs) - 1)
    windows = {"train": (ends[0][0], ends[fitted - 1][1]), "validation": (ends[fitted][0], ends[-1][1])}
    findings = {finding: None for run in runs for finding in run.findings}
    files = ", ".join(file.name for file in (known.file, *known.more))
    lines = [("files", f"{files}; validation with the last {len(runs) - fitted}"), *first.understood]
    mapping = replace(first.mapping, windows=known.windows or windows, more=known.more, name=known.name or files)
    return Measurement(tuple(records), mapping, tuple(findings), tuple(lines))


def _located(
    source: str | Path | DataMapping, mapping: str | Path | Mapping[str, Any] | DataMapping | None
) -> tuple[DataMapping, Path]:
    """Return mapping and path of the data file for the arguments of a user."""
    if isinstance(source, DataMapping) or Path(source).suffix.lower() == ".toml":
        if mapping is not None:
            raise RecordError(f"{source} is itself a mapping; omit the second mapping, or give a data file first.")
        known = source if isinstance(source, DataMapping) else load_mapping(Path(source))
        if known.file is None:
            raise RecordError(f'{source} names no data file; add file = "..." to its table [data].')
        return known, known.file
    path = Path(source)
    if mapping is None:
        return DataMapping(path), path
    if isinstance(mapping, DataMapping):
        return replace(mapping, file=path), path
    if isinstance(mapping, Mapping):
        return read_mapping(mapping, path.parent), path
    return load_mapping(Path(mapping)), path


def _converted(
    table: DataTable, known: DataMapping, path: Path, findings: list[RecordFinding]
) -> tuple[dict[str, Array], AxisUnits]:
    """Return the columns converted to the units of the record, with all rows of the file."""
    scales: dict[str, tuple[float, BaseUnit]] = {}
    own: dict[str, str] = {}
    si: AxisUnits | None = None
    for role, column in known.columns.items():
        where = f"{path}, column {column.column!r} for the {role},"
        if column.period:
            continue
        if column.column in table.texts:
            raise RecordError(f"{where} is not numeric: it contains {table.texts[column.column]}; correct the file.")
        if column.column not in table.columns:
            there = ", ".join(repr(name) for name in (*table.columns, *table.texts)) or "none"
            raise RecordError(f"{path} has no column {column.column!r} for the {role}; it has {there}.")
        if column.gain == UNKNOWN:
            own[role] = column.unit or table.units.get(column.column, "") or "1"
            continue
        scales[role] = combined_unit(role, column, where, table.units.get(column.column, ""))
        si = si or axis_units(role, scales[role][1])
    units = si or LINEAR
    if own:
        units = _channel_units(own, si, scales, path)
    columns = {}
    for role, column in known.columns.items():
        if role in own:
            columns[ROLES[role].field] = column.sign * table.columns[column.column]
        if role not in scales:
            continue
        gain, unit = scales[role]
        scale = factor(role, unit, si or (ROTARY if units.force == ROTARY.force else LINEAR))
        if scale is None:
            raise RecordError(
                f"{path}, column {column.column!r} for the {role}, has a unit that is not valid for an axis with the "
                f"position in {units.position}; use a unit such as {wanted_unit(role, si or LINEAR)}, or correct the "
                "position."
            )
        columns[ROLES[role].field] = column.sign * gain * scale * table.columns[column.column]
    for column in known.columns.values():
        findings += [note for name, note in table.notes.items() if name == column.column]
    period = known.columns["time"].period
    if period:
        seconds, unit = parse_quantity(period, "The period")
        columns["t"] = seconds * unit.factor * np.arange(len(next(iter(columns.values()))), dtype=np.float64)
    return columns, units


def _channel_units(
    own: Mapping[str, str], si: AxisUnits | None, scales: Mapping[str, tuple[float, BaseUnit]], path: Path
) -> AxisUnits:
    """Return the units of an axis with channels that keep their own units."""
    ways = {role: unit for role, unit in own.items() if ROLES[role].quantity in ("position", "velocity")}
    if ways and (si is not None or len(set(ways.values())) > 1 or ways.keys() > {"velocity"}):
        raise RecordError(
            f"{path}: the {' and the '.join(ways)} have no scale, but another column of the motion has a different "
            "unit; give both in one unit, or leave one of them out."
        )
    if "velocity" in ways:
        unit = ways["velocity"]
        position = unit.removesuffix("/s") if unit.endswith("/s") else f"{unit if unit != '1' else 'u'}.s"
    else:
        position = next(iter(ways.values()), (si or LINEAR).position)
    turning = position == "rad" or (
        si is None
        and any(role in scales and factor(role, scales[role][1], LINEAR) is None for role in ("force", "friction"))
    )
    force = own.get("force", own.get("friction", (ROTARY if turning else LINEAR).force))
    return units_of_channels(position, force)


def _complete(
    table: DataTable, columns: dict[str, Array], findings: list[RecordFinding], path: Path
) -> tuple[Array, dict[str, Array]]:
    """Return the rows without missing values."""
    good = np.all([np.isfinite(values) for values in columns.values()], axis=0)
    if not good.all():
        counts = {name: int(np.count_nonzero(~np.isfinite(values))) for name, values in columns.items()}
        worst = max(counts, key=lambda name: counts[name])
        if np.count_nonzero(good) < SHORTEST:
            raise RecordError(
                f"{path} has only {np.count_nonzero(good)} rows without missing values; most are missing for "
                f"{worst!r} ({counts[worst]} of {len(good)}); map another column or correct the file."
            )
        what = (
            f"{np.count_nonzero(~good)} of {len(good)} rows have empty, NaN or infinite cells, the first one in "
            f"{table.place(int(np.argmin(good)))}; these rows are ignored."
        )
        findings.append(RecordFinding("missing-samples", what, "Log all columns at the same times."))
    kept = {name: values[good] for name, values in columns.items()}
    for name, values in kept.items():
        largest = float(np.max(np.abs(values), initial=0.0))
        if largest > LARGEST or 0.0 < largest < 1.0 / LARGEST:
            raise RecordError(
                f"{path} has values up to {largest:.3g} in SI units for {name!r}, which is implausible; correct the "
                "unit or the file."
            )
    kept["row"] = np.flatnonzero(good).astype(np.float64)
    return kept.pop("t"), kept


def _quantum(q: Array) -> float:
    """Return the resolution of a position if all its values are on a grid; otherwise 0."""
    levels = np.unique(q)
    gaps = np.diff(levels)
    span = levels[-1] - levels[0]
    gaps = gaps[gaps > 1e-12 * max(span, float(np.abs(levels[[0, -1]]).max()))]
    if gaps.size < 2:
        return 0.0
    smallest = float(gaps.min())
    near = gaps[gaps < 100.0 * smallest] / smallest
    on_grid = np.all(np.abs(near - np.round(near)) < 0.05)
    return float(np.mean(gaps[gaps < 1.5 * smallest])) if on_grid and near.size > 0.5 * gaps.size else 0.0
