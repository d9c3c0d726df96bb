"""Sections of the report: each has a template ``sections/name.html``, and a title here."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from friction_fmus.blocks.catalogue import listing
from friction_fmus.report.figures import (
    STYLES,
    Plot,
    Point,
    finished,
    ladder_dots,
    lines,
    panels,
    sweep,
    thinned,
    tradeoffs,
)
from friction_fmus.report.formatting import (
    NO_COMPENSATION,
    NONE,
    axes,
    label,
    multiple,
    number,
    quantity,
    reversal,
    unit,
)
from friction_fmus.study.model_ranking import ALIKE
from friction_fmus.study.recommendation import AS_MEASURED, improves
from friction_fmus.study.study_result import (
    CompensatorResult,
    Fit,
    ModelResult,
    Picture,
    StudyCurve,
    StudyResult,
    Trial,
)

#: Number of compensators whose errors are shown, in addition to the servo without compensation.
FIRST = 4

FAMILIES: Final = 6  # largest number of families of compensators that are compared

BELOW: Final = "The table below has the values."

UNCLAIMED: Final = "errors-not-claimed"
FIRST_FINDINGS: Final = (UNCLAIMED, "saturated")  # findings that come before everything else

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


def ranked(study: StudyResult) -> list[CompensatorResult]:
    """Return the co-simulated compensators by rank, after the servo without compensation."""
    none = [row for row in study.compensators if row.name == NONE and row.metrics is not None]
    rows = [row for row in study.compensators if row.rank is not None and row.metrics is not None and row.name != NONE]
    return none + sorted(rows, key=lambda row: row.rank or 0)


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
    if any(row.worst is not None for row in rows):
        plots["tradeoffs"] = _tradeoffs(study, rows, unit, factor)
    errors = {label(row.name): row.error for row in rows if row.error is not None}
    if errors:
        drawn = dict(list(errors.items())[: FIRST + 1])
        caption = "Tracking error over time without compensation and of the best compensators, with the same axes."
        figure = panels(drawn, ("time [s]", f"reference − position [{unit}]"), (1.0, factor))
        plots["errors"] = Plot("errors-plot", figure, caption, views=_views(study), legend=False)

    for name, title, value, caption in SWEEPS:
        sweeps = {label(row.name): curve for row in rows if len((curve := _tuning(row, value)).x) > 1}
        if sweeps:
            first = dict(list(sweeps.items())[: len(STYLES)])
            figure = sweep(first, (title, f"tracking error, rms [{unit}]"), factor)
            plots[name] = Plot(f"{name}-plot", figure, caption, BELOW)
    return plots


def _views(study: StudyResult) -> dict[str, tuple[float, float]]:
    """Return the ranges of time for which plots over time have a button."""
    turn = reversal(study.record)
    return {} if turn is None else {"around a reversal": turn}


def _tuning(row: CompensatorResult, value: Callable[[Trial], float | None]) -> StudyCurve:
    """Return the error over the tuned parameter; empty if it is another one."""
    tuned = [(at, trial.metrics.rms) for trial in row.trials if trial.metrics and (at := value(trial)) is not None]
    return StudyCurve(tuple(at for at, _ in sorted(tuned)), tuple(rms for _, rms in sorted(tuned)))


def _tradeoffs(study: StudyResult, rows: Sequence[CompensatorResult], unit: str, factor: float) -> Plot:
    points = [
        Point(label(row.name), row.kind if row.name != NONE else NO_COMPENSATION, factor * row.worst,
              row.metrics.effort_high, row.margins.Ms if row.margins else None, row.name == study.recommendation.name)
        for row in rows
        if row.metrics is not None and row.worst is not None
    ]  # fmt: skip
    limit = study.limits.Ms if study.limits else None
    caption = (
        f"Worst-case error against the drive {study.units.words.force} above the loop bandwidth, and against the peak "
        "of the sensitivity function; the dotted line is its limit. The dashed line connects the compensators that "
        "no other one beats in both. The large mark is the recommended one."
    )
    figure = tradeoffs(
        points, f"worst-case error, rms [{unit}]", f"{study.units.words.force} [{study.units.force}]", limit
    )
    return Plot("tradeoffs-plot", figure, caption, BELOW, curves=False)


def not_compared(study: StudyResult) -> dict[str, list[str]]:
    """Return the compensators that were not co-simulated or failed, by reason."""
    reasons: dict[str, list[str]] = {}
    for row in study.compensators:
        if not row.applies or row.metrics is None:
            reasons.setdefault(row.reason, []).append(label(row.name))
    return reasons


def friction_plots(study: StudyResult) -> list[Plot]:
    """Return the plots of friction over velocity and over displacement that have data."""
    plots = []
    for name, picture, what in (
        ("friction", study.friction, "Grey points: log. Lines: identified models."),
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
            caption += " The vertical axis shows the range of the log; the button “full range” shows all curves."
        plots.append(Plot(f"{name}-plot", figure, caption))
    return plots


def _span(picture: Picture) -> tuple[float, float] | None:
    """Return the range of the record with a margin if a model exceeds it by more than its size; otherwise None."""
    # The damping force of a bristle that starts in motion can be much larger than friction and would flatten all
    # curves.
    if not picture.data or not picture.models:
        return None
    low, high = (side(side(curve.y) for curve in picture.data.values()) for side in (min, max))
    lowest, highest = (side(side(curve.y) for curve in picture.models.values()) for side in (min, max))
    size = high - low
    if lowest >= low - size and highest <= high + size:
        return None
    return low - 0.3 * size, high + 0.3 * size


def friction_table(picture: Picture) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the friction of each model at evenly spaced velocities without 0, where it jumps."""
    (x_title, _), (x_factor, y_factor) = axes(picture)
    curves = {name: (np.asarray(curve.x), np.asarray(curve.y)) for name, curve in picture.models.items()}
    fastest = min((float(np.max(np.abs(x))) for x, _ in curves.values()), default=0.0)
    at = [v for v in np.linspace(-fastest, fastest, 9) if abs(v) > 1e-9 * fastest]
    cells = [
        [number(x_factor * v), *(number(y_factor * float(np.interp(v, x, y))) for x, y in curves.values())] for v in at
    ]
    return [x_title, *curves], cells if fastest else []


