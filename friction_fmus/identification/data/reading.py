"""Records out of data files."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from friction_fmus.identification.data.findings import Finding, RecordWarning
from friction_fmus.identification.data.guessing import guess_mapping
from friction_fmus.identification.data.mapping import Column, DataMapping, combined_unit, load_mapping, read_mapping
from friction_fmus.identification.data.plausibility import plausible
from friction_fmus.identification.data.quantities import axis_units, factor, parse_quantity, wanted_unit
from friction_fmus.identification.data.record import LINEAR, Array, AxisUnits, Record
from friction_fmus.identification.data.sampling import SHORTEST, equally_spaced
from friction_fmus.identification.data.table_files import read_table
from friction_fmus.identification.data.tables import Table
from friction_fmus.identification.errors import RecordError

#: Role in a mapping -> column of a record.
FIELD = {
    "time": "t",
    "position": "q",
    "velocity": "v",
    "reference": "reference",
    "force": "force",
    "friction": "friction",
    "normal": "normal",
}

#: Largest value of a measurement in SI units, and one over the smallest: what is computed from them stays a number.
LARGEST = 1e50


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a data file and its mapping say.

    Attributes
    ----------
    records : tuple of Record
        The pieces between gaps; one if there are none.
    mapping : DataMapping
        What the columns are, as it was given or guessed.
    findings : tuple of Finding
        What should be known about the data, apart from the excitation (see `examine`).
    """

    records: tuple[Record, ...]
    mapping: DataMapping
    findings: tuple[Finding, ...]

    def window(self, begin: float, end: float) -> tuple[Record, ...]:
        """The parts of the records with begin <= t <= end [s].

        Raises
        ------
        RecordError
            No piece has `SHORTEST` samples there.
        """
        inside = [r for r in self.records if np.count_nonzero((r.t >= begin) & (r.t <= end)) >= SHORTEST]
        if not inside:
            raise RecordError(
                f"The window {begin:g} .. {end:g} s has fewer than {SHORTEST} samples of the record "
                f"{self.records[0].name!r}, which lasts from {self.records[0].t[0]:g} to "
                f"{self.records[-1].t[-1]:g} s; choose another one."
            )
        # a thousandth of a sample for times that are not exact in binary
        return tuple(r.window(begin - 1e-3 * r.Ts, end + 1e-3 * r.Ts) for r in inside)


def read_records(
    path: str | Path, mapping: str | Path | Mapping[str, Any] | DataMapping | None = None
) -> tuple[Record, ...]:
    """Read the records of a data file.

    Parameters
    ----------
    path : path-like
        A data file (.csv, .tsv, .txt, .dat, .parquet, .mat), or a mapping (.toml) that names one.
    mapping : path-like, mapping or DataMapping, optional
        What the columns of a data file are: a TOML file, its tables, or what `read_mapping` made of them. Without it
        headings with units must tell.

    Returns
    -------
    tuple of Record
        The pieces between gaps, in SI units.

    Raises
    ------
    RecordError
        A file or a column is missing or not as the mapping says, a unit is of another quantity, the time does not
        increase.

    Warns
    -----
    RecordWarning
        For each finding, such as ``gaps`` or ``irregular-sampling``; `read_measurement` returns them instead.
    """
    measurement = read_measurement(path, mapping)
    for finding in measurement.findings:
        warnings.warn(str(finding), RecordWarning, stacklevel=2)
    return measurement.records


def read_measurement(
    source: str | Path | DataMapping, mapping: str | Path | Mapping[str, Any] | DataMapping | None = None
) -> Measurement:
    """Read a data file: its records, its mapping and what was found.

    Parameters and errors are those of `read_records`; `source` may also be a mapping that names its data file.

    Returns
    -------
    Measurement
    """
    known, path = _located(source, mapping)
    table = read_table(path)
    if not known.columns:
        known = replace(guess_mapping(table, path), name=known.name, citation=known.citation, windows=known.windows)
    known = replace(known, file=path, name=known.name or path.stem)
    columns, units = _converted(table, known, path)
    findings = list(table.findings)
    t, columns = _complete(table, columns, findings, path)
    _check_time(table, t, columns.pop("row"), known.columns["time"], path)
    quantum = _quantum(columns["q"]) if "q" in columns else 0.0
    pieces, about_time = equally_spaced(t, columns)
    findings += about_time
    if not pieces:
        raise RecordError(f"{path} has no {SHORTEST} samples without a gap; log longer pieces.")
    names = [known.name] if len(pieces) == 1 else [f"{known.name}, piece {i + 1}" for i in range(len(pieces))]
    records = tuple(
        Record(name, piece.t, units=units, citation=known.citation, quantum=quantum, **piece.columns)
        for name, piece in zip(names, pieces, strict=True)
    )
    findings += plausible(records, known.columns)
    return Measurement(records, known, tuple(findings))


