"""Mapping of columns to signals from unambiguous headings; otherwise a template of the mapping to complete."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from friction_fmus.identification.data.mapping import Column
from friction_fmus.identification.data.record import ROLES, Array, axis_units, factor, fits, unit_of, wanted_unit
from friction_fmus.identification.data.tables import DataTable
from harness.units import BaseUnit
from harness.values import is_line


def _words(text: str) -> tuple[str, ...]:
    """Return words or names that are separated by commas."""
    return tuple(" ".join(each.split()) for each in text.split(","))


NAMES = {
    "time": _words("t, time, timestamp, elapsed time, relative time, zeit, zeitstempel, messzeit"),
    "position": _words("""
        x, q, phi, theta, pos, position, angle, displacement, act pos, pos act, actual position, position actual,
        position actual value, actual angle, measured position, position feedback, feedback position,
        encoder position, x act, q act, ist position, position ist, positions istwert, lage, ist lage, lage ist,
        lage istwert, weg, ist weg, winkel, ist winkel, winkel ist, x ist, q ist, phi ist
    """),
    "velocity": _words("""
        v, vel, velocity, speed, omega, xdot, qdot, act vel, act velo, actual velocity, velocity actual,
        velocity actual value, act speed, actual speed, speed actual, speed actual value, measured velocity,
        velocity feedback, v act, geschwindigkeit, ist geschwindigkeit, geschwindigkeit ist,
        geschwindigkeits istwert, drehzahl, ist drehzahl, drehzahl ist, drehzahl istwert, winkelgeschwindigkeit,
        v ist
    """),
    "reference": _words("""
        r, ref, reference, setpoint, position reference, reference position, ref pos, pos ref, x ref, q ref,
        phi ref, reference angle, set pos, pos set, set position, position set, position setpoint,
        setpoint position, position demand, demand position, position demand value, commanded position,
        position command, command position, cmd pos, pos cmd, desired position, x des, q des, x set, q set, x cmd,
        q cmd, soll position, position soll, positions sollwert, soll lage, lage soll, lage sollwert, soll weg,
        soll winkel, winkel soll, x soll, q soll, phi soll
    """),
    "force": _words("""
        force, torque, drive force, motor force, motor torque, tau, effort, act torque, torque act, actual torque,
        torque actual, torque actual value, act force, actual force, force act, force actual, force actual value,
        measured torque, measured force, kraft, ist kraft, kraft ist, kraft istwert, antriebs kraft, motor kraft,
        moment, ist moment, moment ist, momenten istwert, drehmoment, ist drehmoment, drehmoment ist,
        drehmoment istwert, antriebs moment, motor moment
    """),
    "friction": _words("""
        friction, friction force, friction torque, reibung, reib kraft, reibungs kraft, reib moment
    """),
    "normal": _words("normal, normal force, fn, normal kraft"),
    "injected": _words("injected, injected force, injected torque, excitation force, excitation torque"),
}
"""Names of each role, in lower case; a space matches any separator, or none."""

LETTERS = {"velocity": ("n", "w", "xd", "qd"), "force": ("f", "m")}
"""Names that are recognised only with a unit of the role: ``m [N.m]`` is a torque, ``m [kg]`` is not."""

FALLBACKS = {
    "reference": _words("target position, target pos, ziel position"),
    "force": _words("""
        torque demand, torque demand value, target torque, torque command, torque setpoint, set torque,
        force command, force setpoint, soll moment, momenten sollwert, drehmoment sollwert, soll kraft
    """),
}
"""Names that are used if the file has no other column for the role."""

LONGEST = 200  # largest length of a heading in which a unit is searched [characters]

_UNMEASURED = re.compile(
    "ref|set|soll|demand|target|ziel|command|cmd|des|err|fehler|abweichung|diff|dev|lag|schlepp|follow|lim|max|min"
)
"""Parts of a qualified name whose last part is then not a measured signal, such as ``error.position``."""

WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "time": _words("""
        t, time, timestamp, stamp, elapsed, zeit, zeitstempel, clock, tick, temps, tiempo, tempo,
        时间, 時間, 时刻, 時刻
    """),
    "position": _words("""
        position, positions, pos, lage, angle, winkel, weg, x, q, phi, theta, displacement, encoder, enc, stroke,
        qpos, actpos, setpos, istposition, sollposition, istwinkel, istlage, posicion, posición, posizione,
        位置, 角度, 位移, 変位
    """),
    "velocity": _words("""
        velocity, velo, vel, speed, omega, drehzahl, istdrehzahl, geschwindigkeit, dq, qdot, v, n, w, qvel, actvelo,
        actvel, rpm, xdot, winkelgeschwindigkeit, sollgeschwindigkeit, thetadot, solldrehzahl, istgeschwindigkeit,
        dtheta, dphi, dx, vitesse, velocidad, velocità,
        速度, 转速, 回転数
    """),
    "acceleration": _words("""
        acceleration, acc, accel, ddq, qddot, qdd, beschleunigung, ddx, ddtheta, xddot,
        加速度
    """),
    "force": _words("""
        torque, tau, force, kraft, moment, drehmoment, current, curr, cur, strom, iststrom, i, iq, isq, u, effort,
        ampere, istmoment, sollstrom, sollmoment, acttorque, motorstrom, antriebsmoment, istdrehmoment, motormoment,
        trq, stromistwert, loadratio, loadfactor, effectiveload, voltage, spannung, duty, pwm, torqueratio,
        电流, 電流, 转矩, 扭矩, 力矩, トルク, 负载率, 負荷率, courant, couple, corriente, fuerza, coppia, corrente,
    """),
}
"""Words in headings, by what they stand for; without a unit they are enough for a guess that the motion confirms."""

QUALIFIERS: Final[Mapping[str, tuple[str, ...]]] = {
    "reference": _words("""
        ref, reference, soll, sollwert, target, goal, set, setpoint, sp, demand, desired, des, cmd, command,
        commanded, ziel, setpos, sollposition, solldrehzahl, sollstrom, sollmoment, sollgeschwindigkeit, planned,
        nominal, profile, input, consigne, consigna, referencia, riferimento,
        指令, 给定, 目标, 目標, 设定, 設定
    """),
    "error": _words("""
        error, err, fehler, deviation, dev, abweichung, lag, following, schlepp, schleppfehler, droop, diff,
        difference, regelabweichung, erreur, écart,
        偏差, 误差, 誤差
    """),
    "actual": _words("""
        actual, act, ist, istwert, measured, meas, feedback, fb, fbk, present, actpos, mesuré, mesurée, réel, réelle,
        实际, 反馈, 実, 現在, フィードバック
    """),
    "other": _words("""
        lim, limit, limits, max, min, ff, feedforward, temp, temperature, temperatur, bus, dc, status, state, fault,
        alarm, mode, flag, index, counter, count, cycle, sample, samples, nr, no, number, id, isd, external, ext,
        gain, limiter, rated, vibration, power, leistung, friction, reibung, reibkraft, reibmoment, normal,
        disturbance, zaehler, zähler, pressure, druck, gripper, humidity, inp, battery, batterie, batt, supply, ee, tcp,
        温度, 限制, 制限, 上限, 下限, 状态, 状態, 功率, 電力, 摩擦, 计数
    """),
}
"""Words that say which of several signals of a kind a column is."""

_OBJECT = re.compile(r"(0x[0-9a-f]{4}|[0-9a-f]{4}h)([:._\s]?(0x)?[0-9a-f]{1,2})?\b|[0-9a-f]{4}:[0-9a-f]{1,2}\b", re.I)
"""Index of an object of CANopen or EtherCAT, such as ``0x6064`` or ``6064h:00``."""

_AXIS = re.compile(r"(axis|achse|ax|joint|gelenk|motor|drive|antrieb|channel|kanal|ch)?\d*|[xyzabc]\d*")
"""Words that name an axis, not a signal."""

_NUMBERED = re.compile(r"[A-Za-z]+\d+|J")  # joints and motors that look like units: tau_J1, pos_m2
_BEFORE_UNIT = re.compile(r"\s+in\s+|\s*/\s*|_|,\s*|\s+")


@dataclass(frozen=True)
class Meaning:
    """Role that a heading may have."""

    role: str  # role of the column
    unit: str  # unit in the heading, also from ``F/N``, ``x in mm`` and ``position_mm``; empty if there is none
    fallback: bool = False  # whether other columns for the role take precedence


def meaning_of(heading: str, unit: str) -> Meaning | None:
    """Return the role that a heading names; None if it is unknown."""
    if _OBJECT.fullmatch(unit):
        unit = ""
    for name, its_unit in _readings(heading, unit):
        for form in _forms(name):
            for role, forms in _FORMS.items():
                fitting = _fits(role, its_unit)
                if (form in forms and (fitting or name == heading)) or (fitting and form in LETTERS.get(role, ())):
                    return Meaning(role, its_unit, form in _FALLBACKS.get(role, ()))
    return None


def _readings(heading: str, unit: str) -> Iterator[tuple[str, str]]:
    """Yield name and unit of a heading, in all ways in which it can be split."""
    yield heading, unit
    for split in () if unit or len(heading) > LONGEST else _BEFORE_UNIT.finditer(heading):
        rest = heading[split.end() :].strip("()[] ")
        if unit_of(rest) is not None and not _NUMBERED.fullmatch(rest):
            yield heading[: split.start()], rest


def _forms(name: str) -> Iterator[str]:
    """Yield the forms of a name to look up: whole, without index and axis, and the last part of a qualified name."""
    bare = _OBJECT.sub(" ", name.casefold())
    yield _plain(bare)
    *parts, last = [part for part in re.split(r"::|[./:!|]", bare) if part.strip(" 0123456789[]")] or [""]
    if not any(_UNMEASURED.search(part) for part in parts):
        yield _plain(last)
        words = re.split(r"[\s_-]+", last)
        yield _plain("".join(word for word in words if not _AXIS.fullmatch(word)))


def _plain(name: str) -> str:
    return re.sub(r"[\s._-]", "", name.casefold())


def _fits(role: str, unit: str) -> bool:
    known = unit_of(unit) if unit else None
    return known is not None and fits(role, known)


_FALLBACKS = {role: frozenset(map(_plain, names)) for role, names in FALLBACKS.items()}
_FORMS = {role: frozenset(map(_plain, names)) | _FALLBACKS.get(role, frozenset()) for role, names in NAMES.items()}

TIMES: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of times as computers and drives log them without a unit."""

