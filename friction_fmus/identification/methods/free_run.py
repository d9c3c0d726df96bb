"""Free run: the position simulated from the drive force and the first state alone is fitted to the measured one.

The fit continues that of another method and also finds a constant rate at which the constant force drifts: an error of
the mean force of F moves the axis by F / Fv in each second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from friction_fmus.axis.servo import AxisPlant
from friction_fmus.axis.servo_loop import FINEST, free_axis, quiet_runs, run_free
from friction_fmus.errors import FitError
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.contact_model import axis_start, contact_model
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.idim import filtered_motion
from friction_fmus.identification.fit.scores import criteria, independent_samples, rms, score, weak_parameters
from friction_fmus.identification.fit.shooting import Arc, Prior, ShootingResult, shoot
from harness import HarnessError, System
from harness.parts.part import StartValue

if TYPE_CHECKING:
    from friction_fmus.identification.identification_result import Identification

FREE_RUN: Final = "free-run"  # name of the method
DRIFT: Final = "OF_rate"  # parameter of the drift: change of the constant force OF per second

START: Final = 20
"""Samples from which the first state is measured; they do not count in scores, as in the EMPS benchmark."""

ARC: Final = 2.0  # length of an arc [s]

TRUST: Final = 3.0
"""Standard deviation of a parameter before the fit, over its standard error in the fit that is continued."""

REACH: Final = 0.1  # largest standard deviation of a parameter before the fit, over its value

DRIFTING: Final = 0.05
"""Standard deviation of the drift over the whole record before the fit, over the rms of the drive force."""

CLEAR: Final = 2.0  # Drift, over its standard error, above which it is used
CORRELATED: Final = 0.2  # time over which errors of the position count as one independent error [s]

INACCURATE: Final = 0.1
"""Change of the position with half the step, over the error of the position, above which a warning says so."""

STEPS: Final = 1e-4, 1e-3  # steps of position and velocity for finite differences, over travel and largest speed


def identify_free_run(found: Identification) -> Identification:
    """Fit an identified model to the position of a free run, by multiple shooting."""
    if found.signal != "force" or any(record.q is None for record in found.records):
        raise FitError("The method 'free-run' needs the columns position and force of a drive; add them.")
    names = [name for name, e in found.parameters.items() if "[" not in name and _determined(name, e)]
    fitted = _fit(found, [*names, DRIFT])
    errors = np.sqrt(np.diag(fitted.covariance))
    drifts = abs(fitted.x[-1]) > CLEAR * errors[-1]
    if drifts:
        names.append(DRIFT)
    else:
        fitted = _fit(found, names)
    return _result(found, names, fitted, drifts)


def free_response(result: Identification, record: Record) -> Array:
    """Simulate an identified axis along the drive force of a record, from its first state; shape (n,)."""
    values = result.values()
    with quiet_runs(), _free(result, record) as system:

        def run(state: Array, samples: int) -> Array:
            return run_free(system, _start(result, values, state), 0.0, record.Ts * (samples - 1))[0]

        first = _parabola(record)
        speed = STEPS[1] * max(float(np.max(np.abs(np.diff(record.column("q"))))) / record.Ts, 1e-300)
        begin = min(START, len(record))
        for _ in range(2):  # the force at the beginning is known, so that the state follows from the first samples
            q = run(first, begin)
            slope = (run(first + np.array([0.0, speed]), begin) - q) / speed
            A = np.column_stack([np.ones(begin), slope])
            first = first + np.linalg.lstsq(A, record.column("q")[:begin] - q, rcond=None)[0]
        return run(first, len(record))


def _determined(name: str, estimate: Estimate) -> bool:
    error = estimate.standard_error
    return bool(np.isfinite(error)) and error > 0.0 and (name in ("M", "OF") or error < abs(estimate.value))


def _parabola(record: Record) -> Array:
    """Return position and velocity at the first sample, from a parabola through the first samples."""
    t = record.t[:START] - record.t[0]
    _, v, x = np.polyfit(t, record.column("q")[:START], 2)
    return np.array([x, v])


def _free(result: Identification, record: Record, longest: float = FINEST) -> System:
    """Return the free axis of a record, with the longest communication step [s]."""
    contact = contact_model(result.block, record.units)
    values = result.values()
    own = {name: value for name, value in values.items() if name in contact.parameters}
    table = None if result.position is None else result.position.table
    plant = AxisPlant(contact.block, own, values["M"], values.get("OF", 0.0), table)
    middle = 0.5 * (result.records[0].t[0] + result.records[-1].t[-1])
    rotary = record.units.rotary
    force, trend = record.with_total_force().column("force"), record.t - middle
    return free_axis(plant, record.t, force, trend, rotary=rotary, contact=contact.path, longest=longest)


def _start(result: Identification, values: Mapping[str, float], state: Array) -> dict[str, StartValue]:
    """Return the start values of the free axis for parameters and a first state, in which the contact slides."""
    contact = contact_model(result.block, result.records[0].units)
    load = "axis.F_load" if result.position is None else "position.F0"
    start = axis_start(contact, values, float(np.sign(state[1])), load)
    return start | {"axis.x0": float(state[0]), "axis.v0": float(state[1]), "force.gain[2]": -values.get(DRIFT, 0.0)}


def _fit(found: Identification, names: Sequence[str]) -> ShootingResult:
    """Return the result of multiple shooting for these parameters."""
    contact = contact_model(found.block, found.records[0].units)
    forces = [record.with_total_force().column("force") for record in found.records]
    force = float(np.sqrt(np.mean([np.mean(np.square(each)) for each in forces])))
    span = found.records[-1].t[-1] - found.records[0].t[0]
    known = found.values()
    mean, deviation, lower, upper = [], [], [], []
    for name in names:
        if name == DRIFT:
            mean.append(0.0)
            deviation.append(DRIFTING * force / span)
        else:
            mean.append(known[name])
            size = force if name == "OF" else abs(known[name])
            deviation.append(min(TRUST * found.parameters[name].standard_error, REACH * size))
        parameter = contact.parameters.get(name)
        lower.append(parameter.lower if parameter else 1e-3 * known["M"] if name == "M" else -np.inf)
        upper.append(parameter.upper if parameter else np.inf)
    prior = Prior(*(np.array(column) for column in (mean, deviation, lower, upper)))
    arcs, states = _arcs(found.records)
    with ExitStack() as stack:
        stack.enter_context(quiet_runs())
        systems = [stack.enter_context(_free(found, record)) for record in found.records]

        def simulate(x: Array, arc: Arc, state: Array) -> tuple[Array, Array]:
            record, system = found.records[arc.record], systems[arc.record]
            values = {**known, **dict(zip(names, x.tolist(), strict=True))}
            start = _start(found, values, state)
            try:
                return run_free(system, start, record.Ts * arc.begin, record.Ts * arc.end)
            except HarnessError:  # these parameters cannot be simulated; the search takes a shorter step
                return np.full_like(arc.measured, np.nan), np.full_like(arc.measured, np.nan)

        seconds = sum(len(record) * record.Ts for record in found.records)
        travel = max(float(np.ptp(record.column("q"))) for record in found.records)
        speed = max(float(np.max(np.abs(states[:, 1]))), 1e-300)
        return shoot(simulate, arcs, states, prior, seconds / CORRELATED, np.array(STEPS) * (travel, speed))


def _arcs(records: Sequence[Record]) -> tuple[list[Arc], Array]:
    """Return arcs of about `ARC`, which begin where the axis is fast, and their measured first states."""
    arcs, states = [], []
    for index, record in enumerate(records):
        q, motion = record.column("q"), filtered_motion(record)
        width = max(START, round(ARC / record.Ts))
        begins = [0]
        for middle in range(width, len(record) - width // 2, width):
            near = slice(middle - width // 4, middle + width // 4)
            begins.append(near.start + int(np.argmax(np.abs(motion.v[near]))))
        for begin, end in zip(begins, [*begins[1:], len(record) - 1], strict=True):
            arcs.append(Arc(index, begin, end, q[begin : end + 1]))
            states.append(np.array([motion.q[begin], motion.v[begin]]) if begin else _parabola(record))
    return arcs, np.array(states)


def _whole(result: Identification, fitted: ShootingResult, longest: float) -> Array:
    """Return the position of one run over each record, without its first samples."""
    arcs, _ = _arcs(result.records)
    predicted = []
    for index, record in enumerate(result.records):
        first = next(state for arc, state in zip(arcs, fitted.states, strict=True) if arc.record == index)
        with quiet_runs(), _free(result, record, longest) as system:
            start = _start(result, result.values(), first)
            predicted.append(run_free(system, start, 0.0, record.Ts * (len(record) - 1))[0][START:])
    return np.concatenate(predicted)


def _result(found: Identification, names: Sequence[str], fitted: ShootingResult, drifts: bool) -> Identification:
    """Return the identification with these parameters, and the position of a run over each whole record."""
    units = found.records[0].units
    errors = np.sqrt(np.diag(fitted.covariance))
    given = {**{name: e.unit for name, e in found.parameters.items()}, DRIFT: f"{units.force}/s"}
    new = {
        name: Estimate(name, float(value), float(error), given[name])
        for name, value, error in zip(names, fitted.x, errors, strict=True)
    }
    parameters = {**found.parameters, **new}
    correlation = np.eye(len(parameters))
    where = [list(parameters).index(name) for name in names]
    correlation[np.ix_(where, where)] = fitted.covariance / np.outer(errors, errors)
    result = replace(found, parameters=parameters, signal="q", unit=units.position, method=FREE_RUN, initial={})
    measured = np.concatenate([record.column("q")[START:] for record in found.records])
    simulated, finer = (_whole(result, fitted, longest) for longest in (FINEST, 0.5 * FINEST))
    train = score(measured, simulated)
    independent = independent_samples([record.column("q") for record in found.records])
    aic, bic = criteria(simulated - measured, independent, len(names))
    contact = contact_model(found.block, units)
    plain = [name for name in parameters if name != DRIFT]
    values, error = result.values(), {name: e.standard_error for name, e in parameters.items()}
    unseen = [name for name in plain if not np.isfinite(error[name])]
    warnings = [] if fitted.converged else ["the search reached its iteration limit; fit a shorter record"]
    if rms(finer - simulated) > INACCURATE * train.rms:
        warnings.append(
            f"the simulation is inaccurate: with half the step of {FINEST:g} s, its error is "
            f"{score(measured, finer).rms:.3g} instead of {train.rms:.3g} {units.position}"
        )
    if drifts:
        span = found.records[-1].t[-1] - found.records[0].t[0]
        warnings.append(
            f"the constant {units.words.force} of the drive drifts by {new[DRIFT].value * span:.2g} {units.force} over "
            "the training data; predictions of other times continue this drift"
        )
    return replace(
        result,
        correlation=correlation,
        t=np.concatenate([record.t[START:] for record in found.records]),
        measured=measured,
        predicted=simulated,
        train=train,
        validation=None,
        aic=aic,
        bic=bic,
        weak=weak_parameters(contact, plain, values, error, correlation, {}, unseen),
        warnings=tuple(warnings),
        errors="robust",
    )
