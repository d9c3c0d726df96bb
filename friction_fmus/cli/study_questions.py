"""Questions about an axis on a terminal, for the file of settings of its study."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from friction_fmus.axis.servo import GAIN_UNITS, GAINS
from friction_fmus.blocks.axis_units import LINEAR, Words
from friction_fmus.cli.console import console
from friction_fmus.errors import FrictionError, did_you_mean
from friction_fmus.identification import RecordError, read_measurement
from friction_fmus.identification.data.column_headings import NEEDED, Guess, guess_columns
from friction_fmus.identification.data.formats import read_table
from friction_fmus.identification.data.mapping import MISSING, Column, DataMapping, axis_of, combined_unit
from friction_fmus.identification.data.record import ROLES, fits, parse_quantity, unit_of
from friction_fmus.identification.data.tables import DataTable
from friction_fmus.study.settings_file import SETTINGS_FILE, Known, write_settings
from harness.storage.files import make_folder

BLANK = f'"{MISSING}"'

OTHER_UNITS = {"position": ", or 1 for counts", "force": ", or V for a command", "reference": ", or 1 for counts"}
"""Units that need a factor."""

Check = Callable[[str], str]  # returns what is wrong with an answer; empty if nothing is


def write_configuration(data: Path, folder: Path) -> None:
    """Write the settings of the study of a data file, and ask for missing information."""
    # Without a terminal nothing is asked: missing entries are marked and listed.
    path = folder / SETTINGS_FILE
    if path.exists():
        raise FrictionError(f"{path} exists; edit it, or choose another folder with -o")
    if data.suffix.lower() == ".toml":
        raise FrictionError(f"{data} is already a configuration; give a data file")
    table = read_table(data)
    guess = guess_columns(table)
    ask = sys.stdin.isatty() and sys.stdout.isatty()
    servo: dict[str, str] = {}
    if ask:
        try:
            _ask_columns(table, guess)
            moving = guess.columns.keys() & {"position", "velocity"}
            servo = _ask_servo((axis_of(guess.columns) if moving else LINEAR).words)
        except EOFError:
            console.print()
    missing = [need[0] for need in NEEDED if not guess.columns.keys() & set(need)]
    missing += [role for role in guess.problems if role not in guess.columns and role not in missing]
    measurement = None if missing else read_measurement(DataMapping(data, columns=guess.columns))
    make_folder(folder)
    write_settings(folder, table, Known(guess.columns, guess.suggestions, servo, measurement))
    console.print(f"Settings: {path}", soft_wrap=True)
    for role in missing:
        reasons = "; ".join(guess.problems.get(role, ["no column"]))
        console.print(f"  missing: the {role} ({reasons}); replace each {MISSING} in [columns]", soft_wrap=True)
    if not servo:
        console.print("  missing: the controller; remove the # of [servo] to compare compensators", soft_wrap=True)
    unknown = [name for name, value in servo.items() if value == BLANK]
    if unknown:
        console.print(f"  missing in [servo]: {', '.join(unknown)}", soft_wrap=True)
    console.print(f"Next: friction-fmus study {path} -o out", soft_wrap=True)


def _ask_columns(table: DataTable, guess: Guess) -> None:
    """Ask for the columns that the headings do not determine, and complete the guess."""
    console.print(f"Columns of {table.file.name}: {', '.join(table.columns)}", soft_wrap=True)
    for role, column in guess.columns.items():
        console.print(f"  {role}: {column.column!r} in {column.unit}", soft_wrap=True)
    for need in NEEDED:
        if not guess.columns.keys() & set(need):
            role = next((role for role in need if role in guess.suggestions), need[0])
            _ask_column(table, guess, role, optional=False)
    for role in ("reference", *guess.suggestions):
        if role not in guess.columns:
            _ask_column(table, guess, role, optional=True)


def _ask_column(table: DataTable, guess: Guess, role: str, optional: bool) -> None:
    suggested = guess.suggestions.get(role, Column(""))
    known = (*table.columns, *(("none",) if optional else ()))

    def named(answer: str) -> str:
        return "" if answer in known else f"there is no column {answer!r}{did_you_mean(answer, known)}"

    default = suggested.column or ("none" if optional else "")
    heading = _ask(f"Column of the {role}" + (" (none if there is none)" if optional else ""), default, named)
    if not heading:
        return
    if heading == "none":
        guess.problems.pop(role, None)
        guess.suggestions.pop(role, None)
        return
    column = Column(heading, table.units.get(heading, "") or (suggested.unit if heading == suggested.column else ""))
    example = ROLES[role].example
    while True:
        unit = _ask(f"Unit of {heading!r}, such as {example}{OTHER_UNITS.get(role, '')}", column.unit, _unit)
        if not unit:
            guess.suggestions[role] = replace(column, unit="")
            return
        gain = ""
        if unit_of(unit) is None:  # the factor, where its unit was asked for
            unit, gain = column.unit or "1", unit
        known_unit = unit_of(unit)
        if not gain and (suggested.gain or known_unit is None or not fits(role, known_unit)):
            gain = _ask(f"Factor to the unit of the {role}, such as '2.5 {example}/{unit}'", "", _quantity)
        column = replace(column, unit=unit, gain=gain)
        try:
            combined_unit(role, column, f"{heading!r}")
            break
        except RecordError as error:
            console.print(f"  {error}", soft_wrap=True)
    guess.columns[role] = column
    guess.suggestions.pop(role, None)
    guess.problems.pop(role, None)


def _ask_servo(u: Words) -> dict[str, str]:
    """Return the entries of ``[servo]``; empty without a controller."""
    laws = (*GAINS, "none")

    def known(answer: str) -> str:
        return "" if answer in laws else f"use {', '.join(laws)}"

    console.print("Controller of the axis, to compare compensators:")
    law = _ask("Law: CascadePPI (kp, kv, ki), PID (Kp, Kd, Ki), or none for the models only", "none", known)
    if law in ("", "none"):
        return {}
    servo = {"law": f'"{law}"'}
    for name in GAINS[law]:
        optional = name in ("ki", "Ki")
        servo[name] = _ask(f"{name} [{u.fill(GAIN_UNITS[name])}]", "0.0" if optional else "", _number) or BLANK
    servo["force_limit"] = _ask(f"Largest {u.force} [{u.N}]", "", _number) or BLANK
    return servo


def _ask(question: str, default: str, check: Check) -> str:
    """Return a valid answer; empty if the user has none."""
    while True:
        answer = input(f"{question}{f' [{default}]' if default else ''}: ").strip() or default
        wrong = check(answer) if answer else ""
        if not wrong:
            return answer
        console.print(f"  {wrong}", soft_wrap=True)


def _unit(answer: str) -> str:
    if answer[0].isdigit() and unit_of(answer) is None:
        return _quantity(answer)
    return "" if unit_of(answer) is not None else f"the unit {answer!r} is unknown; use one such as mm, N.m, rad/s"


def _quantity(answer: str) -> str:
    try:
        parse_quantity(answer, "The factor")
    except RecordError as error:
        return str(error)
    return ""


def _number(answer: str) -> str:
    try:
        return "" if 0.0 <= float(answer) < float("inf") else "give a number of 0 or more"
    except ValueError:
        return f"{answer!r} is not a number"
