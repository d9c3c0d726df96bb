"""Identification of a friction model from data, with any of the methods."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from friction_fmus.axis.servo_loop import quiet_runs
from friction_fmus.blocks.axis_units import AxisUnits
from friction_fmus.errors import FitError
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.axis_terms import CANDIDATES, mean_temperature, middle_of
from friction_fmus.identification.fit.block_fit import BlockFit, FitData, driven
from friction_fmus.identification.fit.contact_model import ContactModel, contact_model
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.idim import InverseModelSettings
from friction_fmus.identification.fit.least_squares import Constraints, Problem, Setup, check_constraints
from friction_fmus.identification.fit.position import fit_with_table
from friction_fmus.identification.fit.scores import Score, criteria, independent_samples, score, weak_parameters
from friction_fmus.identification.fit.search import Loss, SearchResult, covariance, unseen
from friction_fmus.identification.fit.simulation_data import PreparedSegment, prepare, signal_of, traits
from friction_fmus.identification.fit.term_choice import check_load, check_terms, with_starts, with_terms
from friction_fmus.identification.identification_result import Identification
from friction_fmus.identification.methods import find_method
from friction_fmus.identification.methods.free_run import FREE_RUN, identify_free_run

#: Factor of the estimated bias, because delays and filters are not its only causes. It is chosen so that intervals of
#: 95 % cover the true parameters of nine in ten simulated axes (`tests/slow/test_intervals.py`).
ALLOWANCE = 3.0


def misfit_variance(found: SearchResult, parts: Sequence[Array], lengths: Sequence[int], G: Array) -> Array:
    """Return the variances by which a misfit widens those of reported values, shape (values,)."""
    # A force that is measured a little later than the motion, and a velocity or an acceleration from filtered
    # differences, change the signal in proportion to the first and second time derivatives of its parts. With these
    # columns N beside the Jacobian J, the estimates would move by
    #
    #     d = -(J' P J)^-1 J' P r,   P = 1 - N (N'N)^-1 N'.
    #
    # What `ALLOWANCE` d exceeds the increase of the variance is a bias, whose square is added to the variance.
    ends = np.cumsum(lengths)[:-1]
    columns = []
    for part in parts:
        pieces = np.split(part, ends)
        for _ in range(2):
            pieces = [np.gradient(piece) if len(piece) > 1 else np.zeros_like(piece) for piece in pieces]
            column = np.concatenate(pieces)
            columns.append(column / (np.linalg.norm(column) or 1.0))
    size = float(np.linalg.norm(found.J)) or 1.0
    J = np.column_stack([found.J, *(size * column for column in columns)])
    p = found.J.shape[1]
    d = -np.linalg.lstsq(J, found.residual, rcond=1e-7)[0][:p]
    before, _ = covariance(found, lengths)
    after, _ = covariance(replace(found, J=J), lengths)
    more = np.diag(G @ (after[:p, :p] - before) @ G.T)
    bias: Array = np.maximum((ALLOWANCE * G @ d) ** 2 - np.maximum(more, 0.0), 0.0)
    return bias


BELOW = 0.98  # static over Coulomb friction below which it needs an explanation
FEWEST = 5  # fewest points near rest that can explain it
FS_BELOW_FC = "Fs is below Fc"  # how the explanation begins, without the values: a study fits them again afterwards


def explanation(parameters: Mapping[str, float], v: Array, friction: Array, units: AxisUnits) -> str:
    """Return why Fs is below Fc, or that the record does not show it; empty if it is not below."""
    if not {"Fc", "Fs", "vs"} <= parameters.keys() or parameters["Fs"] >= BELOW * parameters["Fc"]:
        return ""
    vs = parameters["vs"]
    speed = np.abs(v)
    against = friction * np.sign(v) - parameters.get("Fv", parameters.get("sigma2", 0.0)) * speed
    near, beyond = (speed > 0.1 * vs) & (speed <= vs), (speed > 2.0 * vs) & (speed <= 4.0 * vs)
    if np.count_nonzero(near) < FEWEST or np.count_nonzero(beyond) < FEWEST:
        return (
            f"{FS_BELOW_FC}, but the log has only {np.count_nonzero(near)} points between {0.1 * vs:.2g} and {vs:.2g} "
            f"{units.velocity}, around vs, that could show it; measure slow constant velocities in both directions"
        )
    low, high = float(np.mean(against[near])), float(np.mean(against[beyond]))
    means = (
        f"the mean friction without its viscous part is {low:.3g} {units.force} near rest (up to vs, "
        f"{np.count_nonzero(near)} points) and {high:.3g} {units.force} at 2 to 4 vs"
    )
    if low < high:
        own = parameters.keys() & {"sigma0", "sigma"}  # a model with presliding
        hidden = "" if own else ", or presliding after reversals hides it, which LuGre would show"
        return f"{FS_BELOW_FC}: this axis shows no Stribeck effect{hidden}; {means}"
    return f"{FS_BELOW_FC}, but {means}: friction near rest is not smaller; fix Fs, or measure slow constant velocities"


def identify(
    model: str | Path,
    data: Record | Sequence[Record],
    *,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
    loss: Loss = "linear",
    method: str = "auto",
    validation: Record | Sequence[Record] | None = None,
    starts: int | None = None,
    settings: InverseModelSettings | None = None,
    position_map: bool = False,
    viscous: bool = False,
    terms: Sequence[str] | Literal["auto"] = (),
) -> Identification:
    """Identify the parameters of a friction model from measured data.

    Parameters
    ----------
    model : str or Path
        Name of a friction block, or path of a ``.c`` file.
    data : Record or sequence of Record
        One record, or several segments, each with its own initial state.
    fixed : mapping of str to float, optional
        Known parameters, in the units of the block, and mass M and force offset OF of a drive.
    bounds : mapping of str to (float, float), optional
        Bounds within the ranges of the block.
    start : mapping of str to float, optional
        Start values. Parameters that keep their default value, such as delta, are identified if `start` or `bounds`
        contains them.
    loss : {"linear", "soft_l1", "huber", "cauchy", "arctan"}
        Loss function; the robust losses (all but "linear") reduce the influence of outliers.
    method : str
        "auto" selects the method from model and data: "inverse" for models without state (evaluated along the measured
        motion), "hysteresis" for models with elements, "output-error" otherwise
        (simulated along the measured motion). "free-run" continues one of these: the position simulated from the drive
        force alone is fitted to the measured one.
    validation : Record or sequence of Record, optional
        Validation data, predicted with the identified parameters; only initial states are fitted.
    starts : int, optional
        Number of searches from different start points; the best result is returned. By default 3, or 1 if `start`
        contains all parameters, and for models with elements.
    settings : InverseModelSettings, optional
        Filter of the position and, for a drive force, of both sides of the equation; by default `default_settings`.
    position_map : bool
        Whether to identify cogging and position-dependent friction together with the friction model, if the record has
        position and drive force and this improves the prediction, see `fit_with_table`.
    viscous : bool
        Whether to identify viscous friction beside a model without it, as parameter Fv, from a drive force.

    terms : sequence of str or "auto"
        What acts beside the model on a drive force: "gravity" of an arm (G_sin, G_cos), "load" (a: friction that grows
        with the transmitted force), "sides" (the same with a_drive and a_external), "direction", "drift" and
        "temperature" (with the column of that name) of the friction, "gain" of the drive, for which G_sin must be
        fixed. "auto" finds all but sides and gain by cross-validation, and ("auto", "gravity", "load") only these; a
        term that was found replaces a position map.

    Returns
    -------
    Identification
        Estimates with standard errors, predicted signal and scores.

    Raises
    ------
    FitError
        If a name is unknown, a value is out of range, or method or loss is not applicable.
    RecordError
        If a column is missing, the record has no motion, or the normal force is not positive.
    IdentificationError
        If the model cannot be identified from records.

    Notes
    -----
    The signal is the friction coefficient if friction and normal force were measured, otherwise the friction force,
    otherwise the drive force F + M a + OF. The model is the compiled FMU, run in compiled code over all samples. The
    search uses the trust-region method of `scipy.optimize.least_squares`. Its coordinates are logarithms of parameters
    whose range excludes zero, and the other parameters divided by their start values. For standard errors, see
    `covariance`.
    """
    begin = time.perf_counter()
    constraints = Constraints(dict(fixed or {}), dict(bounds or {}), dict(start or {}))
    given: dict[str, Any] = {"fixed": fixed, "bounds": bounds, "start": start, "loss": loss, "starts": starts}
    given |= {"settings": settings, "viscous": viscous}
    records = (data,) if isinstance(data, Record) else tuple(data)
    outside = terms or any(record.load is not None for record in records)
    if method == FREE_RUN and outside:
        raise FitError("Terms and the column load need a fit to the drive force; use another method, or none of them.")
    if method == FREE_RUN:
        held = [replace(record, held=True) for record in records]
        result = identify_free_run(identify(model, held, position_map=position_map, **given))
        checked = None if validation is None else _validated(result, validation)
        return replace(result, seconds=time.perf_counter() - begin, validation=checked)
    if not records:
        raise FitError("There are no records; pass at least one.")
    contact = contact_model(model, records[0].units)
    signal, unit = signal_of(records)
    contact = replace(contact, viscous=viscous and contact.lacks_viscous and signal == "force")
    listed = tuple(dict.fromkeys((terms,) if isinstance(terms, str) and terms else terms))
    candidates = (listed[1:] or CANDIDATES) if listed[:1] == ("auto",) else ()
    named = () if candidates else listed
    if contact.transmits and signal != "force":
        raise FitError(f"{contact.name} needs the force of the drive, which loads it; add the column.")
    if "gravity" in named and not records[0].units.rotary:
        raise FitError("The gravity of an arm needs an angle; a constant force on a linear axis is OF.")
    check_terms(CANDIDATES[:1] if candidates else named, contact, signal, constraints.fixed, records)
    check_constraints(contact, signal, constraints, candidates or named)
    name, chosen = find_method(contact, method)
    segments = [prepare(record, contact, signal, settings) for record in records]
    middle, warm = middle_of(records), mean_temperature(records)
    segments = [replace(segment, middle=middle, warm=warm) for segment in segments]
    Fn0 = _reference_load(constraints, segments)
    with driven(contact.path) as drive, quiet_runs():  # parameters that a block refuses are part of a search
        about = traits(segments, Fn0 or 1.0)
        fitted = FitData(contact, drive, segments, about, constraints, records[0].units, Fn0, named)
        search = partial(chosen.fit, loss=loss, starts=starts)
        if candidates:
            fitted, fit = with_terms(fitted, search, candidates)
        else:
            fit = search(with_starts(fitted))
        if signal == "force":
            check_load(fit)
        result = _result(model, contact, name, fit, signal, unit, records, settings)
        flat = not position_map or signal != "force" or (candidates and fitted.terms) or contact.transmits
        with_table = None if flat else fit_with_table(fit, fitted, loss)
        checked = None if validation is None else _validated(result, validation)
        if with_table is not None:
            fit, position = with_table
            position = replace(position, train_without=result.train, validation_without=checked)
            result = replace(_result(model, contact, name, fit, signal, unit, records, settings), position=position)
            checked = None if validation is None else _validated(result, validation)
    return replace(result, seconds=time.perf_counter() - begin, validation=checked)


def _reference_load(constraints: Constraints, segments: Sequence[PreparedSegment]) -> float | None:
    """Return the normal force at which the parameters are valid: the fixed value, or the mean."""
    if segments[0].per is None:
        return None
    mean = float(np.mean(np.concatenate([segment.per for segment in segments if segment.per is not None])))
    return float(constraints.fixed.get("Fn0", mean))


def _reported(setup: Setup, problem: Problem, x: Array) -> tuple[dict[str, float], dict[str, float]]:
    """Return parameters and initial states at x; names of later records end with the number of the record."""
    parameters = setup.assemble(problem.values(x, None))
    initial = {}
    for index in range(len(problem.segments)):
        for name, value in setup.states(parameters, problem.values(x, index)).items():
            initial[name if index == 0 else f"{name} ({index + 1})"] = value
    return parameters, initial


def _sensitivity(setup: Setup, problem: Problem, x: Array) -> Array:
    """Return the derivatives of the reported values with respect to the coordinates; shape (values, p)."""

    def flat(at: Array) -> Array:
        return np.array([value for part in _reported(setup, problem, at) for value in part.values()])

    step = 1e-6
    return np.column_stack([(flat(x + step * e) - flat(x - step * e)) / (2.0 * step) for e in np.eye(len(x))])


def _result(
    model: str | Path,
    contact: ContactModel,
    method: str,
    fit: BlockFit,
    signal: str,
    unit: str,
    records: Sequence[Record],
    settings: InverseModelSettings | None,
) -> Identification:
    setup, problem, found = fit.setup, fit.problem, fit.found
    lengths = [len(segment.measured) for segment in problem.segments]
    spread, robust = covariance(found, lengths)
    G = _sensitivity(setup, problem, found.x)
    C = G @ spread @ G.T
    measured = np.concatenate([segment.measured for segment in problem.segments])
    inertia = [found.x[i] * found.J[:, i] for i, c in enumerate(setup.coordinates) if c.name == "M"]
    misfit = misfit_variance(found, [found.residual + measured / problem.size, *inertia], lengths, G)
    noise = np.sqrt(np.maximum(np.diag(C), 0.0))
    error = np.hypot(noise, np.sqrt(misfit))
    parameters, initial = _reported(setup, problem, found.x)
    names = [*parameters, *initial]
    both = {**parameters, **initial}
    # parameters with a zero Jacobian column get no standard error
    seen = ~unseen(found.J)
    without = [name for i, name in enumerate(names) if np.any(G[i]) and not np.any((G[i] != 0.0) & seen)]
    error = np.where(np.isin(names, without), np.nan, error)
    errors = {name: float(value) for name, value in zip(names, error, strict=True)}
    noises = {name: float(value) for name, value in zip(names, noise, strict=True)}
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.nan_to_num(C / np.outer(noise, noise), nan=0.0, posinf=0.0, neginf=0.0)
    np.fill_diagonal(correlation, 1.0)
    predicted = measured + found.residual * problem.size
    # the coefficients of a force over position stand behind the residual
    table = 0 if problem.regressor is None else len(problem.regressor.project(found.residual)) - len(measured)
    samples = independent_samples([p.measured for p in problem.segments])
    aic, bic = criteria(found.residual * problem.size, samples, len(found.x) + table)
    warnings = [] if found.converged else ["the search reached its iteration limit; give better start values"]
    if (
        signal != "mu"
        and "Fs" not in without
        and (why := _static_friction(problem, found.x, parameters, predicted, records))
    ):
        warnings.append(why)

    def unit_of(name: str) -> str:
        return setup.units.get(name.split(" (")[0], "1")

    def estimate(name: str) -> Estimate:
        return Estimate(name, both[name], errors[name], unit_of(name), noises[name])

    return Identification(
        model=contact.name,
        method=method,
        parameters={name: estimate(name) for name in parameters},
        initial={name: estimate(name) for name in initial},
        fixed={name: float(value) for name, value in setup.constants.items()},
        correlation=correlation,
        t=np.concatenate([segment.t for segment in problem.segments]),
        measured=measured,
        predicted=predicted,
        signal=signal,
        unit=unit,
        train=score(measured, predicted),
        validation=None,
        aic=aic,
        bic=bic,
        weak=weak_parameters(
            contact, list(parameters), parameters, errors, correlation, _at_bound(problem, found.x), without
        ),
        warnings=tuple(warnings),
        seconds=0.0,
        simulations=problem.simulations,
        errors="robust" if robust else "classic",
        block=model,
        records=tuple(records),
        settings=settings,
    )


def _static_friction(
    problem: Problem, x: Array, parameters: Mapping[str, float], predicted: Array, records: Sequence[Record]
) -> str:
    """Return an explanation of a static friction below the Coulomb friction."""
    segments = problem.segments
    v = np.concatenate([segment.rows(segment.inputs["v"]) for segment in segments])
    model = np.concatenate([segment.rows(problem.force(x, index)) for index, segment in enumerate(segments)])
    measured = np.concatenate([segment.measured for segment in segments])
    # the friction of the model and what the prediction lacks
    return explanation(parameters, v, model + measured - predicted, records[0].units)


def _at_bound(problem: Problem, x: Array) -> dict[str, float]:
    found = {}
    lower, upper = problem.bounds()
    for c, at, low, high in zip(problem.coordinates, x, lower, upper, strict=True):
        for limit, value in ((low, c.lower), (high, c.upper)):
            if c.segment is None and np.isfinite(limit) and abs(at - limit) < 1e-6:
                found[c.name] = value
    return found


def _validated(result: Identification, validation: Record | Sequence[Record]) -> Score:
    records = (validation,) if isinstance(validation, Record) else tuple(validation)
    pairs = [result.compare(record) for record in records]
    return score(np.concatenate([m for m, _ in pairs]), np.concatenate([p for _, p in pairs]))
