"""What only `nightly.sh` runs in full, with ``THOROUGH=1``; other runs have a selection."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

_T = TypeVar("_T")
THOROUGH = bool(os.environ.get("THOROUGH"))


def some(every: Sequence[_T], chosen: Sequence[_T]) -> Sequence[_T]:
    """Return all cases each night, and the chosen ones otherwise."""
    return every if THOROUGH else chosen
