"""Patterns for names of variables."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable

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
