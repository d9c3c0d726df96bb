"""Words and units of a rotary axis in texts that were written for a linear one."""

from __future__ import annotations

import re
from typing import Final

_END = r"(?![\w/·²]|\.\w)"
"""After a unit: no further factor."""

_NUMBER = r"(?<=[\d∞)][ \u00a0])"
"""Before a unit: a number and a space."""

RULES: Final = tuple(
    (re.compile(pattern), replacement)
    for pattern, replacement in (
        (r"\bN2([.·])s/m2\b", r"N2\1m2\1s/rad2"),
        (r"\bN/\(m([.·])s\)", r"N\1m/(rad\1s)"),
        (rf"\bN([.·])s(²?)/m{_END}", r"N\1m\1s\2/rad"),
        (rf"\bN/m{_END}", "N.m/rad"),
        (rf"\b([kmµun]?)m/s(2|²|3|³)?{_END}", r"\1rad/s\2"),
        (rf"(?:{_NUMBER}|(?<=\[))([kmM]?)N{_END}", r"\1N.m"),
        (rf"(?:{_NUMBER}|(?<=\[))([mµun]?)m{_END}", r"\1rad"),
        (rf"(?:{_NUMBER}|(?<=\[))kg{_END}", "kg.m2"),
        (r"\b(?:[Mm]oved|[Mm]oving) mass\b", "moment of inertia"),
        (r"\bmasses\b(?!-)", "moments of inertia"),
        (r"\bmass\b(?!-)", "inertia"),
        (r"\bMass(?= (?:and|is|of)\b|,)", "Inertia"),
        (r"(?<!ormal )\bforce(s?)\b(?!-)", r"torque\1"),
        (r"\bForce(s?)\b(?!-)", r"Torque\1"),
    )
)
"""Patterns and their replacements, units with several factors first. A normal force stays a force."""


def in_rotary_words(text: str) -> str:
    """Return a text about a linear axis as a text about a rotary one; numbers in SI units keep their values.

    Forces become torques, masses become inertias, N, m and kg become N.m, rad and kg.m2. Texts that already have these
    words do not change.
    """
    for pattern, replacement in RULES:
        text = pattern.sub(replacement, text)
    return text


_MARKUP = re.compile(r"(<script.*?</script>|<style.*?</style>|<code>.*?</code>|<[^>]*>)", re.DOTALL)
_PLOT_TEXT = re.compile(r'(?<="text":")(?:[^"\\]|\\.)*(?=")')


def html_in_rotary_words(page: str) -> str:
    """Return an HTML page with `in_rotary_words` applied to its text, to labels of figures, and to their JSON."""

    def worded(part: str) -> str:
        if part.startswith('<script type="application/json"'):
            return _PLOT_TEXT.sub(lambda match: in_rotary_words(match[0]), part)
        if part.startswith(("<script", "<style", "<code")):
            return part
        if part.startswith("<"):
            label = r'(?<=aria-label=")[^"]*(?=")'
            return re.sub(label, lambda match: in_rotary_words(match[0]), part)
        return in_rotary_words(part)

    return "".join(worded(part) for part in _MARKUP.split(page))
