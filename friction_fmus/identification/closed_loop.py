"""Output-error identification of a co-simulated axis: servo, mass and friction as FMUs, compared in position."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.errors import FitError
from friction_fmus.export.block_fmu import build_record
from friction_fmus.identification.data.record import Array, MeasuredAxis, Record
from friction_fmus.identification.fit.contact_model import ContactModel, axis_start, contact_model
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.fit.least_squares import Constraints
from friction_fmus.identification.fit.output_error import TargetSignal, Unknown, fit_output_error
from friction_fmus.identification.fit.scores import criteria, independent_samples, rms, score, weak_parameters
from harness.storage.files import ScratchFolder

if TYPE_CHECKING:
    from friction_fmus.identification.identification_result import Identification

#: Communication step between mass and friction in the fit [s]; the servo is stepped at the sample time of the record.
FIT_STEP = 2.5e-4

STEP = 0.04  # relative step of a parameter for finite differences: its effect must exceed the encoder resolution
QUANTA = 20.0  # position error that counts as one, over the encoder resolution

#: Time over which errors of the servo model count as correlated [s]; they are systematic and last for many samples.
CORRELATED = 0.2


@contextmanager
def axis_simulator(
    contact: ContactModel, axis: MeasuredAxis, given: Mapping[str, float], step: float = FIT_STEP
) -> Iterator[Callable[[Mapping[str, float]], dict[str, Array]]]:
    """Provide a function that simulates the servo with a friction block, for parameters in place of the given ones."""
    # It returns "q" [m] and "force" [N] at the samples of the record.
    record, servo = axis.record, axis.servo
    v = filtered_motion(record).v
    # the contact slides in the direction of the initial velocity
    direction = float(np.sign(v[0])) if abs(v[0]) > 1e-3 * np.max(np.abs(v)) else 0.0
    gains = {"kp": servo.kp, "kv": servo.kv, "ki": 0.0}
    feedback = Servo("CascadePPI", gains, servo.Ts, servo.force_limit, servo.window, servo.quantum)
    r = record.column("reference")
    t = servo.Ts * np.arange(float(len(r)))
    rd, rotary = np.gradient(r, servo.Ts), record.units.rotary
    own = {name: value for name, value in given.items() if name in contact.parameters}
    with ScratchFolder() as folder:
        reference = build_record(
            t, r, rd, np.gradient(rd, servo.Ts), folder, "MeasuredReference", domain=domain_of(rotary)
        )
        start = float(record.column("q")[0]), float(v[0])
        trajectory = Trajectory(reference, len(r), *start, rotary=rotary, injected=record.injected)
        plant, fmus = AxisPlant(contact.block, own, given["M"]), {"friction": contact.path}
        with closed_loop(feedback, plant, trajectory, fmus=fmus, longest=step) as system:

            def simulate(parameters: Mapping[str, float]) -> dict[str, Array]:
                start = axis_start(contact, {**given, **parameters}, direction)
                trace = run_loop(system.with_start(start))
                return {"q": trace.q, "force": trace.force}

            yield simulate


def identify_closed_loop(
    model: str | Path, axis: MeasuredAxis, open_loop: Identification, constraints: Constraints
) -> Identification:
    """Fit mass, offset and friction so that the co-simulated servo follows the measured motion."""
    # Only positions are compared: the force follows from the position through the known controller and would count the
    # same error twice. The search is `fit_output_error`. For `GMS`, only the sliding law is fitted; the elements remain
    # those of `open_loop`.
    begin = time.perf_counter()
    contact = contact_model(model, axis.record.units)
    unseen = [name for name, e in open_loop.parameters.items() if not np.isfinite(e.standard_error)]
    # an axis in closed loop hardly moves in presliding: a model with elements and a sliding law keeps its elements
    kept = [name for name in open_loop.parameters if "[" in name and "Fc" in open_loop.parameters]
    names = [name for name in open_loop.parameters if name not in (*unseen, *kept)]
    unknowns = []
    for name in names:
        parameter = contact.parameters.get(name)
        lower, upper = (parameter.lower, parameter.upper) if parameter else (1e-9 if name == "M" else -np.inf, np.inf)
        low, high = constraints.bounds.get(name, (lower, upper))
        value = constraints.start.get(name, open_loop.parameters[name].value)
        step = STEP * max(abs(value), _floor(name, open_loop))
        unknowns.append(Unknown(name, value, step, open_loop.parameters[name].unit, max(low, lower), min(high, upper)))
    if not unknowns:
        raise FitError(f"All parameters of {contact.name} are fixed; leave at least one to be identified.")
    rest = {**open_loop.fixed, **{name: open_loop.parameters[name].value for name in (*unseen, *kept)}}
    with axis_simulator(contact, axis, {**rest, **{each.name: each.start for each in unknowns}}) as run:
        target = TargetSignal(axis.record.column("q"), QUANTA * (axis.servo.quantum or 5e-8))
        lag = round(CORRELATED / axis.servo.Ts)
        fit = fit_output_error(run, unknowns, {"q": target}, correlation=lag, max_iterations=12, tolerance=1e-4)
        predicted = run(fit.values())["q"]
    measured = axis.record.column("q")
    estimates = {name: fit.parameters.get(name, open_loop.parameters[name]) for name in open_loop.parameters}
    samples = independent_samples([measured - axis.record.column("reference")])
    aic, bic = criteria(predicted - measured, samples, len(unknowns))
    errors = {name: e.standard_error for name, e in estimates.items()}
    correlation = np.eye(len(estimates))
    where = [list(estimates).index(name) for name in names]
    correlation[np.ix_(where, where)] = fit.correlation
    values = {name: e.value for name, e in estimates.items()}
    return replace(
        open_loop,
        method="closed-loop",
        parameters=estimates,
        initial={},
        correlation=correlation,
        t=axis.record.t,
        measured=measured,
        predicted=predicted,
        signal="q",
        unit=axis.record.units.position,
        train=score(measured, predicted),
        aic=aic,
        bic=bic,
        weak=weak_parameters(
            contact, list(estimates), values, errors, correlation, _at_bound(unknowns, values), unseen
        ),
        warnings=() if fit.converged else ("the search reached its iteration limit; give better start values",),
        seconds=open_loop.seconds + time.perf_counter() - begin,
        simulations=fit.simulations,
        errors="robust",
        servo=axis.servo,
    )


def axis_response(result: Identification, record: Record, step: float = FIT_STEP) -> dict[str, Array]:
    """Simulate the servo with the identified model along the reference of a record and return "q" and "force"."""
    if result.servo is None:
        raise FitError("This identification was not made in closed loop; call identify with a MeasuredAxis.")
    contact = contact_model(result.block, record.units)
    with axis_simulator(contact, MeasuredAxis(record, result.servo), result.values(), step) as run:
        return run({})


def _floor(name: str, open_loop: Identification) -> float:
    """Return the smallest magnitude used to scale a parameter that may be zero: its effect is 5 % of the force."""
    force = rms(open_loop.measured)
    if name == "OF":
        return 0.05 * force
    v = max(float(np.max(np.abs(filtered_motion(r).v))) for r in open_loop.records)
    return 0.05 * force / v if open_loop.parameters[name].unit == open_loop.records[0].units.viscous else 1e-300


def _at_bound(unknowns: Sequence[Unknown], values: Mapping[str, float]) -> dict[str, float]:
    found = {}
    for unknown in unknowns:
        for limit in (unknown.lower, unknown.upper):
            if np.isfinite(limit) and abs(values[unknown.name] - limit) < 1e-3 * unknown.step:
                found[unknown.name] = limit
    return found
