"""Findings about the models of a study that limit how far its result can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from friction_fmus.study.models import IdentifiedModel
from friction_fmus.study.records import StudyFinding


def loop_findings(models: Sequence[IdentifiedModel], simulated: bool) -> tuple[StudyFinding, ...]:
    """Return a finding if the servo was simulated, but with none of the models it follows the record.

    Parameters
    ----------
    models : sequence of IdentifiedModel
        Models after `ranked`.
    simulated : bool
        Whether the servo was co-simulated with the models.
    """
    if not simulated or not models or models[0].row.rank is not None:
        return ()
    failed = next((found.row.reason for found in models if found.row.train is not None), "")
    if not failed:
        return ()
    change = (
        "Check Ts, window, quantum and force limit of the servo, and whether a force acts on the axis that the record "
        "does not contain; such a force can be declared as column injected."
    )
    what = f"The simulated servo does not follow the record with any friction model. {models[0].row.name}: {failed}"
    return (StudyFinding("loop-not-reproduced", what, change, stops=True),)


def without_loop(models: Sequence[IdentifiedModel]) -> list[IdentifiedModel]:
    """Return the models with the error of their predicted signal, so that they can be ranked without a servo."""
    found = []
    for each in models:
        fit = each.row.validation or each.row.train
        row = each.row if fit is None else replace(each.row, reason="")
        found.append(replace(each, error=None if fit is None else fit.rms, row=row))
    return found


def not_trusted(findings: Sequence[StudyFinding]) -> str:
    """Return why no compensator is compared, in one sentence."""
    names = ", ".join(finding.name for finding in findings if finding.stops)
    return f"No compensator was compared, because the result cannot be trusted ({names}). Correct this first."
