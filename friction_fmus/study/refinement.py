"""Refinement of identified parameters, so that the co-simulated servo follows the measured motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from friction_fmus.axis.assembly import constant_force
from friction_fmus.axis.loop import closed_loop, run_loop
from friction_fmus.errors import FrictionError
from friction_fmus.identification import LINEAR, ROTARY, Array, Record, Target, Unknown, fit_output_error
from friction_fmus.identification.fit.drives import driven
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.fit.scores import weak_parameters
from friction_fmus.identification.fit.simulation_data import prepare
from friction_fmus.study.models import MEANING, IdentifiedModel, Measured, in_closed_loop
from friction_fmus.study.records import Fit, IdentifiedParameter
from friction_fmus.study.regression import rms
from harness import HarnessError

EQUAL: Final = 1e-3
"""Relative increase of an error of the simulated servo that is within the accuracy of the search."""

BIAS: Final = 5e-3
"""Increase of the error of the predicted force, over the rms force, that the filter of the motion can cause."""

UNLOADED: Final = 0.02
"""Initial fraction of a record that is not compared, because the predicted contact starts unloaded."""

_STEPS: Final = {"M": 0.02, "vs": 0.2, "Fs": 0.1}
"""Relative step of a parameter for differences, 4 % by default: its effect must exceed the encoder resolution."""


def refine(
    found: IdentifiedModel, measured: Measured, train: Sequence[Record], unfitted: Sequence[Record]
) -> IdentifiedModel:
    """Fit the well-determined parameters so that the co-simulated servo follows the measured motion.

    Only positions are compared: the force follows from the position through the known controller and would count the
    same error twice. The fit is discarded if, on data that were not fitted, it makes position or force of the simulated
    servo worse, or increases the error of the force predicted for the measured motion by more than `BIAS`.
    """
    if not unfitted:
        return found
    rows = {p.name: p for p in found.row.parameters}
    free = [p for p in rows.values() if p.determined]
    free = [p for p in free if p.value > 0.0 or p.name == "OF"]
    level = max((found.values.get(name, 0.0) for name in ("Fc", "Fs", "f1")), default=0.0)
    if "M" not in {p.name for p in free} or not level:
        return found

    def step(p: IdentifiedParameter) -> float:
        return 0.02 * level if p.name == "OF" else _STEPS.get(p.name, 0.04) * p.value

    contact = contact_model(found.block, ROTARY if measured.trajectory.rotary else LINEAR)
    known = contact.parameters

    def unknown(p: IdentifiedParameter) -> Unknown:
        lower = -np.inf if p.name == "OF" else 1e-3 * p.value
        if p.name in known:
            return Unknown(p.name, p.value, step(p), p.unit, max(lower, known[p.name].lower), known[p.name].upper)
        return Unknown(p.name, p.value, step(p), p.unit, lower)

    unknowns, simulations = [unknown(p) for p in free], found.row.simulations
    first, last = measured.train
    trajectory = replace(measured.trajectory, samples=last)
    with closed_loop(measured.servo, found.plant, trajectory) as system:

        def simulate(values: Mapping[str, float]) -> dict[str, Array]:
            own = {
                f"friction.{name}" if name in known else "axis.d": value
                for name, value in values.items()
                if name not in MEANING
            }
            moved = {"axis.m": values["M"], **constant_force(found.plant, -values.get("OF", found.offset))}
            return {"q": run_loop(system.with_start({**own, **moved})).q}

        target = Target(measured.q[:last], 1e-6 if found.error is None else max(found.error, 1e-12), first)
        try:
            lag = max(1, round(0.2 / measured.servo.Ts))
            # the differences are coarse: with those of the first point, the solution depends on it by some 0.3 %
            for _ in range(2):
                fit = fit_output_error(simulate, unknowns, {"q": target}, correlation=lag, max_iterations=12)
                simulations += fit.simulations
                reached = fit.values()
                unknowns = [replace(u, start=min(max(reached[u.name], u.lower), u.upper)) for u in unknowns]
        except (FrictionError, HarnessError):
            return found
    values = fit.values()
    errors = {name: estimate.standard_error for name, estimate in fit.parameters.items()}
    weak = weak_parameters(contact, list(values), values, errors, fit.correlation, {}, ())

    def replaced(p: IdentifiedParameter) -> IdentifiedParameter:
        if p.name not in values:
            return p
        error = errors[p.name] if np.isfinite(errors[p.name]) else None
        return replace(p, value=values[p.name], standard_error=error, weak=weak.get(p.name, ""))

    refined = IdentifiedModel(
        replace(
            found.row,
            method=f"{found.row.method}, then closed-loop",
            parameters=tuple(replaced(p) for p in rows.values()),
            simulations=simulations,
        ),
        found.block,
        {name: values.get(name, value) for name, value in found.values.items()},
        values["M"],
        values.get("OF", found.offset),
        found.error,
        predicted=found.predicted,
        position_map=found.position_map,
    )
    return _better(found, in_closed_loop(refined, measured), train, unfitted)


def _better(
    found: IdentifiedModel, refined: IdentifiedModel, train: Sequence[Record], unfitted: Sequence[Record]
) -> IdentifiedModel:
    """Return the refined model if it is better on data that were not fitted; otherwise the other with a warning."""
    before, after = _prediction_error(found, unfitted), _prediction_error(refined, unfitted)
    units = unfitted[0].units
    level = rms(np.concatenate([record.column("force") for record in unfitted])) if before is not None else 0.0
    comparisons: tuple[tuple[str, float | None, float | None, float, str], ...] = (
        ("position of the simulated servo", found.error, refined.error, 0.0, units.position),
        ("force of the simulated servo", found.force_error, refined.force_error, 0.0, units.force),
        # the prediction depends on the filter of the motion, with which the parameters before were fitted
        ("predicted force", before, after, BIAS * level, units.force),
    )
    for what, old, new, allowed, unit in comparisons:
        if old is None or (new is not None and new <= (1.0 + EQUAL) * old + allowed):
            continue
        change = "without bound" if new is None else f"from {old:.3g} to {new:.3g} {unit}"
        text = (
            f"The fit to the closed loop was discarded, because it increases the rms error of the {what} {change} on "
            "data that were not fitted."
        )
        return replace(found, row=replace(found.row, warnings=(*found.row.warnings, text)))
    fitted = _scaled(found.row.train, _prediction_error(found, train), _prediction_error(refined, train))
    return replace(
        refined, row=replace(refined.row, train=fitted, validation=_scaled(found.row.validation, before, after))
    )


def _scaled(fit: Fit | None, before: float | None, after: float | None) -> Fit | None:
    """Return the residual of a prediction after its error has changed."""
    if fit is None or after is None or not before:
        return fit
    return replace(fit, rms=after / before * fit.rms, percent=after / before * fit.percent)


def _prediction_error(found: IdentifiedModel, records: Sequence[Record]) -> float | None:
    """Return the rms error of the drive force that a model predicts for the measured motion; None without a force."""
    if any(record.force is None for record in records):
        return None
    contact = contact_model(found.block, records[0].units)
    errors = []
    with driven(contact.path) as drive:
        for record in records:
            segment = prepare(record, contact, "force")
            own = contact.parameters
            values = {name: own[name].typed(value) for name, value in found.values.items() if name in own}
            F = segment.run(drive, ["F"], values)[:, 0]
            if "Fv" not in own:
                F = F + found.values.get("Fv", 0.0) * segment.inputs["v"]
            if found.position_map is not None:
                F = F - found.position_map.force(record.column("q"), segment.inputs["v"])
            error = segment.predicted(F, found.mass, found.offset) - segment.measured
            errors.append(error[round(UNLOADED * len(error)) :])
    return rms(np.concatenate(errors))
