"""Training and validation data of a record without windows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from friction_fmus.identification.data.record import Record
from friction_fmus.identification.data.sampling import SHORTEST

TRAIN: Final = 0.6
"""Fraction of a record that is fitted; the rest is validation data."""


def default_windows(records: Sequence[Record]) -> dict[str, tuple[float, float]]:
    """Return the windows of records for which none are given."""
    begin, end = float(records[0].t[0]), float(records[-1].t[-1])
    middle = begin + TRAIN * (end - begin)

    def enough(low: float, high: float) -> bool:
        return any(np.count_nonzero((r.t >= low) & (r.t <= high)) >= SHORTEST for r in records)

    if not (enough(begin, middle) and enough(middle, end)):
        return {"train": (begin, end)}
    return {"train": (begin, middle), "validation": (middle, end)}
