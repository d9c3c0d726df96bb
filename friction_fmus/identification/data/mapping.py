"""What the columns of a data file are: read from TOML, or guessed from headings that leave no choice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from friction_fmus.identification.data.quantities import QUANTITY, fits, parse_quantity, times, unit_of
from friction_fmus.identification.errors import RecordError
from harness.storage.files import reason
from harness.storage.toml_file import read_toml
from harness.values import is_line, number, shown

ROLES = tuple(QUANTITY)
WINDOWS = ("train", "validation")


@dataclass(frozen=True)
class Column:
    """One column of the data file.

    Attributes
    ----------
    column : str
        Its heading; empty for a time that is not in the file.
    unit : str
        Unit of its numbers; empty: the one in the heading.
    gain : str
        What one such unit is, as number and unit: the force ``35.15 N/V`` of a command in V; empty: none.
    sign : int
        1, or -1 for a column of the other sign.
    period : str
        For the time alone: the sampling interval, such as ``1 ms``, if the file has no column for it.
    """

    column: str
    unit: str = ""
    gain: str = ""
    sign: int = 1
    period: str = ""


@dataclass(frozen=True)
class DataMapping:
    """Data file, meaning of its columns, and which part of it is for what.

    Attributes
    ----------
    file : Path or None
        The data file.
    name, citation : str
        What the record is called, and whom to cite for it.
    columns : mapping of str to Column
        By role: time, position, velocity, reference, force, friction, normal.
    windows : mapping of str to (float, float)
        Begin and end [s] of ``train`` and ``validation``, in the time of the file.
    """

    file: Path | None
    name: str = ""
    citation: str = ""
    columns: Mapping[str, Column] = field(default_factory=dict)
    windows: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def load_mapping(path: Path) -> DataMapping:
    """Read a mapping from a TOML file; its data file is looked for beside it.

    Raises
    ------
    RecordError
        The file is missing, is no TOML, or does not say what a mapping says.
    """
    try:
        table = read_toml(path)
    except FileNotFoundError as error:
        raise RecordError(f"There is no file {path}; give the path of a data file or of its mapping.") from error
    except (OSError, ValueError) as error:
        raise RecordError(f"{path} cannot be read as TOML ({reason(error)}); repair it.") from error
    return read_mapping(table, path.parent, str(path))


def read_mapping(table: Mapping[str, Any], folder: Path, origin: str = "The mapping") -> DataMapping:
    """Read the tables ``[data]``, ``[columns]`` and ``[windows]``.

    Parameters
    ----------
    table : mapping
        These tables, and no other ones.
    folder : Path
        Where a relative path of the data file begins.
    origin : str
        What is being read, for error messages.

    Returns
    -------
    DataMapping

    Raises
    ------
    RecordError
        Something is unknown, missing or of the wrong kind.
    """
    _known(table, ("data", "columns", "windows"), origin, "table")
    data = _table(table, "data", origin)
    _known(data, ("file", "name", "citation"), f"{origin}, [data],", "key")
    for key, value in data.items():
        if not isinstance(value, str) or (key == "file" and not is_line(value)):
            raise RecordError(f"{origin}, [data], has {key} = {shown(value)}; give a text.")
    columns = {role: _column(role, value, origin) for role, value in _table(table, "columns", origin).items()}
    if columns:
        if "time" not in columns:
            raise RecordError(f'{origin} has no time in [columns]; add time = {{ column = ..., unit = "s" }}.')
        if not columns.keys() & {"position", "velocity"}:
            raise RecordError(f"{origin} has neither position nor velocity in [columns]; add one of them.")
    windows = read_windows(_table(table, "windows", origin), f"{origin}, [windows],")
    file = folder / data["file"] if "file" in data else None
    return DataMapping(file, data.get("name", ""), data.get("citation", ""), columns, windows)


def read_windows(table: Mapping[str, Any], where: str) -> dict[str, tuple[float, float]]:
    """Begin and end of the windows of a record.

    Raises
    ------
    RecordError
        They are no pairs of times, overlap, or there is one for validation only; `where` begins the sentence.
    """
    _known(table, WINDOWS, where, "window")
    windows = {}
    for name, pair in table.items():
        times = [float(t) for t in pair if type(t) in (int, float)] if isinstance(pair, (list, tuple)) else []
        if len(times) != 2 or len(pair) != 2 or not times[0] < times[1]:
            raise RecordError(f"{where} has {name} = {shown(pair)}; give begin and end in s, the earlier one first.")
        windows[name] = (times[0], times[1])
    if set(windows) == {"validation"}:
        raise RecordError(f"{where} has a window for validation only; give one for train, too.")
    if len(windows) == 2:
        (begin, end), (other_begin, other_end) = windows.values()
        if begin < other_end and other_begin < end:
            raise RecordError(f"{where} has windows that overlap; a validation needs samples that were not fitted.")
    return windows


def _known(table: Mapping[str, Any], names: tuple[str, ...], origin: str, noun: str) -> None:
    unknown = [name for name in table if name not in names]
    if unknown:
        raise RecordError(f"{origin} has the unknown {noun} {shown(unknown[0])}; known are {', '.join(names)}.")


def _table(table: Mapping[str, Any], name: str, origin: str) -> Mapping[str, Any]:
    value = table.get(name, {})
    if not isinstance(value, Mapping):
        raise RecordError(f"{origin} has {name} = {shown(value)}; make it a table [{name}].")
    return value


def _column(role: str, value: Any, origin: str) -> Column:
    """One entry of ``[columns]``: a heading, or a table with column, unit, gain and sign."""
    where = f"{origin}, [columns], {role},"
    if role not in ROLES:
        raise RecordError(f"{origin} has the unknown role {shown(role)} in [columns]; known are {', '.join(ROLES)}.")
    if isinstance(value, str):
        return Column(value)
    if not isinstance(value, Mapping):
        raise RecordError(f'{where} is {shown(value)}; write {{ column = "heading", unit = "..." }}.')
    keys = ("column", "unit", "gain", "sign", *(("period",) if role == "time" else ()))
    _known(value, keys, where, "key")
    if ("column" in value) == ("period" in value):
        choice = "either column or period" if role == "time" else "column"
        raise RecordError(f'{where} needs {choice}; write {{ column = "heading", unit = "..." }}.')
    for key in ("column", "unit", "period"):
        if key in value and (not isinstance(value[key], str) or (key != "column" and not is_line(value[key]))):
            raise RecordError(f"{where} has {key} = {shown(value[key])}; give a text.")
    sign = value.get("sign", 1)
    if isinstance(sign, bool) or sign not in (1, -1):
        raise RecordError(f"{where} has sign = {shown(sign)}; give 1 or -1.")
    if not isinstance(gain := value.get("gain", ""), str) and number(gain) is None:
        raise RecordError(f"{where} has gain = {shown(gain)}; give a number with its unit, such as '35.15 N/V'.")
    found = Column(value.get("column", ""), value.get("unit", ""), str(gain), int(sign), value.get("period", ""))
    _check_units(role, found, where)
    return found


def _check_units(role: str, column: Column, where: str) -> None:
    """Refuse units that are not of the quantity, before any data are read."""
    if column.period:
        seconds, unit = parse_quantity(column.period, f"{where} period")
        if not fits("time", unit) or seconds <= 0.0:
            raise RecordError(f"{where} has the period {column.period!r}; give a positive time, such as '1 ms'.")
    if column.unit:
        combined_unit(role, column, where)


def combined_unit(role: str, column: Column, where: str, unit: str = "") -> tuple[float, Any]:
    """Number and unit that one unit of the column stands for, its gain included.

    Raises
    ------
    RecordError
        A unit is unknown, or not one of the quantity.
    """
    text = column.unit or unit
    known = unit_of(text)
    if known is None:
        raise RecordError(
            f'{where} has no unit; write it as unit = "...".'
            if not text
            else f"{where} has the unit {text!r}, which is not known; write one such as mm, N.m, rad/s."
        )
    gain = 1.0
    total = known
    if column.gain:
        gain, per = parse_quantity(column.gain, f"{where} gain")
        total = times(known, per)
    if not fits(role, total):
        product = f"{text} times the gain {column.gain}" if column.gain else f"the unit {text!r}"
        hint = "" if column.gain else f', or the gain that leads to it, such as gain = "2.5 {EXAMPLE[role]}/{text}"'
        raise RecordError(
            f"{where} has {product}, which is no {QUANTITY[role]}; give a unit such as {EXAMPLE[role]}{hint}."
        )
    return gain, total


EXAMPLE = {
    "time": "s",
    "position": "mm",
    "velocity": "mm/s",
    "reference": "mm",
    "force": "N",
    "friction": "N",
    "normal": "N",
}
"""A unit of each role, for error messages and for mappings to be written."""