NEEDED: Final = (("time",), ("position", "velocity"), ("force", "friction"))
"""Roles of which an identification needs one each."""


@dataclass(frozen=True)
class ColumnMeaning:
    """What heading and unit say about a column."""

    kind: str = ""  # time, position, velocity, acceleration, force, friction, other; empty if they say nothing
    qualifier: str = ""  # reference, error, actual or empty
    axis: str = ""  # number or letter of axis or joint
    unit: str = ""  # unit of the file
    named: bool = False  # whether a name says so, not only the unit


def about(heading: str, unit: str) -> ColumnMeaning:
    """Return what heading and unit say about a column, with less certainty than `meaning_of`."""
    read = next(((name, its) for name, its in _readings(heading, unit) if its), (heading, ""))
    name, its_unit = read if not _OBJECT.fullmatch(read[1]) else (heading, "")
    if not its_unit and len(heading) > 2 and _kind_of_unit(heading.lower()) == "velocity":  # such as rpm
        its_unit = heading.lower()
    tokens = [token.casefold() for token in _TOKEN.findall(name)]
    digits = [token for token in tokens if token.isdigit()]
    axis = digits[-1] if digits else next((token for token in tokens if token in ("x", "y", "z")), "")
    words = [token for token in tokens if not token.isdigit()]
    if "d" in words[1:] and {"q", "dq", "tau"} & {*words}:  # desired
        words.append("desired")
    joined = {"".join(pair) for pair in pairwise(words)} | {*words, *(word for word in _EASTERN if word in name)}
    qualifier = next((kind for kind in ("other", "error", "reference", "actual") if joined & {*QUALIFIERS[kind]}), "")
    by_unit = _kind_of_unit(its_unit)
    found = [kind for kind, known in WORDS.items() if joined & {*known}]
    if {"current", "curr", "cur"} & {*words} and len(found) > 1:  # the position at present
        found.remove("force")
    longer = [kind for kind in found if any(len(word) > 1 and word in WORDS[kind] for word in joined)]
    found = longer or found
    if by_unit and by_unit in found:
        found = [by_unit]
    if set(words) & {"qd"} and not found:
        return ColumnMeaning("velocity", qualifier, axis, its_unit, True)
    if qualifier == "other" and by_unit != "time":
        return ColumnMeaning("other", qualifier, axis, its_unit, True)
    if not found and by_unit:
        return ColumnMeaning(by_unit, qualifier, axis, its_unit)
    kind = found[-1] if found else "position" if qualifier == "error" else ""
    if kind and by_unit and by_unit != kind:
        return ColumnMeaning("other" if by_unit == "other" else by_unit, qualifier, axis, its_unit)
    return ColumnMeaning(kind, qualifier, axis, its_unit, bool(kind))