def _result(study: StudyResult) -> Mapping[str, Any]:
    """Return the verdict, the findings that come first, the error around a reversal, and what to do."""
    first = [each for each in study.findings if each.stops or each.name in FIRST_FINDINGS]
    return {
        "verdict": verdict(study),
        "first_findings": first,
        "others": [each.name for each in study.findings if not any(each.name in one.name + one.what for one in first)],
        "plot": _turn(study),
        "verify": f"{study.command.replace(' -o ', ' --verify after.csv -o ')}",
    }


def verdict(study: StudyResult) -> str:
    """Return the result of a study in a sentence."""
    done = study.recommendation
    if done.name in ("", NONE) or not study.ladder:
        return done.reason
    row, unit = study.compensator(done.name), study.units.position
    assert row.metrics is not None
    before, after = (quantity(each.rms, unit) for each in (study.ladder[0].metrics, row.metrics))
    worst = f", at most {quantity(row.worst, unit)} in the worst case" if row.worst is not None else ""
    claimed = all(each.name != UNCLAIMED for each in study.findings)
    where = "" if claimed else "On the identified axis, but not necessarily on the machine, "
    where = where if study.trusted else "The result cannot be trusted: on the identified axis, "
    return f"{where}{done.name} reduces the tracking error from {before} to {after} rms{worst}."


