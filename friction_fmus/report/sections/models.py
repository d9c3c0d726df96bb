"""Identified models with their scores and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from friction_fmus.report.comparing import panels
from friction_fmus.report.figures import Plot
from friction_fmus.report.numbers import number, quantity
from friction_fmus.report.views import axes
from friction_fmus.study.models import ALIKE
from friction_fmus.study.result import Fit, ModelResult, StudyResult

PLACE = 40
TITLE = "Models"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    return {"scores": scores(study.models), "alike": ALIKE, "residual_plots": residual_plots(study)}


def residual_plots(study: StudyResult) -> list[Plot]:
    """Return the plots of the force residual over velocity and position, with a panel for each of the best models."""
    plots = []
    for picture in study.residuals:
        titles, factors = axes(picture)
        caption = f"Simulated minus measured drive force over {picture.x_label}, in the co-simulated servo."
        figure = panels(picture.models, titles, factors, dots=True)
        plots.append(Plot(f"residual-{picture.x_label}", figure, caption, f"Plot. {caption}", False, False))
    return plots


@dataclass(frozen=True)
class Score:
    """Formatted scores of a model."""

    validation: str
    train: str
    """Residual in percent; a dash if there is none."""
    aic: str
    bic: str
    """Information criteria minus the lowest one of all models fitted to the same signal."""
    closed_loop: Mapping[str, str]
    """Residuals of the co-simulated servo, by signal."""


def scores(models: Sequence[ModelResult]) -> dict[str, Score]:
    """Return the scores of the identified models, by name."""
    lowest: dict[tuple[str, tuple[str, str]], float] = {}
    for row in models:
        for name, value in (("aic", row.aic), ("bic", row.bic)):
            if value is not None:
                key = (name, _fitted(row))
                lowest[key] = min(value, lowest.get(key, value))

    def above(row: ModelResult, name: str, value: float | None) -> str:
        return number(None) if value is None else f"{value - lowest[name, _fitted(row)]:.0f}"

    return {
        row.name: Score(
            _percent(row.validation),
            _percent(row.train),
            above(row, "aic", row.aic),
            above(row, "bic", row.bic),
            {fit.signal: _residual(fit) for fit in row.closed_loop},
        )
        for row in models
        if row.rank is not None
    }


def _fitted(row: ModelResult) -> tuple[str, str]:
    return ("", "") if row.train is None else (row.train.signal, row.train.unit)


def _percent(fit: Fit | None) -> str:
    return number(None) if fit is None else f"{number(fit.percent)} %"


def _residual(fit: Fit) -> str:
    """Return a residual, also in percent unless that is negligible, as for a position relative to its travel."""
    return quantity(fit.rms, fit.unit) + (f" ({_percent(fit)})" if fit.percent >= 0.1 else "")
