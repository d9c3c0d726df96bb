"""Headings as drives, oscilloscopes and engineers write them: which signal they name, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from friction_fmus.identification.data.quantities import fits, unit_of

NAMES = {
    "time": (
        *("t", "time", "timestamp", "elapsed time", "relative time"),
        *("zeit", "zeitstempel", "messzeit"),
    ),
    "position": (
        *("x", "q", "phi", "theta", "pos", "position", "angle", "displacement"),
        *("act pos", "pos act", "actual position", "position actual", "position actual value", "actual angle"),
        *("measured position", "position feedback", "feedback position", "encoder position", "x act", "q act"),
        *("ist position", "position ist", "positions istwert", "lage", "ist lage", "lage ist", "lage istwert", "weg"),
        *("ist weg", "winkel", "ist winkel", "winkel ist", "x ist", "q ist", "phi ist"),
    ),
    "velocity": (
        *("v", "vel", "velocity", "speed", "omega", "xdot", "qdot"),
        *("act vel", "act velo", "actual velocity", "velocity actual", "velocity actual value", "act speed"),
        *("actual speed", "speed actual", "speed actual value", "measured velocity", "velocity feedback", "v act"),
        *("geschwindigkeit", "ist geschwindigkeit", "geschwindigkeit ist", "geschwindigkeits istwert"),
        *("drehzahl", "ist drehzahl", "drehzahl ist", "drehzahl istwert", "winkelgeschwindigkeit", "v ist"),
    ),
    "reference": (
        *("r", "ref", "reference", "setpoint", "position reference", "reference position", "ref pos", "pos ref"),
        *("x ref", "q ref", "phi ref", "reference angle", "set pos", "pos set", "set position", "position set"),
        *("position setpoint", "setpoint position", "position demand", "demand position", "position demand value"),
        *("commanded position", "position command", "command position", "cmd pos", "pos cmd", "desired position"),
        *("x des", "q des", "x set", "q set", "x cmd", "q cmd"),
        *("soll position", "position soll", "positions sollwert", "soll lage", "lage soll", "lage sollwert"),
        *("soll weg", "soll winkel", "winkel soll", "x soll", "q soll", "phi soll"),
    ),
    "force": (
        *("force", "torque", "drive force", "motor force", "motor torque", "tau", "effort"),
        *("act torque", "torque act", "actual torque", "torque actual", "torque actual value", "act force"),
        *("actual force", "force act", "force actual", "force actual value", "measured torque", "measured force"),
        *("kraft", "ist kraft", "kraft ist", "kraft istwert", "antriebs kraft", "motor kraft"),
        *("moment", "ist moment", "moment ist", "momenten istwert", "drehmoment", "ist drehmoment"),
        *("drehmoment ist", "drehmoment istwert", "antriebs moment", "motor moment"),
    ),
    "friction": (
        *("friction", "friction force", "friction torque", "reibung", "reib kraft", "reibungs kraft", "reib moment"),
    ),
    "normal": ("normal", "normal force", "fn", "normal kraft"),
    "injected": ("injected", "injected force", "injected torque", "excitation force", "excitation torque"),
}
"""Names of each role, in lower case; a space matches any separator, or none."""

LETTERS = {"velocity": ("n", "w", "xd", "qd"), "force": ("f", "m")}
"""Names that are recognised only with a unit of the role: ``m [N.m]`` is a torque, ``m [kg]`` is not."""

FALLBACKS = {
    "reference": ("target position", "target pos", "ziel position"),
    "force": (
        *("torque demand", "torque demand value", "target torque", "torque command", "torque setpoint", "set torque"),
        *("force command", "force setpoint", "soll moment", "momenten sollwert", "drehmoment sollwert", "soll kraft"),
    ),
}
"""Names that are used if the file has no other column for the role."""

LONGEST = 200
"""Largest length of a heading in which a unit is searched [characters]."""

_UNMEASURED = re.compile(
    "ref|set|soll|demand|target|ziel|command|cmd|des|err|fehler|abweichung|diff|dev|lag|schlepp|follow|lim|max|min"
)
"""Parts of a qualified name whose last part is then not a measured signal, such as ``error.position``."""

_OBJECT = re.compile(r"(0x[0-9a-f]{4}|[0-9a-f]{4}h)([:._\s]?(0x)?[0-9a-f]{1,2})?\b|[0-9a-f]{4}:[0-9a-f]{1,2}\b", re.I)
"""Index of an object of CANopen or EtherCAT, such as ``0x6064`` or ``6064h:00``."""

_AXIS = re.compile(r"(axis|achse|ax|joint|gelenk|motor|drive|antrieb|channel|kanal|ch)?\d*|[xyzabc]\d*")
"""Words that name an axis, not a signal."""

_BEFORE_UNIT = re.compile(r"\s+in\s+|\s*/\s*|_|,\s*|\s+")


@dataclass(frozen=True)
class Meaning:
    """Role that a heading may have."""

    role: str
    """Role of the column."""
    unit: str
    """Unit in the heading, also from ``F/N``, ``x in mm`` and ``position_mm``; empty if there is none."""
    fallback: bool = False
    """Whether other columns for the role take precedence."""


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
        if unit_of(rest) is not None:
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