def _turn(study: StudyResult) -> Plot | None:
    """Return the plot of the tracking error around a reversal."""
    if study.turn is None:
        return None
    titles, factors = axes(study.turn)
    drawn = {label(name): curve for name, curve in study.turn.models.items()}
    measured = {name: drawn.pop(name) for name in [AS_MEASURED] if name in drawn}
    figure = lines(measured, drawn, titles, factors, height=280)
    caption = "Tracking error around a reversal, simulated on the identified axis."
    done = study.turn.models.get(study.recommendation.name)
    if done is not None and len(study.turn.models) > 1:
        (_, title), own = axes(replace(study.turn, models={"": done}))
        x, y = (np.asarray(each, dtype=np.float32) for each in thinned(done, own))
        figure.update_traces(selector={"meta": label(study.recommendation.name)}, x=x, y=y, yaxis="y2")
        figure.update_yaxes(domain=(0.56, 1.0), title=titles[1].removeprefix("tracking "))
        figure.update_layout(
            yaxis2={"domain": (0.0, 0.44), "title": title.removeprefix("tracking ")}, xaxis_anchor="y2"
        )
        finished(figure, 360)
        caption += " Below, with the recommended compensator, on a scale of its own."
    return Plot("turn-plot", figure, caption, curves=False)


def families(study: StudyResult) -> list[CompensatorResult]:
    """Return the best compensator of each kind."""
    best = {row.kind: row for row in reversed(ranked(study)) if row.name != NONE}
    return sorted(best.values(), key=lambda row: row.rank or 0)[:FAMILIES]


def _families(study: StudyResult) -> Mapping[str, Any]:
    """Return the best compensator of each kind, and the plot of the steps that reduce the error."""
    chosen = study.recommendation.name
    rungs = [
        rung
        for place, rung in enumerate(study.ladder)
        if not place or rung.name == chosen or improves(study.ladder[:place], rung)
    ]
    if not rungs:
        return {"families": families(study), "plot": None}
    errors = np.array([rung.metrics.rms for rung in rungs])
    caption = "Tracking error of the axis with each kind of compensation at its best. Blue: recommended."
    if study.ladder[0].name == "":
        caption += " All but the first include velocity and acceleration feedforward."
    names = [(rung.title, rung.name == chosen) for rung in rungs]
    figure = ladder_dots(names, errors, study.units.position)
    plot = Plot("ladder-plot", figure, caption, "The table has the values.", curves=False, legend=False)
    return {"families": families(study), "plot": plot}


def _plant(study: StudyResult) -> Mapping[str, Any]:
    """Return the model of the axis, the band in which the log supports it, and the resonance that is tolerated."""
    best = next((row for row in study.models if row.name == study.plant or (not study.plant and row.rank == 1)), None)
    row = next((row for row in study.compensators if row.name == study.recommendation.name), None)
    band = study.limits.band if study.limits else math.inf
    return {
        "best": best,
        "band": band if math.isfinite(band) else None,
        "tolerated": row.margins.resonance if row is not None and row.margins is not None else None,
    }


def record_plots(study: StudyResult, measured: bool) -> list[Plot]:
    """Return the plots over time that contain measured signals, or those of the models only."""
    plots = []
    for index, picture in enumerate(study.record):
        if bool(picture.data) != measured:
            continue
        how = ", measured and simulated" if picture.data and picture.models else "" if picture.data else " by model"
        caption = f"{picture.y_label[:1].upper()}{picture.y_label[1:]} over time{how}."
        titles, factors = axes(picture)
        if measured:
            figure = lines(picture.data, picture.models, titles, factors, height=330)
        else:
            figure = panels(picture.models, titles, factors)
        plots.append(Plot(f"record-plot-{index + 1}", figure, caption, legend=measured, views=_views(study)))
    return plots


def _servo(study: StudyResult) -> Mapping[str, Any]:
    """Return the plot of recorded and commanded force; None if they were not compared."""
    check = study.servo_check
    if check.recorded is None or check.commanded is None:
        return {"plot": None}
    titles = ("time [s]", f"drive {study.units.words.force} [{unit(study.units.force)}]")
    figure = lines({"logged": check.recorded}, {"commanded by the servo": check.commanded}, titles, height=330)
    caption = (
        f"Recorded drive {study.units.words.force}, and the {study.units.words.force} that the servo commands "
        "for the logged reference and position."
    )
    return {"plot": Plot("servo-plot", figure, caption)}


