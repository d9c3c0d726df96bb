"""Mapping from the columns of a data file to signals, read from TOML."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from friction_fmus.blocks.axis_units import ROTARY, AxisUnits
from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import (
    PER_MILLE,
    ROLES,
    axis_units,
    factor,
    fits,
    parse_quantity,
    times,
    unit_of,
    wanted_unit,
)
from harness.storage.toml_file import TomlTable, read_table
from harness.units import BaseUnit
from harness.values import flag, number, shown, text

WINDOWS = ("train", "validation")

STUDY_TABLES = ("servo", "axis", "identify", "compensation")
"""Tables of the settings of a study, which `load_mapping` ignores, so that one file serves both."""

UNKNOWN = "unknown"  # gain of a position, velocity or force whose results are wanted in the unit of the column

MISSING = "?"  # mark of a missing entry in a file that was written for completion


@dataclass(frozen=True)
class Column:
    """Column of a data file."""

    column: str  # heading; empty if the file has no column for the time
    unit: str = ""  # unit of the numbers; empty for the unit in the heading
    gain: str = ""  # factor with unit, such as ``35.15 N/V``; `UNKNOWN` for results in the unit; empty for none
    sign: int = 1  # 1, or -1 to invert the sign
    period: str = ""  # sample time, such as ``1 ms``, if the file has no column for the time
    held: bool = False  # whether the force is a command that the drive holds until the next sample


def scale_text(column: Column) -> str:
    """Return unit or scale of a column as in the option ``--columns``, such as ``1/4096 rev``; empty for none."""
    if column.unit not in ("", "1") or not column.gain or column.gain == UNKNOWN:
        return "" if column.unit == "1" else column.unit
    number, _, unit = column.gain.partition(" ")
    parts = 1.0 / float(number)
    return f"1/{parts:.0f} {unit}" if parts > 1.5 and abs(parts - round(parts)) < 1e-9 * parts else column.gain


@dataclass(frozen=True)
class DataMapping:
    """Data file, mapping of its columns, and windows.

    Attributes
    ----------
    file : Path or None
        Path of the data file.
    name, citation : str
        Name of the record, and citation of the data.
    columns : mapping of str to Column
        Columns by role: time, position, velocity, reference, force, friction, normal, injected, load, temperature.
    windows : mapping of str to (float, float)
        Start and end of the windows ``train`` and ``validation``, in the time of the file [s].
    option : str
        Columns as in the option ``--columns``, if `columns` is empty.
    gain : str
        Factor of the drive signal as in the option ``--gain``, if `columns` is empty.
    more : tuple of Path
        Further files with the same columns.
    """

    file: Path | None
    name: str = ""
    citation: str = ""
    columns: Mapping[str, Column] = field(default_factory=dict)
    windows: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    option: str = ""
    gain: str = ""
    more: tuple[Path, ...] = ()


def load_mapping(path: Path) -> DataMapping:
    """Read a mapping from a TOML file."""
    table = read_table(path, RecordError).content
    data = table.get("data")
    if isinstance(data, Mapping) and "record" in data:
        raise RecordError(
            f"{path}, [data], names the record {shown(data['record'])} of the package, which only a study reads; name "
            'a data file as file = "...".'
        )
    about_data = {name: value for name, value in table.items() if name not in STUDY_TABLES}
    return read_mapping(about_data, path.parent, str(path))


def read_mapping(table: Mapping[str, Any], folder: Path, origin: str = "The mapping") -> DataMapping:
    """Read a mapping from the tables ``[data]``, ``[columns]`` and ``[windows]``."""
    TomlTable(table, origin, RecordError).known(("data", "columns", "windows"), "table")
    about, headings, times = (
        TomlTable(table.get(name, {}), f"{origin}, [{name}],", RecordError) for name in ("data", "columns", "windows")
    )
    about.known(("file", "name", "citation"))
    data = {key: about.take(key, _line, "a string without control characters") for key in about if key != "file"}
    remedy = "a string without control characters, or a list of them"
    files = [folder / name for name in about.take("file", _files, remedy)] if "file" in about.content else []
    headings.known(tuple(ROLES), "role")
    columns = {role: _column(role, value, origin) for role, value in headings.content.items()}
    if columns:
        if "time" not in columns:
            raise RecordError(f'{origin} has no time in [columns]; add time = {{ column = ..., unit = "s" }}.')
        if not columns.keys() & {"position", "velocity"}:
            raise RecordError(f"{origin} has neither position nor velocity in [columns]; add one of them.")
    windows = read_windows(times.content, times.where)
    file = files[0] if files else None
    return DataMapping(file, data.get("name", ""), data.get("citation", ""), columns, windows, more=tuple(files[1:]))


def read_windows(table: Mapping[str, Any], where: str) -> dict[str, tuple[float, float]]:
    """Read the windows of a record."""
    given = TomlTable(table, where, RecordError)
    given.known(WINDOWS, "window")
    windows = {name: given.take(name, _pair, "start and end in s, the earlier one first") for name in given}
    if set(windows) == {"validation"}:
        raise RecordError(f"{where} has only a window for validation; add one for train.")
    if len(windows) == 2:
        (begin, end), (other_begin, other_end) = windows.values()
        if begin < other_end and other_begin < end:
            raise RecordError(f"{where} has overlapping windows; separate them, validation data must not be fitted.")
    return windows


def _pair(value: object) -> tuple[float, float] | None:
    """Return two increasing times."""
    pair = [number(each) for each in value] if isinstance(value, (list, tuple)) else []
    match pair:
        case [float(first), float(last)] if first < last:
            return first, last
    return None


def _files(value: object) -> tuple[str, ...] | None:
    """Return the names of one or several files."""
    names = [text(each) for each in (value if isinstance(value, list) else [value])]
    known = [name for name in names if name is not None]
    return tuple(known) if known and len(known) == len(names) else None


def _string(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _line(value: object) -> str | None:
    """Return a text on one line."""
    return text(" ".join(value.split())) if isinstance(value, str) else None


def _gain(value: object) -> str | None:
    return str(value) if isinstance(value, str) or number(value) is not None else None


def _column(role: str, value: Any, origin: str) -> Column:
    """Read an entry of ``[columns]``: a heading, or a table with column, unit, gain and sign."""
    where = f"{origin}, [columns], {role},"
    if isinstance(value, str):
        return Column(value)
    if not isinstance(value, Mapping):
        raise RecordError(f'{where} is {shown(value)}; use {{ column = "heading", unit = "..." }}.')
    table = TomlTable(value, where, RecordError)
    own = {"time": ("period",), "force": ("held",)}.get(role, ())
    table.known(("column", "unit", "gain", "sign", *own))
    if ("column" in value) == ("period" in value):
        choice = "either column or period" if role == "time" else "column"
        raise RecordError(f'{where} needs {choice}; use {{ column = "heading", unit = "..." }}.')
    found = Column(
        table.take("column", _string, "a string", ""),
        table.take("unit", text, "a string", ""),
        table.take("gain", _gain, "a number with a unit, such as '35.15 N/V'", ""),
        table.take("sign", lambda sign: int(found) if (found := number(sign)) in (1.0, -1.0) else None, "1 or -1", 1),
        table.take("period", text, "a string", ""),
        table.take("held", flag, "true or false", False),
    )
    if MISSING in (found.column, found.unit, found.gain):
        raise RecordError(f"{where} has a {MISSING} for a missing entry; replace it.")
    _check_units(role, found, where)
    return found


def _check_units(role: str, column: Column, where: str) -> None:
    """Reject units of the wrong quantity before any data are read."""
    if column.period:
        seconds, unit = parse_quantity(column.period, f"{where} period", "1 ms")
        if not fits("time", unit) or seconds <= 0.0:
            raise RecordError(f"{where} has the period {column.period!r}; use a positive time, such as '1 ms'.")
    if column.unit and column.gain != UNKNOWN:
        combined_unit(role, column, where)
    if column.gain == UNKNOWN and ROLES[role].quantity not in ("position", "velocity", "force"):
        raise RecordError(f"{where} has an unknown gain; give its unit.")


def axis_of(columns: Mapping[str, Column]) -> AxisUnits:
    """Return the units of the axis of a position or velocity; those of a rotary axis if its unit has no value."""
    role = "position" if "position" in columns else "velocity"
    unit, gain = unit_of(columns[role].unit) or BaseUnit(), columns[role].gain
    unit = unit if gain in ("", UNKNOWN) else times(unit, parse_quantity(gain, f"The gain of the {role}")[1])
    return axis_units(role, unit) or ROTARY


def gain_example(unit: str, axis: AxisUnits) -> str:
    """Return a gain of a drive signal in this unit, in the form of the option ``--gain``."""
    known, force = unit_of(unit) if unit else None, wanted_unit("force", axis)
    for base in ("A", "V"):
        if known is not None and (own := unit_of(base)) is not None and known.exponents == own.exponents:
            return f"0.5 {force}/{base}"
    return f"6 {force}" if unit in ("%", *PER_MILLE) else f"0.06 {force}"


def with_gain(column: Column, gain: str, axis: AxisUnits) -> Column:
    """Return a drive signal with the factor of the option ``--gain``, which leads to the force of this axis."""
    form = gain_example(column.unit, axis)
    _, per = parse_quantity(gain, "--gain", form)
    own = unit_of(column.unit or "1")
    if factor("force", times(own or BaseUnit(), per), axis) is None:
        raise RecordError(
            f"--gain {gain!r} times the unit {column.unit or '1'!r} of {column.column!r} is not in "
            f"{wanted_unit('force', axis)}; use the form {form!r}."
        )
    return replace(column, unit="1" if own is None else column.unit, gain=gain)


def combined_unit(role: str, column: Column, where: str, unit: str = "") -> tuple[float, Any]:
    """Return factor and unit of one unit of the column, including its gain."""
    text = column.unit or unit
    known = unit_of(text)
    if known is None:
        raise RecordError(
            f'{where} has no unit; add unit = "...".'
            if not text
            else f"{where} has the unknown unit {text!r}; use a unit such as mm, N.m, rad/s."
        )
    gain = 1.0
    total = known
    if column.gain:
        gain, per = parse_quantity(column.gain, f"{where} gain")
        total = times(known, per)
    if not fits(role, total):
        product = f"{text} times the gain {column.gain}" if column.gain else f"the unit {text!r}"
        hint = f', or add a gain with units, such as gain = "2.5 {ROLES[role].example}/{text}"'
        hint = "" if column.gain else f'{hint}, or gain = "{UNKNOWN}" for results in {text}'
        raise RecordError(
            f"{where} has {product}, which has the wrong dimension; use a unit such as {ROLES[role].example}{hint}."
        )
    return gain, total
