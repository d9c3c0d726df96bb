"""Names, axes and time spans used by several sections of the report."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from friction_fmus.report.formatting import multiple
from friction_fmus.study.study_result import Picture

NONE = "none"
NO_COMPENSATION = "no compensation"


def label(name: str) -> str:
    """Return the name of a compensator in the report."""
    return NO_COMPENSATION if name == NONE else name


def axes(picture: Picture) -> tuple[tuple[str, str], tuple[float, float]]:
    """Return the titles of the axes, and the factors that convert the curves to the units of the titles."""
    curves = [*picture.data.values(), *picture.models.values()]
    titles, factors = [], []
    for text, unit, columns in (
        (picture.x_label, picture.x_unit, [curve.x for curve in curves]),
        (picture.y_label, picture.y_unit, [curve.y for curve in curves]),
    ):
        shown, factor = multiple(unit, np.concatenate([np.asarray(column, dtype=float) for column in columns]))
        if unit == "s":
            shown, factor = "s", 1.0
        titles.append(f"{text} [{shown}]" if shown else text)
        factors.append(factor)
    return (titles[0], titles[1]), (factors[0], factors[1])


def reversal(record: Sequence[Picture], part: float = 0.04, end: float = math.inf) -> tuple[float, float] | None:
    """Return a time span around the reversal nearest to the middle of a record; None without one before the end [s]."""
    for picture in record:
        curve = next((curve for name, curve in picture.data.items() if "reference" in name), None)
        count = 0 if curve is None else bisect_right(curve.x, end)
        if curve is None or count < 3:
            continue
        x, y = np.asarray(curve.x[:count]), np.asarray(curve.y[:count])
        moving = np.flatnonzero(np.diff(y))
        turns = x[moving[1:][np.diff(np.sign(np.diff(y)[moving])) != 0]]
        if turns.size:
            centre = float(turns[np.argmin(np.abs(turns - 0.5 * (x[0] + x[-1])))])
            half = 0.5 * part * float(x[-1] - x[0])
            return centre - half, centre + half
    return None
