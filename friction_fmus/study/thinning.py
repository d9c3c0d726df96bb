"""Decimation of curves for plots."""

from __future__ import annotations

from typing import Final

import numpy as np

from friction_fmus.identification import Array
from friction_fmus.study.records import Curve

POINTS: Final = 1500
"""Approximate number of points of a stored curve over time."""


def thinned(x: Array, y: Array, points: int = POINTS) -> Curve:
    """Return a decimated curve with the minimum and maximum of each interval, so that peaks are kept."""
    width = -(-2 * len(y) // points)
    if width <= 2:
        return Curve(tuple(x.tolist()), tuple(y.tolist()))
    kept: list[int] = [0]
    for begin in range(0, len(y), width):
        interval = y[begin : begin + width]
        kept += sorted({begin + int(np.argmin(interval)), begin + int(np.argmax(interval))})
    places = np.unique([*kept, len(y) - 1])
    return Curve(tuple(x[places].tolist()), tuple(y[places].tolist()))
