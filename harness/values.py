"""Values from files and users: checks of their kind, and their form in messages."""

import fnmatch
import math
import re
import reprlib
from collections.abc import Iterable
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, Final

import numpy as np

_INDICES = r"(\[\d+(,\d+)*\])?"
_QUOTED = r"'([A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+'"
_PART = rf"([A-Za-z_]\w*|{_QUOTED}){_INDICES}"
STRUCTURED = re.compile(rf"{_PART}(\.{_PART})*|der\({_PART}(\.{_PART})*(,\d+)?\)", re.ASCII)
"""A structured name (FMI 2.0.5, section 2.2.9)."""


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """Return the names that match a pattern: ``*`` is any text, ``?`` any character; brackets are literal."""
    # fnmatch instead of ".*", as many stars in one regular expression can take exponential time
    matches = re.compile(fnmatch.translate(pattern.replace("[", "[[]"))).match
    return [name for name in names if matches(name)]


MOST_TICKS: Final = 1 << 62  # largest number of ticks of a run, so that sums fit into 64 bits

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80
_SHORT.maxlevel = 3


def shown(value: object) -> str:
    """Return a value for a message: on one line, and truncated if it is long."""
    return _SHORT.repr(value)


def number(value: object) -> float | None:
    """Return a number as a float, finite or not, or None for any other value."""
    return float(value) if type(value) in (int, float) else None  # type: ignore[arg-type]


def finite(value: object) -> float | None:
    """Return a finite number as a float, or None for any other value."""
    found = number(value)
    return found if found is not None and math.isfinite(found) else None


def whole(value: object) -> int | None:
    """Return an integer, or None for any other value."""
    return value if type(value) is int else None


def flag(value: object) -> bool | None:
    """Return true or false, or None for any other value."""
    return value if isinstance(value, bool) else None


def text(value: object) -> str | None:
    """Return a one-line text, such as a name or a path, or None for any other value."""
    return value if isinstance(value, str) and is_line(value) else None


def texts(value: object) -> tuple[str, ...] | None:
    """Return a list of one-line texts, or None for any other value."""
    good = isinstance(value, list) and all(text(item) is not None for item in value)
    return tuple(value) if good else None  # type: ignore[arg-type]


def tables(value: object) -> list[dict[str, Any]] | None:
    """Return a list of tables, or None for any other value."""
    return value if isinstance(value, list) and all(isinstance(item, dict) for item in value) else None


def plain(value: Any) -> Any:
    """Return a scalar of numpy as one of Python, which files can hold, and any other value unchanged."""
    return value.item() if isinstance(value, np.generic) else value


def make_plain(frozen: Any) -> None:
    """Replace the scalars of numpy in a frozen dataclass by those of Python."""
    for each in fields(frozen):
        object.__setattr__(frozen, each.name, plain(getattr(frozen, each.name)))


def is_line(value: str) -> bool:
    """Return whether a text is a single line without control characters."""
    return _CONTROL.search(value) is None


def is_number(value: object) -> bool:
    """Return whether a value is a real number of Python or numpy."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_count(value: object, least: int = 1, most: int = MOST_TICKS) -> bool:
    """Return whether a value is an integer of Python or numpy within a range."""
    return isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most
