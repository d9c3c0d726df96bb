"""What to do after a study: values to set in the drive, and what to measure if it matters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from friction_fmus.axis.servo import GAINS
from friction_fmus.identification import AxisUnits
from friction_fmus.study.compensator_records import CompensatorResult
from friction_fmus.study.evaluation import Scheme
from friction_fmus.study.metrics import Bench
from friction_fmus.study.recommending import shown
from friction_fmus.study.records import ModelResult

SENSITIVE = 1.5
"""Factor by which the error rises in a case that is worth a measurement."""

SMALL = 1e-3
"""Constant force over the force limit up to which it is not worth a setting."""


def next_steps(
    bench: Bench, scheme: Scheme, row: CompensatorResult, models: Sequence[ModelResult], units: AxisUnits
) -> tuple[str, ...]:
    """Return what to set in the drive and what to measure, one or two sentences each."""
    return (
        *_motion(bench, units),
        *_integral(bench, scheme),
        *_laws(scheme, row),
        *_sensitive(row, units),
        *_fragile(row),
        *_weak(row, models),
    )


def _motion(bench: Bench, units: AxisUnits) -> Iterator[str]:
    if not bench.trajectory.motion:
        return
    force = bench.plant.offset
    known = abs(force) > SMALL * bench.servo.force_limit
    constant = f", and a constant force of {force:.3g} {units.force}" if known else ""
    yield (
        "Switch on the feedforward of velocity (100 %) and acceleration (inertia "
        f"{bench.plant.mass:.4g} {units.inertia}){constant}."
    )


def _integral(bench: Bench, scheme: Scheme) -> Iterator[str]:
    name = GAINS[bench.servo.law][-1]
    value = scheme.servo.gains[name]
    if value != bench.servo.gains[name]:
        yield f"Set the integral gain of the {scheme.servo.law} to {name} = {value:.4g}."


def _laws(scheme: Scheme, row: CompensatorResult) -> Iterator[str]:
    if scheme.table:
        yield "Subtract the force over position at the reference, see PositionMap.fmu in the folder recommended."
    laws = [law for law in (scheme.feedforward, scheme.compensator) if law is not None]
    if not laws:
        return
    tuned = f"a bandwidth of {row.bandwidth:.3g} Hz" if row.bandwidth is not None else f"gain {row.gain:g}"
    names = " and ".join(law.model for law in laws)
    only_integral = scheme.compensator is None
    yield (
        f"Add {names}{'' if only_integral else f' with {tuned}'}; the folder recommended contains the parameters, the "
        "code and the connections."
    )


def _sensitive(row: CompensatorResult, units: AxisUnits) -> Iterator[str]:
    if row.metrics is None:
        return
    tried = [(each.metrics.rms, each.name) for each in row.corners if each.counts and each.metrics is not None]
    if tried and max(tried)[0] > SENSITIVE * row.metrics.rms:
        error, name = max(tried)
        yield (
            f"The error is most sensitive to this case: {name} ({shown(row.metrics.rms, units.position)} becomes "
            f"{shown(error, units.position)}). If it can occur on the machine, record it and repeat the study."
        )


def _fragile(row: CompensatorResult) -> Iterator[str]:
    failing = [each.name for each in row.corners if each.metrics is None]
    if failing:
        yield f"The loop fails in these cases: {', '.join(failing)}. Rule them out before you switch it on."


def _weak(row: CompensatorResult, models: Sequence[ModelResult]) -> Iterator[str]:
    model = next((model for model in models if model.name == row.model), None)
    weak = [parameter for parameter in model.parameters if parameter.weak] if model is not None else []
    if weak:
        names = " and ".join(parameter.name for parameter in weak)
        yield f"The record determines {names} of {row.model} poorly ({weak[0].name}: {weak[0].weak})."
