"""Plots and derived numbers that the report shows for the result of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from friction_fmus.study.result import CompensatorResult, Curve, Fit, ModelResult, Picture, StudyResult

from .figures import ROWS, STYLES, Bar, Plot, bars, lines, sweep
from .numbers import multiple, number, quantity

#: Number of compensators whose errors are initially visible, in addition to the servo without compensation.
FIRST = 2
NONE = "none"
NO_COMPENSATION = "no compensation"


@dataclass(frozen=True)
class Score:
    """Formatted scores of a model.

    Attributes
    ----------
    validation, train : str
        Residual in percent; a dash if there is none.
    aic, bic : str
        Information criteria minus the lowest one of all models fitted to the same signal.
    closed_loop : mapping of str to str
        Residuals of the co-simulated servo, by signal.
    """

    validation: str
    train: str
    aic: str
    bic: str
    closed_loop: Mapping[str, str]


def label(name: str) -> str:
    """Return the name of a compensator in the report."""
    return NO_COMPENSATION if name == NONE else name


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


def record_plots(study: StudyResult) -> list[Plot]:
    """Return the plots of measured and simulated signals over time."""
    turn = _reversal(study.record)
    plots = []
    for index, picture in enumerate(study.record):
        how = ", measured and simulated" if picture.data and picture.models else "" if picture.data else " by model"
        caption = f"{picture.y_label[:1].upper()}{picture.y_label[1:]} over time{how}."
        plots.append(_over_time(f"record-plot-{index + 1}", picture, caption, turn))
    return plots


def _over_time(name: str, picture: Picture, caption: str, turn: tuple[float, float] | None) -> Plot:
    titles, factors = _axes(picture)
    figure = lines(picture.data, picture.models, titles, factors, height=330)
    views = {} if turn is None else {"around a reversal": turn}
    return Plot(name, figure, caption, f"Plot. {caption}", views=views)


def _axes(picture: Picture) -> tuple[tuple[str, str], tuple[float, float]]:
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


def _reversal(record: Sequence[Picture], part: float = 0.04) -> tuple[float, float] | None:
    """Return a time span around the reversal nearest to the middle of the record; None without a reversal."""
    for picture in record:
        curve = next((curve for name, curve in picture.data.items() if "reference" in name), None)
        if curve is None or len(curve.x) < 3:
            continue
        x, y = np.asarray(curve.x), np.asarray(curve.y)
        moving = np.flatnonzero(np.diff(y))
        turns = x[moving[1:][np.diff(np.sign(np.diff(y)[moving])) != 0]]
        if turns.size:
            centre = float(turns[np.argmin(np.abs(turns - 0.5 * (x[0] + x[-1])))])
            half = 0.5 * part * float(x[-1] - x[0])
            return centre - half, centre + half
    return None


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
        titles, factors = _axes(picture)
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
    (x_title, _), (x_factor, y_factor) = _axes(picture)
    curves = {name: (np.asarray(curve.x), np.asarray(curve.y)) for name, curve in picture.models.items()}
    fastest = min((float(np.max(np.abs(x))) for x, _ in curves.values()), default=0.0)
    at = [v for v in np.linspace(-fastest, fastest, rows) if abs(v) > 1e-9 * fastest]
    cells = [
        [number(x_factor * v), *(number(y_factor * float(np.interp(v, x, y))) for x, y in curves.values())] for v in at
    ]
    return [x_title, *curves], cells if fastest else []


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
        turn = _reversal(study.record)
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
