"""Units and nouns of the variables of a law, as macros of block.h."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """A unit in terms of the macros of block.h, which differ between the translational and the rotational build.

    ``FORCE + "/(" + LENGTH + ".s)"`` is N/(m.s), and N.m/(rad.s) in the rotational build.
    """

    c: str  # C expression for the name of the unit

    def __add__(self, other: Unit | str) -> Unit:
        return Unit(f"{self.c} {unit_of(other).c}")

    def __radd__(self, other: str) -> Unit:
        return unit_of(other) + self


def unit_of(unit: Unit | str) -> Unit:
    """Return a unit, also of its plain name."""
    return unit if isinstance(unit, Unit) else Unit(c_string(unit))


def c_string(text: str) -> str:
    """Return the text as a C string literal without trigraphs."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("??", "?\\?")
    return f'"{escaped}"'


NOUNS = {"{force}": "FORCE_NOUN", "{mass}": "MASS_NOUN", "{moving_mass}": "MOVING_MASS"}
"""Placeholders in descriptions, and their macros in block.h, which differ between the two builds."""


def c_description(text: str) -> str:
    """Return a description as C string literals, with macros for the nouns in `NOUNS`."""
    parts = re.split(f"({'|'.join(map(re.escape, NOUNS))})", text)
    return " ".join(NOUNS.get(part) or c_string(part) for part in parts if part)


LENGTH = Unit("LENGTH")
VELOCITY = Unit("VELOCITY")
ACCELERATION = Unit("ACCELERATION")
JERK = Unit("JERK")
FORCE = Unit("FORCE")
MASS = Unit("MASS")
STIFFNESS = Unit("STIFFNESS")
DAMPING = Unit("DAMPING")
TIME = Unit("TIME")
FREQUENCY = Unit("FREQUENCY")
ANGLE = Unit("ANGLE")
NO_UNIT = Unit("NO_UNIT")
