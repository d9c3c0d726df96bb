"""BibTeX entries of the literature that blocks cite, from ``bibliography.bib``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from friction_fmus.errors import FrictionError, nearest

FILE = Path(__file__).with_name("bibliography.bib")


@cache
def bibliography() -> dict[str, str]:
    """Return the entries of ``bibliography.bib`` by key."""
    entries = re.findall(r"^(@\w+\{(\w+),.*?^\})$", FILE.read_text(encoding="utf-8"), re.M | re.S)
    return {key: entry for entry, key in entries}


def cited(keys: Iterable[str]) -> tuple[str, ...]:
    """Return the entries that a block cites."""
    known = bibliography()
    found = []
    for key in keys:
        if not key.startswith("@") and key not in known:
            raise FrictionError(
                f"the block cites {key!r}, which is not in bibliography.bib{nearest(key, known)}; correct the key, or "
                "give the BibTeX entry itself"
            )
        found.append(known.get(key, key))
    return tuple(found)
