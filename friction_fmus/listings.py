"""Results as one line and as tables, for terminal, notebook and report, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from harness.notebook import Listing, counted

if TYPE_CHECKING:
    from friction_fmus.identification.identification_result import Identification
    from friction_fmus.identification.model_comparison import ModelComparison
    from friction_fmus.study.study_result import Fit, StudyResult


LEAST_PERCENT = 1e-3


def identification_text(result: Identification) -> str:
    """Return an identification as one line."""
    return f"<Identification of {result.model}: {counted(len(result.parameters), 'parameter')}, {_error(result)}>"


def identification_html(result: Identification) -> str:
    """Return the parameters of an identification as a table."""
    weak = Listing("Poorly identifiable", ("parameter", "because"), [*result.weak.items()])
    return parameter_listing(result).html() + (weak.html() if result.weak else "")


def parameter_listing(result: Identification) -> Listing:
    """Return the parameters of an identification, with the digits that their standard errors justify."""
    rows = [
        (
            name,
            _digits(one.value, one.standard_error),
            f"{one.standard_error:.2g}" if math.isfinite(one.standard_error) else "unknown",
            _unit(one.unit),
            "poorly identifiable" if name in result.weak else "",
        )
        for name, one in result.parameters.items()
    ]
    headings = ("parameter", " value", " standard error", "unit", "")
    return Listing(f"{result.model} by {result.method}, {_error(result)}", headings, rows)


def comparison_text(comparison: ModelComparison) -> str:
    """Return a comparison of models as one line."""
    names = ", ".join(result.model for result in comparison.results)
    return f"<ModelComparison of {counted(len(comparison.results), 'model')} by {comparison.ranked_by}: {names}>"


def comparison_html(comparison: ModelComparison) -> str:
    """Return the models of a comparison as a table, best first."""
    failed = Listing("Not identified", ("model", "reason"), [*comparison.failed.items()])
    return ranking_listing(comparison).html() + (failed.html() if comparison.failed else "")


def ranking_listing(comparison: ModelComparison) -> Listing:
    """Return the ranked models with their errors."""
    unit = f"\n[{comparison.results[0].unit}]" if _unit(comparison.results[0].unit) else ""
    numbers = (f" error{unit}", " training\n[%]", " validation\n[%]", " BIC", " poorly determined\nparameters", " time")
    rows = [
        (
            result.model,
            result.method,
            f"{(result.validation or result.train).rms:.4g}",
            f"{result.train.relative_percent:.2f}",
            f"{result.validation.relative_percent:.2f}" if result.validation else "",
            f"{result.bic:.0f}",
            f"{len(result.weak)} of {len(result.parameters)}" if result.weak else "",
            f"{result.seconds:.1f} s",
        )
        for result in comparison.results
    ]
    return Listing(f"Models by {comparison.ranked_by}", ("model", "method", *numbers), rows)


def study_text(result: StudyResult) -> str:
    """Return a study as one line."""
    models = counted(len(result.models), "model")
    compensators = counted(len(result.compensators), "compensator")
    return f"<StudyResult {result.name!r}: {models}, {compensators}, recommendation: {_recommended(result)}>"


def study_html(result: StudyResult) -> str:
    """Return the recommendation, the models and the compensators of a study."""
    left = [(row.name, row.reason) for row in result.models if row.rank is None]
    left += [(row.name, row.reason) for row in result.compensators if row.rank is None or not row.improves]
    return (
        f"<p><strong>Recommendation: {escape(_recommended(result))}</strong></p>"
        f"<p>{escape(result.recommendation.reason)}</p>"
        f"{model_listing(result).html()}{compensator_listing(result).html()}"
        f"{Listing('Without a rank', ('name', 'note'), left).html() if left else ''}"
    )


def model_listing(result: StudyResult) -> Listing:
    """Return the friction models of a study by rank."""
    words = result.units.words
    loop = any(row.closed_loop for row in result.models)
    # one kind of residual for all models: of the validation data if there are any
    validated = any(row.validation is not None for row in result.models)
    fits = {row.name: row.validation if validated else row.train for row in result.models}
    signal = next((fit.signal for fit in fits.values() if fit is not None), "")
    rows = []
    for row in result.models:
        if row.rank is None:
            continue
        cells = [str(row.rank), row.name, _percent(fits[row.name])]
        if loop:
            by_signal = {fit.signal: fit for fit in row.closed_loop}
            position = by_signal.get("position")
            cells += [shown(position.rms, position.unit) if position else "–", _percent(by_signal.get("force"))]
        rows.append((*cells, ", ".join(p.name for p in row.parameters if p.weak)))
    residual = f" {words.signal(signal)} residual,\n{'validation' if validated else 'training'} data"
    errors = (" closed loop:\nposition error", f" {words.force}\nerror") if loop else ()
    headings = ("", "model", residual, *errors, "poorly\nidentifiable")
    return Listing(f"Friction models of {result.name}", headings, rows)


def ladder_listing(result: StudyResult) -> Listing:
    """Return the rungs from the axis as measured to the best compensation."""
    unit = result.units.position
    rows = [
        (
            rung.title,
            "" if rung.name in ("", "none") else rung.name,
            shown(rung.metrics.rms, unit),
            shown(rung.metrics.largest, unit),
        )
        for rung in result.ladder
    ]
    headings = ("servo", "compensator", " tracking\nerror", " largest")
    return Listing("From the axis as it is to the best compensation", headings, rows)


def compensator_listing(result: StudyResult) -> Listing:
    """Return the compensators of a study by rank, after the servo without compensation."""
    unit, words = result.units.position, result.units.words
    rows = [
        (
            row.rank,
            "none" if row.name == "none" else f"{row.name}{'' if row.improves else ' (no improvement)'}",
            f"{row.bandwidth:.3g} Hz" if row.bandwidth is not None else "" if row.gain is None else f"{row.gain:g}",
            shown(row.metrics.rms, unit),
            "" if row.untried else "fails" if row.worst is None else shown(row.worst, unit),
            "" if row.margins is None or row.margins.Ms is None else f"{row.margins.Ms:.2f}",
            f"{row.metrics.effort_high:.3g}",
            "" if row.cycles is None else f"{row.cycles:.0f}",
        )
        for row in result.compensators
        if row.metrics is not None
    ]
    drive = f" drive\n{words.force} [{result.units.force}]"
    numbers = (" gain or\nbandwidth", " tracking\nerror", " worst\ncase", " Ms", drive, " cycles")
    return Listing(f"Compensators on the axis with {result.plant} friction", ("", "compensator", *numbers), rows)


def shown(value: float, unit: str) -> str:
    """Return a length or an angle with a suitable unit prefix."""
    for factor, prefix in ((1.0, ""), (1e3, "m"), (1e6, "µ")):
        if abs(value) * factor >= 1.0:
            return f"{value * factor:.3g} {prefix}{unit}"
    return f"{value * 1e9:.3g} n{unit}"


def _percent(fit: Fit | None) -> str:
    return "–" if fit is None else percent(fit.percent)


def percent(value: float) -> str:
    """Return a percentage; one that is due to rounding has no digits."""
    return f"{value:.3g} %" if value >= LEAST_PERCENT else f"below {LEAST_PERCENT:g} %"


def _recommended(result: StudyResult) -> str:
    name = result.recommendation.name
    return "no compensation" if name == "none" else name or "none"


def _error(result: Identification) -> str:
    score, kind = (result.validation, "validation") if result.validation else (result.train, "fit")
    unit = f" {result.unit}" if _unit(result.unit) else ""
    return f"{kind} error {score.rms:.4g}{unit} ({score.relative_percent:.3g} %)"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _digits(value: float, error: float) -> str:
    """Return a value with the digits that its standard error justifies, at most 6."""
    if not (math.isfinite(error) and error > 0.0 and value):
        return f"{value:.6g}"
    return f"{value:.{min(6, max(2, math.floor(math.log10(abs(value) / error)) + 3))}g}"


def plain(content: Any) -> Any:
    """Return content and dataclasses in it for JSON, with None for numbers that are not finite."""
    if is_dataclass(content):  # `asdict` copies each number
        return {each.name: plain(getattr(content, each.name)) for each in fields(content)}
    if isinstance(content, Mapping):
        return {key: plain(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):  # without a call for each number, as there may be many
        return [value if isinstance(value, float) and math.isfinite(value) else plain(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
