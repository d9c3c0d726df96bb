"""Compensators: errors, margins, effort, cost and worst cases, and compensators that were not compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from friction_fmus.report.comparing import Point, panels, tradeoffs
from friction_fmus.report.figures import ROWS, STYLES, Bar, Plot, bars, sweep
from friction_fmus.report.numbers import multiple
from friction_fmus.report.views import NO_COMPENSATION, NONE, label, reversal
from friction_fmus.study.ranking import figures
from friction_fmus.study.result import CompensatorResult, Curve, StudyResult, Trial

#: Number of compensators whose errors are shown, in addition to the servo without compensation.
FIRST = 4

#: Plots of the tuning: name, title of the axis, tuned parameter of a trial, caption.
SWEEPS: tuple[tuple[str, str, Callable[[Trial], float | None], str], ...] = (
    (
        "gains",
        "gain",
        lambda trial: trial.gain if trial.bandwidth is None else None,
        "Tracking error over the gain of the compensation, as far as the limits on the margins allow. Gain 1 applies "
        "the full friction estimate; a minimum below 1 indicates over-compensation.",
    ),
    (
        "bandwidths",
        "bandwidth [Hz]",
        lambda trial: trial.bandwidth,
        "Tracking error over the bandwidth of estimators and of integral action, up to the limits on the margins.",
    ),
)

PLACE = 20
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
        "figures": scored(study),
    }


def ranked(study: StudyResult) -> list[CompensatorResult]:
    """Return the co-simulated compensators by rank, after the servo without compensation."""
    none = [row for row in study.compensators if row.name == NONE and row.metrics is not None]
    rows = [row for row in study.compensators if row.rank is not None and row.metrics is not None and row.name != NONE]
    return none + sorted(rows, key=lambda row: row.rank or 0)


def scored(study: StudyResult) -> dict[str, tuple[float, float, float, float]]:
    """Return the four figures of the score of each compensator that has them, by name; see `figures`."""
    rows = ranked(study)
    if not rows or rows[0].name != NONE or rows[0].worst is None or study.limits is None:
        return {}
    return {row.name: figures(rows[0], row, study.limits.Ms) for row in rows if row.worst is not None}


def error_unit(study: StudyResult) -> tuple[str, float]:
    """Return the unit of the tracking errors, and the factor from the position unit to it."""
    return multiple(study.units.position, np.array([row.metrics.rms for row in ranked(study) if row.metrics]))


def compensator_plots(study: StudyResult) -> dict[str, Plot]:
    """Return the plots of the compensators that have data, by name."""
    rows = ranked(study)
    plots: dict[str, Plot] = {}
    if not rows:
        return plots
    unit, factor = error_unit(study)
    plots["bars"] = _bars(study, rows, unit, factor)
    plots["tradeoffs"] = _tradeoffs(study, rows, unit, factor)

    errors = {label(row.name): row.error for row in rows if row.error is not None}
    if errors:
        drawn = dict(list(errors.items())[: FIRST + 1])
        caption = "Tracking error over time without compensation and of the best compensators, with the same axes."
        figure = panels(drawn, ("time [s]", f"reference − position [{unit}]"), (1.0, factor))
        turn = reversal(study.record)
        views = {} if turn is None else {"around a reversal": turn}
        plots["errors"] = Plot("errors-plot", figure, caption, f"Plot. {caption}", views=views, legend=False)

    for name, title, value, caption in SWEEPS:
        sweeps = _drawn({label(row.name): curve for row in rows if len((curve := _tuning(row, value)).x) > 1})
        if sweeps:
            figure = sweep(sweeps, (title, f"tracking error, rms [{unit}]"), factor)
            plots[name] = Plot(f"{name}-plot", figure, caption, f"Plot. {caption} The table below has the values.")
    return plots


def _tuning(row: CompensatorResult, value: Callable[[Trial], float | None]) -> Curve:
    """Return the error over the tuned parameter; empty if it is another one."""
    tuned = [(at, trial.metrics.rms) for trial in row.trials if trial.metrics and (at := value(trial)) is not None]
    return Curve(tuple(at for at, _ in sorted(tuned)), tuple(rms for _, rms in sorted(tuned)))


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
            Bar(label(row.name), factor * rms, factor * min(low, rms), factor * max(high, rms),
                emphasis.get(row.name, ""))
        )  # fmt: skip
    caption = (
        "Tracking error on the identified axis; the whiskers show the smallest and largest error in the cases that "
        "count. Blue: recommended; hatched: runner-up."
    ) + (f" Only the first {ROWS} are shown." if len(rows) > ROWS else "")
    figure = bars(shown, f"tracking error, rms [{unit}]")
    return Plot("bars-plot", figure, caption, f"Bar chart. {caption} The table below has the values.", False, False)


def _tradeoffs(study: StudyResult, rows: Sequence[CompensatorResult], unit: str, factor: float) -> Plot:
    points = [
        Point(label(row.name), row.kind if row.name != NONE else NO_COMPENSATION, factor * row.worst,
              row.metrics.effort_high, row.margins.Ms if row.margins else None, row.name == study.recommendation.name)
        for row in rows
        if row.metrics is not None and row.worst is not None
    ]  # fmt: skip
    limit = study.limits.Ms if study.limits else None
    caption = (
        "Worst-case error against the drive force above the loop bandwidth, and against the peak of the sensitivity "
        "function; the dotted line is its limit. The dashed line connects the compensators that no other one beats in "
        "both. The large mark is the recommended one."
    )
    figure = tradeoffs(points, f"worst-case error, rms [{unit}]", f"force [{study.units.force}]", limit)
    return Plot("tradeoffs-plot", figure, caption, f"Plot. {caption} The table below has the values.", False)


def not_compared(study: StudyResult) -> dict[str, list[str]]:
    """Return the compensators that were not co-simulated or failed, by reason."""
    reasons: dict[str, list[str]] = {}
    for row in study.compensators:
        if not row.applies or row.metrics is None:
            reasons.setdefault(row.reason, []).append(label(row.name))
    return reasons
