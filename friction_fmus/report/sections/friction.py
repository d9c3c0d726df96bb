"""Friction over velocity and over displacement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friction_fmus.report.figures import Plot, lines
from friction_fmus.report.numbers import number
from friction_fmus.report.views import axes
from friction_fmus.study.result import Picture, StudyResult

PLACE = 50
TITLE = "Friction curve and hysteresis"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    return {
        "friction_plots": friction_plots(study),
        "friction_table": None if study.friction is None else friction_table(study.friction),
    }


def friction_plots(study: StudyResult) -> list[Plot]:
    """Return the plots of friction over velocity and over displacement that have data."""
    plots = []
    for name, picture, what in (
        ("friction", study.friction, "Grey points: record. Lines: identified models."),
        ("hysteresis", study.hysteresis, "Record and models, with the same motion around a reversal."),
    ):  # fmt: skip
        if picture is None:
            continue
        caption = f"{picture.y_label[:1].upper()}{picture.y_label[1:]} over {picture.x_label}. {what}"
        titles, factors = axes(picture)
        seen = [row.name for row in study.models if row.name in picture.models][:4]
        figure = lines(picture.data, picture.models, titles, factors, name == "friction", seen)
        if (span := _span(picture)) is not None:
            figure.update_yaxes(range=[factors[1] * value for value in span])
            caption += " The vertical axis shows the range of the record; the button “full range” shows all curves."
        plots.append(Plot(f"{name}-plot", figure, caption, f"Plot. {caption}"))
    return plots


def _span(picture: Picture, margin: float = 0.3) -> tuple[float, float] | None:
    """Return the range of the record with a margin if a model exceeds it by more than its size; otherwise None.

    The damping force of a bristle that starts in motion can be much larger than friction and would flatten all curves.
    """
    if not picture.data or not picture.models:
        return None
    low, high = (side(side(curve.y) for curve in picture.data.values()) for side in (min, max))
    lowest, highest = (side(side(curve.y) for curve in picture.models.values()) for side in (min, max))
    size = high - low
    if lowest >= low - size and highest <= high + size:
        return None
    return low - margin * size, high + margin * size


def friction_table(picture: Picture, rows: int = 9) -> tuple[list[str], list[list[str]]]:
    """Return column headings and rows of friction at some velocities, one column for each model.

    The velocities are evenly spaced over the curves, without zero, where friction jumps.
    """
    (x_title, _), (x_factor, y_factor) = axes(picture)
    curves = {name: (np.asarray(curve.x), np.asarray(curve.y)) for name, curve in picture.models.items()}
    fastest = min((float(np.max(np.abs(x))) for x, _ in curves.values()), default=0.0)
    at = [v for v in np.linspace(-fastest, fastest, rows) if abs(v) > 1e-9 * fastest]
    cells = [
        [number(x_factor * v), *(number(y_factor * float(np.interp(v, x, y))) for x, y in curves.values())] for v in at
    ]
    return [x_title, *curves], cells if fastest else []
