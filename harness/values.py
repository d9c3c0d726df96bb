"""Values from files and from users: what kind they are of, and how a message shows them."""

from __future__ import annotations

import re
import reprlib
from numbers import Integral, Real
from typing import Any, Final

MOST_TICKS: Final = 1 << 62
"""Ticks of a run: with room for sums in the 64 bit of the engine."""

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80
_SHORT.maxlevel = 3


def shown(value: object) -> str:
    """Return a value as it is shown in a message: on one line, and cut where it is long."""
    return _SHORT.repr(value)


def number(value: object) -> float | None:
    """Return a number as a float, also one that is not finite; None for another kind of value."""
    return float(value) if type(value) in (int, float) else None  # type: ignore[arg-type]


def whole(value: object) -> int | None:
    """Return a whole number; None for another kind of value."""
    return value if type(value) is int else None


def flag(value: object) -> bool | None:
    """Return true or false; None for another kind of value."""
    return value if isinstance(value, bool) else None


def text(value: object) -> str | None:
    """Return a text that fits on one line, such as a name or a path; None for another kind of value."""
    return value if isinstance(value, str) and is_line(value) else None


def texts(value: object) -> tuple[str, ...] | None:
    """Return a list of such texts; None for another kind of value."""
    good = isinstance(value, list) and all(text(item) is not None for item in value)
    return tuple(value) if good else None  # type: ignore[arg-type]


def tables(value: object) -> list[dict[str, Any]] | None:
    """Return a list of tables; None for another kind of value."""
    return value if isinstance(value, list) and all(isinstance(item, dict) for item in value) else None


def is_line(value: str) -> bool:
    """Whether a text has no control characters and stands on one line."""
    return _CONTROL.search(value) is None


def is_number(value: object) -> bool:
    """Whether a value is a real number, of Python or of numpy."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_count(value: object, least: int = 1, most: int = MOST_TICKS) -> bool:
    """Whether a value is a whole number in a range, of Python or of numpy."""
    return isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most
