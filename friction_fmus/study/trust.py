"""What a study may claim: contradictions of record, servo and models, and the band that the record supports."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from friction_fmus.axis.servo import Servo
from friction_fmus.blocks.axis_units import Words
from friction_fmus.blocks.catalogue import find
from friction_fmus.conditions import SampledLaw, chain, one_mass
from friction_fmus.conditions.condition import spectral_radius
from friction_fmus.identification import AxisUnits, Record
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.fit.rests import position_noise
from friction_fmus.identification.fit.scores import rms
from friction_fmus.identification.force_findings import FORBIDDING, contradictions
from friction_fmus.identification.plant_band import SLOW, PlantBand, plant_band
from friction_fmus.identification.plant_candidates import SATURATED
from friction_fmus.listings import shown
from friction_fmus.study.evaluation import AxisBench
from friction_fmus.study.margins import path_of
from friction_fmus.study.model_ranking import IdentifiedModel
from friction_fmus.study.next_steps import EXPERIMENT_FILE
from friction_fmus.study.pictures import driven_friction, load_along
from friction_fmus.study.study_result import StudyFinding


def band_of(records: Sequence[Record], found: IdentifiedModel) -> PlantBand | None:
    """Return the band in which records support the mass of a model, with its friction and force over position."""
    if any(record.q is None or record.force is None for record in records):
        return None
    friction, alone, table = [], [], found.plant.position
    for record in records:
        v, load = filtered_motion(record).v, load_along(found, record)
        F = driven_friction(found, record.units, record.Ts * np.arange(float(len(v))), v, load)
        over_position = 0.0 if table is None else table.force(record.column("q"), v)
        net = record.column("force") + over_position
        if found.plant.loaded:  # while the axis may stick, friction is the force, within its limits under load
            stuck = np.abs(v) <= SLOW * np.max(np.abs(v))
            F = np.where(stuck, np.clip(net - found.offset, -load["Fn"], load["Fn"]), F)
        friction.append(F)
        alone.append(replace(record, force=net))
    return plant_band(alone, found.mass, friction)


WRONG_UNIT: Final = 1.2  # recorded force divided by the force limit above which one of them has a wrong unit
GROWTH: Final = 1.1  # growth of an oscillation per sample above which the loop is too unstable to have been recorded


def force_findings(records: Sequence[Record], servo: Servo | None) -> tuple[StudyFinding, ...]:
    """Return findings about a drive force that contradicts the recorded motion, or the limit of the servo."""
    u = records[0].units.words
    forbidding = (*FORBIDDING, "mass-not-identified") if servo is not None and servo.mass is None else FORBIDDING
    found = [
        StudyFinding(each.name, each.what, each.measure, each.name in forbidding) for each in contradictions(records)
    ]
    peak = max((float(np.max(np.abs(record.force))) for record in records if record.force is not None), default=0.0)
    if servo is not None and SATURATED * servo.force_limit <= peak <= WRONG_UNIT * servo.force_limit:
        found = [each for each in found if each.name != "force-clipped"]  # the drive saturates, not the measurement
    if servo is not None and peak > WRONG_UNIT * servo.force_limit:
        limit = f"the {u.force} limit is {servo.force_limit:.3g} {u.N}"
        what = f"The recorded drive {u.force} reaches {peak:.3g} {u.N}; {limit}."
        change = f"Correct the unit of the {u.force} in [columns] or force_limit in [servo]."
        found.append(StudyFinding("force-beyond-limit", what, change, stops=True))
    return tuple(found)


def mass_findings(servo: Servo | None, model: IdentifiedModel, u: Words) -> tuple[StudyFinding, ...]:
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
        f"With the identified {u.mass} of {model.mass:.3g} {u.kg}, the servo is unstable: an oscillation grows by a "
        f"factor of {growth:.3g} in every sample, so the record cannot come from this axis."
    )
    change = f"Correct the unit of {u.force} or position, or the gains and Ts of the servo."
    return (StudyFinding("mass-contradicts-servo", what, change, stops=True),)


def loop_growth(servo: Servo, mass: float, viscous: float) -> float:
    """Return the largest magnitude of the poles of a sampled loop without Coulomb friction and slow integral action."""
    Kp, Kd, _ = servo.pid
    feedback = SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-Kp, -Kd, 0.0]))
    return spectral_radius(chain(one_mass(mass, viscous), [feedback], servo.Ts, path_of(servo)))


def loop_findings(models: Sequence[IdentifiedModel], simulated: bool, u: Words) -> tuple[StudyFinding, ...]:
    """Return a finding if the servo was simulated, but with none of the models it follows the record."""
    if not simulated or not models or models[0].row.rank is not None:
        return ()
    failed = next((found.row.reason for found in models if found.row.train is not None), "")
    if not failed:
        return ()
    change = (
        f"Check Ts, window, quantum and {u.force} limit of the servo, and whether a {u.force} acts on the axis that "
        f"the record does not contain; such a {u.force} can be declared as column injected."
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


def static_friction_findings(best: IdentifiedModel, units: AxisUnits) -> tuple[StudyFinding, ...]:
    """Return a finding if the simulated axis does not have the identified static friction."""
    identified = next((p.value for p in best.row.parameters if p.name == "Fs"), None)
    simulated = best.values.get("Fs")
    if identified is None or simulated is None or identified == simulated:
        return ()
    what = (
        f"The record does not determine the static friction of {best.row.name}: {identified:.3g} {units.words.N} would "
        f"fit. The simulated axis has its Coulomb friction, {simulated:.3g} {units.words.N}, instead."
    )
    return (StudyFinding("static-friction-unknown", what, "Record slow strokes at constant speeds."),)


UNEXPLAINED: Final = 50.0  # residual of the best model above which a record says little about friction [%]
NEGLIGIBLE: Final = 1e-3  # Coulomb friction over the rms drive force, below which a record shows none


def dry_friction_findings(models: Sequence[IdentifiedModel], record: Record) -> tuple[StudyFinding, ...]:
    """Return a finding if the best model, which is the first, leaves most of the force, or alone lacks dry friction."""
    fits, u = (models[0].row.train, models[0].row.validation), record.units.words
    left = min((each.percent for each in fits if each is not None and each.unit == record.units.force), default=0.0)
    if left > UNEXPLAINED:
        what = f"The best model leaves {left:.3g} % of the {u.force}: noise, another force, or a wrong column."
        return (StudyFinding("force-not-explained", what, "Check the columns, and record this axis moving alone."),)
    roles = [find(each.block).about.friction for each in models if each.block]
    role = roles[0] if models[0].block else None
    if role is None or record.force is None or all(each is None or each.coulomb == "0" for each in roles):
        return ()
    size, force = role.contact(models[0].values).levels[0].Fc, rms(record.force)
    if size >= NEGLIGIBLE * force:
        return ()
    what = (
        f"The record shows no dry friction: the best model has {size:.2g} {u.N} of {force:.3g} {u.N} rms drive "
        f"{u.force}. Do not use this value or its interval."
    )
    change = f"What remains to compensate are {u.mass} and viscous friction."
    return (StudyFinding("no-dry-friction", what, change),)


NOT_SIMULATED: Final = (
    *("saturated", "friction-drifts", "offset-drifts", "gravity", "backlash", "two-masses"),
    *("load-dependent-friction", "friction-varies", "direction-dependent-viscous-friction"),
    *("missing-force", "disturbed-force"),
)
"""Findings about the plant that the simulated axis, a rigid mass with friction, does not have."""

NARROW: Final = 1.5
"""Band of the plant divided by the natural frequency of the position loop; below it, errors are not claimed."""


def narrow(bench: AxisBench, band: float) -> bool:
    """Return whether the band in which a record supports a rigid mass is too narrow for the position loop."""
    return bench.plant.load is None and band < NARROW * bench.bandwidth / (2.0 * math.pi)


COMPARABLE: Final = 0.57
"""Error of the simulated axis on the recorded motion, in parts of the error that is left, above which that is not
claimed: both together are then more than 15 % larger."""


SENSITIVE: Final = 1.15
"""Error with an acceleration of the reference that is a sample late, in parts of the error, above which that is not
claimed."""


STEPS: Final = 3.0
"""Steps of the encoder below which an error is not claimed.

