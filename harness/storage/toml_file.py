"""TOML files from any source, limited in size, depth and text length, so that readers can rely on their form."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, Final

from harness.storage.files import read_regular
from harness.values import is_line, shown

DEEPEST: Final = 20
"""Largest depth of nested tables and lists."""

LONGEST: Final = 4096
"""Largest length of a text [characters]; no path on Linux is longer."""

_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
# time and memory of tomllib grow with the square of the number of parts of a key
_LONG_KEY = re.compile(rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST}}}")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file."""
    content = read_regular(path).decode("utf-8").replace("\r\n", "\n")  # like tomllib.load
    long = _LONG_KEY.search(content)
    if long is not None:
        line = content.count("\n", 0, long.start()) + 1
        raise ValueError(f"line {line} has a key with more than {DEEPEST} parts")
    try:
        document = tomllib.loads(content)
    except RecursionError:
        raise ValueError(f"it is nested deeper than {DEEPEST} levels") from None
    _check(document)
    return document


def _check(document: dict[str, Any]) -> None:
    """Raise a ValueError if a limit is exceeded; not recursive, as the document may be deeply nested."""
    pending: list[tuple[str, Any, int]] = [("", document, 0)]
    while pending:
        place, value, depth = pending.pop()
        if depth > DEEPEST:
            raise ValueError(f"{place[:80]}... is nested deeper than {DEEPEST} levels")
        if isinstance(value, dict):
            for key in value:
                _check_text(f"a key in {place or 'it'}", key)
                if not is_line(key):
                    raise ValueError(f"the key {shown(key)} has control characters")
            pending += [(f"{place}.{key}".lstrip("."), item, depth + 1) for key, item in value.items()]
        elif isinstance(value, list):
            pending += [(f"{place}[{index}]", item, depth + 1) for index, item in enumerate(value)]
        elif isinstance(value, str):
            _check_text(place, value)
        elif type(value) is int and not -(1 << 63) <= value < 1 << 63:
            raise ValueError(f"the whole number {place} does not fit into 64 bits")


def _check_text(place: str, value: str) -> None:
    if len(value) > LONGEST:
        raise ValueError(f"{place[:200]} has {len(value)} characters; the limit is {LONGEST}")
    if "\0" in value:
        raise ValueError(f"{place[:200]} has a NUL character")