_EASTERN: Final = [word for listed in (*WORDS.values(), *QUALIFIERS.values()) for word in listed if word > "\u3000"]
"""Words of Chinese and Japanese, which are not separated from others."""

_TOKEN = re.compile(r"[A-ZÀ-Þ]{2,}(?![a-zß-ÿ])|[A-ZÀ-Þ]?[a-zß-ÿ]+|[A-ZÀ-Þ]|\d+")


_FORCES: Final = tuple(known.exponents for known in map(unit_of, ("1", "A", "V")) if known is not None)
_ACCELERATIONS: Final = tuple(known.exponents for known in map(unit_of, ("m/s2", "rad/s2")) if known is not None)


def _kind_of_unit(unit: str) -> str:
    """Return what a unit says about a column: its kind, ``other`` for a quantity of no role, empty if it is unknown."""
    known = unit_of(unit) if unit else None
    if known is None:
        return "velocity" if unit.endswith("/s") and unit_of(unit[:-2]) == BaseUnit() else ""
    if known == BaseUnit():
        return "" if unit in ("1", "-") else "position"
    if known.exponents in _FORCES:
        return "force"
    if known.exponents in _ACCELERATIONS:
        return "acceleration"
    return next((role for role in ("time", "position", "velocity", "force") if fits(role, known)), "other")


