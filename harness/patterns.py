"""Patterns for names of variables."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """Return the names that match a pattern: ``*`` is any text, ``?`` any character; brackets are literal."""
    # fnmatch instead of ".*", as many stars in one regular expression can take exponential time
    matches = re.compile(fnmatch.translate(pattern.replace("[", "[[]"))).match
    return [name for name in names if matches(name)]
