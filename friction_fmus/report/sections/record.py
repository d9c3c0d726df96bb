"""Measured and simulated signals over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from friction_fmus.report.comparing import panels
from friction_fmus.report.figures import Plot, lines
from friction_fmus.report.views import axes, reversal
from friction_fmus.study.result import Picture, StudyResult

PLACE = 30
TITLE = "Record"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    return {"record_plots": record_plots(study)}


def record_plots(study: StudyResult) -> list[Plot]:
    """Return the plots of measured and simulated signals over time."""
    turn = reversal(study.record)
    plots = []
    for index, picture in enumerate(study.record):
        how = ", measured and simulated" if picture.data and picture.models else "" if picture.data else " by model"
        caption = f"{picture.y_label[:1].upper()}{picture.y_label[1:]} over time{how}."
        plots.append(_over_time(f"record-plot-{index + 1}", picture, caption, turn))
    return plots


def _over_time(name: str, picture: Picture, caption: str, turn: tuple[float, float] | None) -> Plot:
    titles, factors = axes(picture)
    views = {} if turn is None else {"around a reversal": turn}
    if not picture.data:
        return Plot(
            name, panels(picture.models, titles, factors), caption, f"Plot. {caption}", legend=False, views=views
        )
    figure = lines(picture.data, picture.models, titles, factors, height=330)
    return Plot(name, figure, caption, f"Plot. {caption}", views=views)