On an axis with steps of 20 µm, errors of 1 to 2.3 steps were up to 2.4 times as large as simulated: they depend on how
the position falls between the steps. One of 22 steps was right."""


def model_error(best: IdentifiedModel, record: Record) -> float:
    """Return the rms error of the simulated axis in the recorded loop, without the noise of the position; 0 if unknown.

    A feedforward does not change how a loop answers to a wrong force, so that the compensated axis has this error too.
    """
    if not best.row.closed_loop or record.q is None:
        return 0.0
    return math.sqrt(max(best.row.closed_loop[0].rms ** 2 - noise_of(record) ** 2, 0.0))


def noise_of(record: Record) -> float:
    """Return the rms noise of a recorded position; in motion, it has the rounding."""
    return 0.0 if record.q is None else max(position_noise(record.q, 8), record.quantum / math.sqrt(12.0))


BIASED: Final = 3.0  # error of the model over the noise of the position above which it counts as biased
SEARCHED: Final = 2e-4  # part of the recorded tracking error that the search of parameters leaves


def bias_findings(best: IdentifiedModel, record: Record) -> tuple[StudyFinding, ...]:
    """Return a finding if the simulated axis follows a record so badly that its intervals do not hold."""
    error, noise, units = model_error(best, record), noise_of(record), record.units
    tracking = 0.0 if record.reference is None else rms(record.reference - record.column("q"))
    if error <= max(BIASED * noise, SEARCHED * tracking):
        return ()
    masses = f"a rigid {units.words.mass}" if best.load is None else f"a {units.words.mass} in two parts"
    what = (
        f"The model is biased: the simulated axis follows the recorded position to {shown(error, units.position)} rms "
        f"only, and the position has a noise of {shown(noise, units.position)}. {best.row.name} friction and {masses} "
        "lack a part of this axis, so that the true parameters may lie outside of the intervals."
    )
    change = "Look at the residual over time, speed and position for what is missing."
    return (StudyFinding("model-biased", what, change),)


def claim_findings(
    bench: AxisBench, band: float, beyond: Sequence[str], units: AxisUnits, left: float = math.inf, late: float = 0.0
) -> tuple[StudyFinding, ...]:
    """Return a finding if the tracking errors of the simulated axis need not come true on the machine.

    `left` is the error that the recommended compensator leaves on the simulated axis, `late` that with a later
    acceleration of the reference.
    """
    model = bench.model_error
    natural = bench.bandwidth / (2.0 * math.pi)
    reasons = []
    if narrow(bench, band):
        reasons.append(
            f"the record supports a rigid {units.words.mass} up to {band:.3g} Hz only, and the position loop has a "
            f"natural frequency of {natural:.3g} Hz"
        )
    if beyond:
        reasons.append(f"the simulated axis has none of this: {', '.join(beyond)}")
    if model > COMPARABLE * left:
        expected = shown(math.hypot(left, model), units.position)
        reasons.append(
            f"the simulated axis follows the recorded motion to {shown(model, units.position)} rms only, so that about "
            f"{expected} must be expected instead of {shown(left, units.position)}"
        )
    if late > SENSITIVE * left:
        reasons.append(
            f"the error becomes {shown(late, units.position)} instead of {shown(left, units.position)} if the "
            "acceleration that the drive feeds forward changes a sample later than here, which no record shows"
        )
    if left < STEPS * bench.servo.quantum:
        step = shown(bench.servo.quantum, units.position)
        reasons.append(f"{shown(left, units.position)} are of the size of the steps of the encoder, {step}")
    if not reasons:
        return ()
    what = f"The tracking errors of this report cannot be claimed for the machine: {'; '.join(reasons)}."
    chirp = (
        f"Record the motion of {EXPERIMENT_FILE}, with feedforward of velocity and acceleration, and repeat the study "
        "with both records."
    )
    change = chirp if narrow(bench, band) else "Measure the error on the machine, and compare it with --verify."
    return (StudyFinding("errors-not-claimed", what, change),)


def not_trusted(findings: Sequence[StudyFinding]) -> str:
    """Return why no compensator is compared, in one sentence."""
    names = ", ".join(finding.name for finding in findings if finding.stops)
    return f"No compensator was compared, because the result cannot be trusted ({names}). Correct this first."
