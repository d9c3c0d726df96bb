"""Compensators: tracking errors, gains, worst cases, and compensators that were not compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from friction_fmus.report.figures import ROWS, STYLES, Bar, Plot, bars, lines, sweep
from friction_fmus.report.numbers import multiple
from friction_fmus.report.views import NO_COMPENSATION, NONE, label, mismatch, reversal
from friction_fmus.study.result import CompensatorResult, Curve, StudyResult

#: Number of compensators whose errors are initially visible, in addition to the servo without compensation.
FIRST = 2

PLACE = 50
TITLE = "Compensators"


def content(study: StudyResult) -> Mapping[str, Any]:
    """Return the values that the template needs in addition to the study."""
    unit, factor = error_unit(study)
    return {
        "ranked": ranked(study),
        "plots": compensator_plots(study),
        "error_unit": unit,
        "factor": factor,
        "not_compared": not_compared(study),
        "off": mismatch(study),
    }


def ranked(study: StudyResult) -> list[CompensatorResult]:
    """Return the co-simulated compensators by rank, after the servo without compensation."""
    none = [row for row in study.compensators if row.name == NONE and row.metrics is not None]
    rows = [row for row in study.compensators if row.rank is not None and row.metrics is not None and row.name != NONE]
    return none + sorted(rows, key=lambda row: row.rank or 0)


def error_unit(study: StudyResult) -> tuple[str, float]:
    """Return the unit of the tracking errors, and the factor from the position unit to it."""
    return multiple(study.units.position, np.array([row.metrics.rms for row in ranked(study) if row.metrics]))


def compensator_plots(study: StudyResult) -> dict[str, Plot]:
    """Return the plots of the compensators that have data, by the names "bars", "errors" and "sweep"."""
    rows = ranked(study)
    plots: dict[str, Plot] = {}
    if not rows:
        return plots
    unit, factor = error_unit(study)
    plots["bars"] = _bars(study, rows, unit, factor)

    errors = {label(row.name): row.error for row in rows if row.error is not None}
    if errors:
        without = {name: curve for name, curve in errors.items() if name == NO_COMPENSATION}
        laws = _drawn({name: curve for name, curve in errors.items() if name != NO_COMPENSATION})
        caption = (
            "Tracking error over time of the best compensators at their best gain. Click a name in the legend to show "
            "or hide its curve."
        )
        figure = lines(
            without, laws, ("time [s]", f"reference − position [{unit}]"), (1.0, factor), seen=list(laws)[:FIRST]
        )
        turn = reversal(study.record)
        views = {} if turn is None else {"around a reversal": turn}
        plots["errors"] = Plot("errors-plot", figure, caption, f"Plot. {caption}", views=views)

    sweeps = _drawn(
        {
            label(row.name): Curve(
                tuple(point.gain for point in row.sweep if point.metrics),
                tuple(point.metrics.rms for point in row.sweep if point.metrics),
            )
            for row in rows
            if len([point for point in row.sweep if point.metrics]) > 1
        }
    )
    if sweeps:
        caption = (
            "Tracking error of the best compensators over the gain of the compensation. Gain 1 applies the full "
            "friction estimate; a minimum below 1 indicates over-compensation."
        )
        figure = sweep(sweeps, ("gain", f"tracking error, rms [{unit}]"), factor)
        plots["sweep"] = Plot("sweep-plot", figure, caption, f"Plot. {caption} The table below has the values.")
    return plots


def _drawn(curves: Mapping[str, Curve]) -> dict[str, Curve]:
    """Return the first curves, one for each line style."""
    return dict(list(curves.items())[: len(STYLES)])


def _bars(study: StudyResult, rows: Sequence[CompensatorResult], unit: str, factor: float) -> Plot:
    emphasis = {study.recommendation.name: "best", study.recommendation.runner_up: "second"}
    shown = []
    for row in rows[:ROWS]:
        assert row.metrics is not None
        rms = row.metrics.rms
        low, high = (rms if value is None else value for value in (row.best, row.worst))
        shown.append(
            Bar(label(row.name), factor * rms, factor * min(low, rms), factor * max(high, rms), row.cost_ns,
                emphasis.get(row.name, ""))
        )  # fmt: skip
    caption = (
        "Left: tracking error at the best gain; the whiskers show the smallest and largest error with wrong friction "
        "and mass. Right: computing time per sample. Blue: recommended; hatched: runner-up."
    ) + (f" Only the first {ROWS} are shown." if len(rows) > ROWS else "")
    figure = bars(shown, (f"error, rms [{unit}]", "cost [ns]"))
    return Plot("bars-plot", figure, caption, f"Bar chart. {caption} The table below has the values.", False)


def not_compared(study: StudyResult) -> dict[str, list[str]]:
    """Return the compensators that were not co-simulated or failed, by reason."""
    reasons: dict[str, list[str]] = {}
    for row in study.compensators:
        if not row.applies or row.metrics is None:
            reasons.setdefault(row.reason, []).append(label(row.name))
    return reasons
