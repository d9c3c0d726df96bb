"""Lines of statements."""

from __future__ import annotations

import re
from collections.abc import Sequence

_LINE = 100  # longest line of a statement
_BREAKS = re.compile(r" (\+|-|\*|/|&&|\|\||\?|:) ")
_ORDER = ("?", ":", "||", "&&", "+", "-", "*", "/")  # of operators at which a line is divided


def statement(text: str) -> list[str]:
    """Return a statement in lines, divided at its outermost operators if it is long."""
    if len(text) <= _LINE:
        return [text]
    start = text.find(" = ") + 3
    found = [
        (_depth(text, start, match.start()), _ORDER.index(match[1]) // 2, -match.start())
        for match in _BREAKS.finditer(text, start + 12, _LINE)
    ]
    if not found:
        return [text]
    place = -min(found)[2]
    return [text[:place], *(f"    {line}" for line in statement(text[place + 1 :]))]


def is_if(lines: Sequence[str]) -> bool:
    """Return whether lines are a single ``if`` with its sides."""
    outer = [line for line in lines if not line.startswith(" ")]
    return bool(outer) and outer[0].startswith("if (") and all(line.startswith("}") for line in outer[1:])


def _depth(text: str, start: int, end: int) -> int:
    """Return the number of open brackets at a place."""
    return text.count("(", start, end) - text.count(")", start, end)
