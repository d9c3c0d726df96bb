"""Patterns for names of variables."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """The names that a pattern stands for: ``*`` is any text, ``?`` any letter, a bracket (``k[1]``) just a bracket."""
    # not stars as ".*": many of them in one pattern take exponential time, and fnmatch has a way out
    matches = re.compile(fnmatch.translate(pattern.replace("[", "[[]"))).match
    return [name for name in names if matches(name)]