@dataclass(frozen=True)
class Guess:
    """Columns recognised by the headings of a file."""

    columns: dict[str, Column]  # columns with a unit that fits, by role
    suggestions: dict[str, Column]  # recognised columns that lack a unit or a gain, or are one of several, by role
    problems: dict[str, list[str]]  # what is missing or ambiguous, by role


def guess_columns(table: DataTable) -> Guess:
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


def columns_text(table: DataTable, known: Mapping[str, Column], suggestions: Mapping[str, Column]) -> str:
    """Return the table ``[columns]`` of a mapping as TOML, with ? for unknown entries."""
    entries = dict(known)
    for role in ("time", "position", "force"):
        if not (entries.keys() & set(next((need for need in NEEDED if role in need), ()))):
            entries[role] = suggestions.get(role, Column("?", "?"))
    used = {column.column for column in entries.values()}
    free = [name for name in (*table.columns, *table.texts) if name not in used]
    order = sorted(entries, key=list(ROLES).index)
    return "\n".join(
        [
            "[columns]",
            *(_entry(role, entries[role]) for role in order),
            '# a drive command: unit = "V", gain = "35.15 N/V"; a motor torque on a linear axis: gain = "314 N/(N.m)";',
            '# increments of an encoder: unit = "1", gain = "0.5 um"; an inverted sign: sign = -1',
            "# other roles: velocity, reference, normal (force), and friction instead of force if it was measured",
            f"# unused columns: {', '.join(name if is_line(name) else quoted(name) for name in free) or 'none'}",
        ]
    )


def quoted(text: str) -> str:
    """Return a text as a string of TOML, which allows no DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _entry(role: str, column: Column) -> str:
    if column.period:
        return f"{role} = {{ period = {quoted(column.period)} }}"
    keys = [f"column = {quoted(column.column)}", f"unit = {quoted(column.unit or '?')}"]
    keys += [f"gain = {quoted(column.gain)}"] if column.gain else []
    keys += [f"sign = {column.sign}"] if column.sign != 1 else []
    return f"{role} = {{ {', '.join(keys)} }}"


def _columns_by_role(table: DataTable) -> dict[str, list[Column]]:
    """Return the columns that could have each role; a fallback only if there is no other column."""
    found: dict[str, list[tuple[bool, Column]]] = {}
    for heading in (*table.columns, *table.texts):
        meaning = meaning_of(heading, table.units.get(heading, ""))
        if meaning is not None:
            unit = meaning.unit
            if meaning.role == "time" and not unit and heading in table.columns:
                unit = epoch_unit(table.columns[heading])
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


def epoch_unit(times: Array) -> str:
    """Return the unit of times since 1970 that lie between the years 2001 and 2096; empty for others."""
    # Their steps are at most a second: a counter of microseconds passes the same numbers.
    known = times[np.isfinite(times)]
    if len(known) < 2:
        return ""
    first, step = float(known[0]), float(np.median(np.abs(np.diff(known))))
    return next((u for u, each in TIMES.items() if 1e9 < first * each < 4e9 and step * each <= 1.0), "")
