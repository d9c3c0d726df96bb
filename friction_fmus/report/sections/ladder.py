"""Ladder: the axis as it is, and what each kind of compensation gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friction_fmus.report.comparing import ladder_bars
from friction_fmus.report.figures import Plot
from friction_fmus.report.numbers import multiple
from friction_fmus.study.result import StudyResult

PLACE = 15
TITLE = "From the axis as it is to the best compensation"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    if not study.ladder:
        return {"plot": None}
    errors = np.array([rung.metrics.rms for rung in study.ladder])
    unit, factor = multiple(study.units.position, errors[-1:])
    caption = (
        "Tracking error of the axis as it was measured, and with each kind of compensation at its best; the scale is "
        "logarithmic. Every rung except the first has motion feedforward. Blue: recommended."
        if study.ladder[0].name == ""
        else "Tracking error with each kind of compensation at its best; the scale is logarithmic."
    )
    rungs = [(rung.title, rung.name == study.recommendation.name) for rung in study.ladder]
    figure = ladder_bars(rungs, factor * errors, f"tracking error, rms [{unit}]")
    return {
        "plot": Plot("ladder-plot", figure, caption, f"Bar chart. {caption} The table has the values.", False, False)
    }
