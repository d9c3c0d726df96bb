"""Mapping of a data file that has none: from options, headings and physics, or a refusal with commands to copy."""

import re
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from friction_fmus.errors import AmbiguousColumnsError, RecordError
from friction_fmus.identification.data import COLUMNS_EXAMPLE
from friction_fmus.identification.data.column_guess import ColumnCandidate, Guesser
from friction_fmus.identification.data.column_headings import Guess, columns_text, guess_columns, quoted
from friction_fmus.identification.data.mapping import UNKNOWN, Column, axis_of, scale_text, with_gain
from friction_fmus.identification.data.record import ROLES, fits, parse_quantity, unit_of
from friction_fmus.identification.data.tables import DataTable
from harness.units import BaseUnit

ALIASES: Final = {
    **dict.fromkeys(("current", "torque", "drive", "command", "moment"), "force"),
    **{"speed": "velocity", "angle": "position"},
}
NO_DRIVE: Final = "{}: --gain {} needs a drive force, torque or current; name its column."
SHOWN: Final = 4  # most candidates that are shown

_ITEM = re.compile(r"""\s*(\w+)\s*=\s*(-?)\s*(?:"([^"]*)"|'([^']*)'|([^,]*?(?=,\s*\w+\s*=|$)))\s*([^,]*?)\s*(?:,|$)""")
_FRACTION = re.compile(r"(\d+(?:\.\d*)?)\s*/\s*(\d+(?:\.\d*)?)\s+(.+)")


def chosen_columns(
    table: DataTable, path: Path, option: str = "", gain: str = ""
) -> tuple[dict[str, Column], dict[str, str], tuple[str, ...]]:
    """Return the columns by role, the reasons for them by role, and what else was found."""
    given = columns_of_option(option, table) if option else {}
    guess = guess_columns(table)
    if not given and not guess.problems:
        found = ColumnCandidate(guess.columns)
        notes: tuple[str, ...] = ()
    elif given and "time" in given and given.keys() & {"position", "velocity"}:
        found, notes = ColumnCandidate(given), ()
    else:
        physics = Guesser(table, given).guess()
        notes = physics.notes
        if physics.problems or len(physics.candidates) != 1:
            raise AmbiguousColumnsError(
                _refusal(table, path, physics.problems, physics.candidates, guess),
                [(command_text(each.columns), _described(each)) for each in physics.candidates],
            )
        found = physics.candidates[0]
    columns = dict(found.columns)
    if gain:
        if "force" not in columns:
            raise RecordError(NO_DRIVE.format(path, gain))
        columns["force"] = with_gain(columns["force"], gain, axis_of(columns))
    return columns, dict(found.reasons), notes


def _refusal(
    table: DataTable, path: Path, problems: tuple[str, ...], candidates: tuple[ColumnCandidate, ...], guess: Guess
) -> str:
    """Return why the columns are open, with commands for the candidates and the mapping as TOML."""
    order = table.order or tuple(table.columns)
    listed = f"Columns: {', '.join(f'{n} {name!r}' for n, name in enumerate(order, 1))}.\n"
    about_names = [text for texts in guess.problems.values() for text in texts]
    if all(name == f"column {n}" for n, name in enumerate(order, 1)):
        listed, about_names = "", ["the file has no headings"]
    reasons = "; ".join(dict.fromkeys([*about_names, *problems]))
    commands = [command_text(each.columns) for each in candidates[:SHOWN]] or [_incomplete(guess)]
    commands = [each if "force=" in each else f"{each}, force=?" for each in commands]
    what = "Use the one that is right" if len(commands) > 1 else "Use this command, corrected if it is wrong"
    if any("?" in each for each in commands):
        what += ", with a column and its unit for each ?, such as position=2 deg, force=3 N.m or period=1 ms"
    commands = [f"friction-fmus study {shlex.quote(path.name)} --columns {_shell(each)}" for each in commands]
    return (
        f"The headings of {path} do not identify its columns: {reasons}. {listed}{what}:\n\n"
        + "\n".join(f"    {command}" for command in commands)
        + f"\n\nOr run friction-fmus study --init {shlex.quote(path.name)}, which asks, or save the following text as "
        f"{path.stem}.toml in the same folder, correct it, and use that file:\n\n[data]\nfile = {quoted(path.name)}\n\n"
        f"{columns_text(table, guess.columns, guess.suggestions)}"
    )