def _located(
    source: str | Path | DataMapping, mapping: str | Path | Mapping[str, Any] | DataMapping | None
) -> tuple[DataMapping, Path]:
    """The mapping and the data file that a user's arguments stand for."""
    if isinstance(source, DataMapping) or Path(source).suffix.lower() == ".toml":
        if mapping is not None:
            raise RecordError(f"{source} is a mapping itself; give it alone, or give a data file with a mapping.")
        known = source if isinstance(source, DataMapping) else load_mapping(Path(source))
        if known.file is None:
            raise RecordError(f'{source} names no data file; add file = "..." to its table [data].')
        return known, known.file
    path = Path(source)
    if mapping is None:
        return DataMapping(path), path
    if isinstance(mapping, DataMapping):
        return mapping, path
    if isinstance(mapping, Mapping):
        return read_mapping(mapping, path.parent), path
    return load_mapping(Path(mapping)), path


def _converted(table: Table, known: DataMapping, path: Path) -> tuple[dict[str, Array], AxisUnits]:
    """The columns of the record in its units, rows as in the file."""
    units: AxisUnits | None = None
    scales = {}
    for role, column in known.columns.items():
        where = f"{path}, column {column.column!r} for the {role},"
        if column.period:
            continue
        if column.column in table.texts:
            raise RecordError(f"{where} is not made of numbers: it has {table.texts[column.column]}; repair the file.")
        if column.column not in table.columns:
            there = ", ".join(repr(name) for name in (*table.columns, *table.texts)) or "none"
            raise RecordError(f"{path} has no column {column.column!r} for the {role}; it has {there}.")
        scales[role] = combined_unit(role, column, where, table.units.get(column.column, ""))
        units = units or axis_units(role, scales[role][1])
    units = units or LINEAR
    columns = {}
    for role, (gain, unit) in scales.items():
        column = known.columns[role]
        scale = factor(role, unit, units)
        if scale is None:
            raise RecordError(
                f"{path}, column {column.column!r} for the {role}, has a unit that does not go with an axis in "
                f"{units.position}, which wants one like {wanted_unit(role, units)}; correct one of the units."
            )
        columns[FIELD[role]] = column.sign * gain * scale * table.columns[column.column]
    period = known.columns["time"].period
    if period:
        seconds, unit = parse_quantity(period, "The period")
        columns["t"] = seconds * unit.factor * np.arange(len(next(iter(columns.values()))), dtype=np.float64)
    return columns, units


def _complete(
    table: Table, columns: dict[str, Array], findings: list[Finding], path: Path
) -> tuple[Array, dict[str, Array]]:
    """The rows in which every column has a number; the others are missing samples."""
    good = np.all([np.isfinite(values) for values in columns.values()], axis=0)
    if not good.all():
        counts = {name: int(np.count_nonzero(~np.isfinite(values))) for name, values in columns.items()}
        worst = max(counts, key=lambda name: counts[name])
        if np.count_nonzero(good) < SHORTEST:
            raise RecordError(
                f"{path} has {np.count_nonzero(good)} rows in which all needed columns have numbers; most are "
                f"missing for {worst!r} ({counts[worst]} of {len(good)}); map another column or repair the file."
            )
        what = (
            f"{np.count_nonzero(~good)} of {len(good)} rows have empty, NaN or infinite cells, the first one in "
            f"{table.place(int(np.argmin(good)))}; they were left out."
        )
        findings.append(Finding("missing-samples", what, "Log all columns at the same instants."))
    kept = {name: values[good] for name, values in columns.items()}
    for name, values in kept.items():
        largest = float(np.max(np.abs(values), initial=0.0))
        if largest > LARGEST or 0.0 < largest < 1.0 / LARGEST:
            raise RecordError(
                f"{path} has values up to {largest:.3g} in SI units for {name!r}, which no machine has; "
                "correct the unit or the file."
            )
    kept["row"] = np.flatnonzero(good).astype(np.float64)
    return kept.pop("t"), kept


def _check_time(table: Table, t: Array, rows: Array, column: Column, path: Path) -> None:
    if len(t) < SHORTEST:
        raise RecordError(f"{path} has {len(t)} samples; an identification needs at least {SHORTEST}.")
    wrong = np.flatnonzero(np.diff(t) <= 0.0)
    if not wrong.size:
        return
    at = int(wrong[0]) + 1
    place = table.place(int(rows[at]))
    if t[at] == t[at - 1]:
        raise RecordError(
            f"{path} has the time {t[at]:.9g} s twice, the second time in {place} ({_times(wrong.size)}); remove "
            f'doubled rows, log the time with more digits, or give time = {{ period = "..." }}.'
        )
    raise RecordError(
        f"The time in {path} goes back from {t[at - 1]:.9g} s to {t[at]:.9g} s in {place} ({_times(wrong.size)}); "
        "sort the rows, or cut the file there if the log was started again."
    )


def _times(count: int) -> str:
    return "one such place" if count == 1 else f"{count} such places"


def _quantum(q: Array) -> float:
    """Grid of a position, if all its values lie on one; else 0."""
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
