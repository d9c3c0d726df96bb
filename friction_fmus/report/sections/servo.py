"""Comparison of the servo as configured with the recorded drive force, and all findings about the result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.report.figures import Plot, lines
from friction_fmus.report.numbers import unit
from friction_fmus.study.result import StudyResult

PLACE = 25
TITLE = "Does the servo reproduce the record?"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the plot of recorded and commanded force; None if they were not compared."""
    check = study.servo_check
    if check.recorded is None or check.commanded is None:
        return {"plot": None}
    titles = ("time [s]", f"drive force [{unit(study.units.force)}]")
    figure = lines({"recorded": check.recorded}, {"commanded by the servo": check.commanded}, titles, height=330)
    caption = "Recorded drive force, and the force that the servo commands for the recorded reference and position."
    return {"plot": Plot("servo-plot", figure, caption, f"Plot. {caption}")}