def _incomplete(guess: Guess) -> str:
    """Return the value of the option ``--columns`` with ? for columns that the headings do not name."""
    known = {**guess.suggestions, **guess.columns}
    motion = "velocity" if "velocity" in known and "position" not in known else "position"
    parts = {role: known.get(role, Column("?")) for role in ("time", motion, "force")}
    return command_text(parts).replace("'?'", "?")


def _shell(text: str) -> str:
    """Return a text as one argument of a shell."""
    return f'"{text}"' if not set(text) & set('"$`\\!') else shlex.quote(text)


def _described(candidate: ColumnCandidate) -> str:
    return "; ".join(f"{role} {reason}" for role, reason in candidate.reasons.items() if reason)


def command_text(columns: Mapping[str, Column]) -> str:
    """Return the value of the option ``--columns`` for a mapping."""
    parts = []
    for role in sorted(columns, key=list(ROLES).index):
        column = columns[role]
        if column.period:
            parts.append(f"period={column.period}")
            continue
        quote = '"' if "'" in column.column else "'"
        scale = f" {scale_text(column)}".rstrip()
        parts.append(f"{role}={'-' * (column.sign < 0)}{quote}{column.column}{quote}{scale}")
    return ", ".join(parts)


def columns_of_option(option: str, table: DataTable) -> dict[str, Column]:
    """Return the columns of the option ``--columns``, such as `COLUMNS_EXAMPLE`."""
    columns: dict[str, Column] = {}
    at = 0
    while at < len(option):
        found = _ITEM.match(option, at)
        if found is None or found.end() == at:
            raise RecordError(f'--columns has {option[at:]!r}; use the form "{COLUMNS_EXAMPLE}".')
        at = found.end()
        name, minus, double, single, bare, unit = found.groups()
        role = ALIASES.get(name, name)
        if role == "period":
            text = f"{bare or ''} {unit}".strip()
            columns["time"] = Column("", period=text)
            parse_quantity(text, "--columns, period,", "1 ms")
            continue
        if role not in ROLES:
            raise RecordError(f"--columns has the unknown role {name!r}; use {', '.join((*ROLES, *ALIASES))}.")
        if role in columns:
            raise RecordError(f"--columns names the {role} twice; name it once.")
        heading = double if double is not None else single
        if heading is None:
            heading, unit = _heading(f"{bare} {unit}".strip(), table)
        elif heading not in table.columns and heading not in table.texts:
            raise RecordError(f"--columns has no column {heading!r}; it is not in {table.file}.")
        columns[role] = _scaled(role, Column(heading, sign=-1 if minus else 1), unit.strip(), table)
    return columns


def _heading(text: str, table: DataTable) -> tuple[str, str]:
    """Return the heading and the unit of a text that begins with a heading or the number of a column."""
    names = [name for name in (*table.columns, *table.texts) if name]
    first, _, rest = text.partition(" ")
    exact = [name for name in names if text == name or text.startswith(f"{name} ")]
    if exact:
        heading = max(exact, key=len)
        return heading, text[len(heading) :]
    order = table.order or tuple(table.columns)
    if first.isdigit() and 1 <= int(first) <= len(order) and (table.order or not table.texts):
        return order[int(first) - 1], rest
    raise RecordError(f"--columns names {text!r}, but {table.file} has the columns {', '.join(map(repr, names))}.")


def _scaled(role: str, column: Column, unit: str, table: DataTable) -> Column:
    """Return a column with a unit, with a number and a unit, or with its own unit."""
    unit = unit or table.units.get(column.column, "")
    if role == "time" or ROLES[role].quantity == "normal":
        return replace(column, unit=unit)
    if fraction := _FRACTION.fullmatch(unit):
        unit = f"{float(fraction[1]) / float(fraction[2]):.15g} {fraction[3]}"
    if unit[:1].isdigit() and unit_of(unit) is None:
        parse_quantity(unit, f"--columns, {role},", "1/8192 rev" if ROLES[role].quantity == "position" else "6 N.m")
        return replace(column, unit="1", gain=unit)
    known = unit_of(unit) if unit else BaseUnit()
    if known is None:
        return replace(column, unit=unit, gain=UNKNOWN)
    return replace(column, unit=unit or "1", gain="" if fits(role, known) else UNKNOWN)
