"""Results as one line and as small HTML tables, for notebooks."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

from harness.notebook import counted, html_table

if TYPE_CHECKING:
    from friction_fmus.identification.result import Identification
    from friction_fmus.identification.survey import ModelComparison
    from friction_fmus.study.result import StudyResult


def identification_text(result: Identification) -> str:
    """Return an identification as one line."""
    return f"<Identification of {result.model}: {counted(len(result.parameters), 'parameter')}, {_error(result)}>"


def identification_html(result: Identification) -> str:
    """Return the parameters of an identification as a table."""
    rows = [
        (
            name,
            one.value,
            one.standard_error if math.isfinite(one.standard_error) else "unknown",
            _unit(one.unit),
            result.weak.get(name, ""),
        )
        for name, one in result.parameters.items()
    ]
    headings = ("parameter", "value", "standard error", "unit", "poorly identifiable because")
    return html_table(f"{result.model} by {result.method}, {_error(result)}", headings, rows)


def comparison_text(comparison: ModelComparison) -> str:
    """Return a comparison of models as one line."""
    names = ", ".join(result.model for result in comparison.results)
    return f"<ModelComparison of {counted(len(comparison.results), 'model')} by {comparison.ranked_by}: {names}>"


def comparison_html(comparison: ModelComparison) -> str:
    """Return the models of a comparison as a table, best first."""
    rows = [
        (
            result.model,
            result.method,
            result.train.relative_percent,
            result.validation.relative_percent if result.validation else None,
            result.bic,
        )
        for result in comparison.results
    ]
    headings = ("model", "method", "fit error [%]", "validation error [%]", "BIC")
    failed = [(name, reason) for name, reason in comparison.failed.items()]
    table = html_table(f"Models by {comparison.ranked_by}", headings, rows)
    return table + (html_table("Not identified", ("model", "reason"), failed) if failed else "")


def study_text(result: StudyResult) -> str:
    """Return a study as one line."""
    models = counted(len(result.models), "model")
    compensators = counted(len(result.compensators), "compensator")
    return f"<StudyResult {result.name!r}: {models}, {compensators}, recommendation: {_recommended(result)}>"


def study_html(result: StudyResult) -> str:
    """Return the recommendation, the models and the compensators of a study."""
    models = [
        (row.rank, row.name, fit.percent if (fit := row.validation or row.train) else None, row.reason)
        for row in result.models
    ]
    compensators = [
        (
            row.rank,
            row.name,
            row.gain,
            row.metrics.rms if row.metrics else None,
            row.worst,
            row.reason,
        )
        for row in result.compensators
    ]
    unit = f"[{result.units.position}]"
    return (
        f"<p><strong>Recommendation: {escape(_recommended(result))}</strong></p>"
        f"<p>{escape(result.recommendation.reason)}</p>"
        + html_table(f"Friction models of {result.name}", ("rank", "model", "error [%]", "note"), models)
        + html_table(
            "Compensators",
            ("rank", "compensator", "gain", f"tracking error {unit}", f"worst case {unit}", "note"),
            compensators,
        )
    )


def _recommended(result: StudyResult) -> str:
    name = result.recommendation.name
    return "no compensation" if name == "none" else name or "none"


def _error(result: Identification) -> str:
    score, kind = (result.validation, "validation") if result.validation else (result.train, "fit")
    unit = f" {result.unit}" if _unit(result.unit) else ""
    return f"{kind} error {score.rms:.4g}{unit} ({score.relative_percent:.3g} %)"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
