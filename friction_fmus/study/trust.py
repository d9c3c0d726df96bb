"""Findings about the models of a study that limit how far its result can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from friction_fmus.axis.servo import Servo
from friction_fmus.conditions import PathDynamics, SampledLaw, chain, one_mass
from friction_fmus.conditions.linear import spectral_radius
from friction_fmus.identification import Record
from friction_fmus.identification.physics import FORBIDDING, contradictions
from friction_fmus.study.models import IdentifiedModel
from friction_fmus.study.records import StudyFinding

BEYOND: Final = 1.2
"""Recorded force over the force limit above which one of them has a wrong unit."""

GROWTH: Final = 1.1
"""Growth of an oscillation per sample above which the loop is too unstable to have been recorded."""


def force_findings(records: Sequence[Record], servo: Servo | None) -> tuple[StudyFinding, ...]:
    """Return findings about a drive force that contradicts the recorded motion, or the limit of the servo."""
    forbidding = (*FORBIDDING, "mass-not-identified") if servo is not None and servo.mass is None else FORBIDDING
    found = [
        StudyFinding(each.name, each.what, each.measure, each.name in forbidding) for each in contradictions(records)
    ]
    peak = max((float(np.max(np.abs(record.force))) for record in records if record.force is not None), default=0.0)
    if servo is not None and peak > BEYOND * servo.force_limit:
        unit = records[0].units.force
        what = f"The recorded drive force reaches {peak:.3g} {unit}; the force limit is {servo.force_limit:.3g} {unit}."
        change = "Correct the unit of the force in [columns] or force_limit in [servo]."
        found.append(StudyFinding("force-beyond-limit", what, change, stops=True))
    return tuple(found)


def mass_findings(servo: Servo | None, model: IdentifiedModel, unit: str) -> tuple[StudyFinding, ...]:
    """Return a finding if the loop of servo and identified mass is so unstable that no record can come from it.

    Friction is left out, except for its viscous part: a loop whose oscillation grows by more than `GROWTH` in every
    sample exceeds any friction within a few samples.
    """
    if servo is None or model.mass <= 0.0:
        return ()
    growth = loop_growth(servo, model.mass, max(model.values.get("Fv", model.values.get("sigma2", 0.0)), 0.0))
    if growth <= GROWTH:
        return ()
    what = (
        f"With the identified mass of {model.mass:.3g} {unit}, the servo is unstable: an oscillation grows by a factor "
        f"of {growth:.3g} in every sample, so the record cannot come from this axis."
    )
    change = "Correct the unit of force or position, or the gains and Ts of the servo."
    return (StudyFinding("mass-contradicts-servo", what, change, stops=True),)


def loop_growth(servo: Servo, mass: float, viscous: float) -> float:
    """Return the largest magnitude of the poles of the sampled loop of a mass without Coulomb friction.

    Integral action is left out, as it is slow.
    """
    Kp, Kd, _ = servo.pid
    feedback = SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-Kp, -Kd, 0.0]))
    path = PathDynamics(delay=servo.delay * servo.Ts, window=servo.window)
    return spectral_radius(chain(one_mass(mass, viscous), [feedback], servo.Ts, path))


def loop_findings(models: Sequence[IdentifiedModel], simulated: bool) -> tuple[StudyFinding, ...]:
    """Return a finding if the servo was simulated, but with none of the models it follows the record."""
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