def sources(study: StudyResult) -> list[tuple[str, str]]:
    """Return name and source of each block of the catalogue used by the study."""
    known = listing()
    names = [row.name for row in study.models if row.rank is not None] + [
        row.name for row in study.compensators if row.applies
    ]
    return [(name, known[name].source) for name in dict.fromkeys(names) if name in known]


def residual_plots(study: StudyResult) -> list[Plot]:
    """Return the plots of the force residual over velocity and position, with a panel for each of the best models."""
    plots = []
    for picture in study.residuals:
        titles, factors = axes(picture)
        force = study.units.words.force
        caption = f"Simulated minus measured drive {force} over {picture.x_label}, in the co-simulated servo."
        figure = panels(picture.models, titles, factors, dots=True)
        plots.append(Plot(f"residual-{picture.x_label}", figure, caption, curves=False, legend=False))
    return plots


def scores(models: Sequence[ModelResult]) -> dict[str, dict[str, Any]]:
    """Return the formatted scores of the identified models; information criteria less the lowest for a signal."""
    lowest: dict[tuple[str, tuple[str, str]], float] = {}
    for row in models:
        for name, value in (("aic", row.aic), ("bic", row.bic)):
            if value is not None:
                key = (name, _fitted(row))
                lowest[key] = min(value, lowest.get(key, value))

    def above(row: ModelResult, name: str, value: float | None) -> str:
        return number(None) if value is None else f"{value - lowest[name, _fitted(row)]:.0f}"

    return {
        row.name: {
            "validation": _percent(row.validation),
            "train": _percent(row.train),
            "aic": above(row, "aic", row.aic),
            "bic": above(row, "bic", row.bic),
            "closed_loop": {fit.signal: _residual(fit) for fit in row.closed_loop},
        }
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


@dataclass(frozen=True)
class Section:
    """A section of the report."""

    title: str
    values: Callable[[StudyResult], Mapping[str, Any]] = lambda study: {}
    """What the template needs in addition to ``study``."""
    folded: bool = False  # whether the reader opens the section
    compares: bool = False  # whether it is left out of a study that compared no compensators


SECTIONS: Final[Mapping[str, Section]] = {
    "result": Section("Result", _result),
    "what_if": Section("What if the axis changes", compares=True),
    "families": Section("Best compensator of each family", _families, compares=True),
    "plant": Section("The axis, and the band in which the log supports it", _plant),
    "record": Section("Log", lambda study: {"record_plots": record_plots(study, True)}),
    "compensators": Section(
        "All compensators",
        lambda study: {
            **dict(zip(("error_unit", "factor"), error_unit(study), strict=True)),
            "ranked": ranked(study),
            "plots": compensator_plots(study),
            "not_compared": not_compared(study),
        },
        folded=True,
        compares=True,
    ),
    "servo": Section("Do the configured gains match the log?", _servo, folded=True),
    "models": Section(
        "Models",
        lambda study: {
            "scores": scores(study.models),
            "alike": ALIKE,
            "residual_plots": [*record_plots(study, False), *residual_plots(study)],
        },
        folded=True,
    ),
    "friction": Section(
        "Friction curve and hysteresis",
        lambda study: {
            "friction_plots": friction_plots(study),
            "friction_table": study.friction and friction_table(study.friction),
        },
        folded=True,
    ),
    "conditions": Section("Conditions of the loop", folded=True, compares=True),
    "files": Section("Files", folded=True),
    "again": Section("Reproduction", folded=True),
    "sources": Section("Citations", lambda study: {"sources": sources(study)}, folded=True),
}
"""The sections by name, in their order."""
