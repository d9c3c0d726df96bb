"""Patterns for names of variables."""

from __future__ import annotations

import re
from collections.abc import Iterable


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """The names that a pattern stands for: ``*`` is any text, ``?`` any letter, a bracket (``k[1]``) just a bracket."""
    expression = re.escape(pattern).replace(r"\*", ".*").replace(r"\?", ".")
    return [name for name in names if re.fullmatch(expression, name)]
