"""A friction model and data -> its parameters: one call for all methods."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from friction_fmus.data import MeasuredAxis
from friction_fmus.identification.closed_loop import identify_closed_loop, validated
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.errors import FitError
from friction_fmus.identification.fit.drives import driven
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.fitting import Fit, FitData
from friction_fmus.identification.fit.idim import InverseModelSettings
from friction_fmus.identification.fit.models import ContactModel, contact_model
from friction_fmus.identification.fit.problem import Problem
from friction_fmus.identification.fit.scores import Score, criteria, independent_samples, score, weak_parameters
from friction_fmus.identification.fit.search import Loss, covariance
from friction_fmus.identification.fit.setup import Setup, Wishes, check_wishes
from friction_fmus.identification.fit.simulation_data import Piece, prepare, signal_of, traits
from friction_fmus.identification.methods import find_method
from friction_fmus.identification.result import Identification

#: Part of a column of the Jacobian's size that counts as no dependence at all.
UNSEEN = 1e-9


def identify(
    model: str | Path,
    data: Record | Sequence[Record] | MeasuredAxis,
    *,
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start: Mapping[str, float] | None = None,
    loss: Loss = "linear",
    method: str = "auto",
    validation: Record | Sequence[Record] | None = None,
    starts: int | None = None,
    settings: InverseModelSettings | None = None,
) -> Identification:
    """Identify the parameters of a friction model from measured data.

    Parameters
    ----------
    model : str or Path
        Name of a friction block, or path of a ``.c`` file.
    data : Record, sequence of Record, or MeasuredAxis
        One measurement; several pieces, each of which begins in a state of its own; or an axis with the servo it was
        measured with, whose closed loop is then simulated.
    fixed : mapping of str to float, optional
        Parameters that are known, in the units of the block; of M and OF, mass and offset of a drive, too.
    bounds : mapping of str to (float, float), optional
        Bounds, inside of the ranges of the block.
    start : mapping of str to float, optional
        Where to start. Parameters that by default keep their value, such as delta, are identified if `start` or
        `bounds` names them.
    loss : {"linear", "soft_l1", "huber", "cauchy", "arctan"}
        How errors count; all but the first make little of outliers.
    method : str
        By default ("auto") the one that suits model and data: "inverse" for laws without a state (the law evaluated
        along the measured motion), "hysteresis" for those with elements, "output-error" for the others (the block is
        simulated along the measured motion), "closed-loop" for a `MeasuredAxis`.
    validation : Record or sequence of Record, optional
        Data that are predicted with the result, only their initial states fitted.
    starts : int, optional
        Searches from different points, of which the best end is taken; by default 1 if `start` names all parameters,
        for elements of hysteresis and in a closed loop, otherwise 3.
    settings : InverseModelSettings, optional
        Filter of position and, for a drive force, of both sides of the equation; by default as `default_settings`.

    Returns
    -------
    Identification

    Raises
    ------
    FitError
        A name is unknown, a value out of range, a method or loss not applicable.
    RecordError
        A column is missing, nothing moves, or the contact opens.
    IdentificationError
        The model cannot be identified from records.

    Notes
    -----
    The signal is the friction coefficient where friction and normal force were measured, else the friction, else the
    drive force, then F + M a + OF. The model is the compiled FMU, run in compiled code over all samples. The
    coordinates of the search are the logarithms of the parameters whose range excludes zero, and the others in parts of
    their start values; the method is the trust region of `scipy.optimize.least_squares`. Standard errors: see
    `covariance`.
    """
    begin = time.perf_counter()
    wishes = Wishes(dict(fixed or {}), dict(bounds or {}), dict(start or {}))

    if isinstance(data, MeasuredAxis):
        if method not in ("auto", "closed-loop"):
            raise FitError(
                f"The method for an axis with its servo is 'closed-loop', not {method!r}; or give its record."
            )
        opened = identify(
            model, data.record, fixed=fixed, bounds=bounds, start=start, loss=loss, starts=starts, settings=settings
        )
        closed = identify_closed_loop(model, data, opened, wishes)
        checked = None if validation is None else validated(closed, validation)
        return closed.timed(time.perf_counter() - begin, checked)
    records = (data,) if isinstance(data, Record) else tuple(data)
    if not records:
        raise FitError("There are no records; give at least one.")
    contact = contact_model(model, records[0].units)
    signal, unit = signal_of(records)
    check_wishes(contact, signal, wishes)
    name, chosen = find_method(contact, method)
    pieces = [prepare(record, contact, signal, settings) for record in records]
    Fn0 = _reference_load(wishes, pieces)
    with driven(contact.path) as drive:
        given = FitData(contact, drive, pieces, traits(pieces, Fn0 or 1.0), wishes, records[0].units, Fn0)
        result = _result(model, contact, name, chosen.fit(given, loss, starts), signal, unit, records, settings)
    checked = None if validation is None else _validated(result, validation)
    return result.timed(time.perf_counter() - begin, checked)


def _reference_load(wishes: Wishes, pieces: Sequence[Piece]) -> float | None:
    """The normal force at which the parameters hold: as fixed, else the mean one."""
    if pieces[0].per is None:
        return None
    mean = float(np.mean(np.concatenate([piece.per for piece in pieces if piece.per is not None])))
    return float(wishes.fixed.get("Fn0", mean))


def _reported(setup: Setup, problem: Problem, x: Array) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters and initial states at x; those of later records have their number behind the name."""
    parameters = setup.assemble(problem.values(x, None))
    initial = {}
    for index in range(len(problem.pieces)):
        for name, value in setup.states(parameters, problem.values(x, index)).items():
            initial[name if index == 0 else f"{name} ({index + 1})"] = value
    return parameters, initial


def _sensitivity(setup: Setup, problem: Problem, x: Array) -> Array:
    """How the reported values move with the coordinates, by central differences; shape (values, p)."""

    def flat(at: Array) -> Array:
        return np.array([value for part in _reported(setup, problem, at) for value in part.values()])

    step = 1e-6
    return np.column_stack([(flat(x + step * e) - flat(x - step * e)) / (2.0 * step) for e in np.eye(len(x))])


def _result(
    model: str | Path,
    contact: ContactModel,
    method: str,
    fit: Fit,
    signal: str,
    unit: str,
    records: Sequence[Record],
    settings: InverseModelSettings | None,
) -> Identification:
    setup, problem, found = fit.setup, fit.problem, fit.found
    lengths = [len(piece.measured) for piece in problem.pieces]
    spread, robust = covariance(found, lengths)
    G = _sensitivity(setup, problem, found.x)
    C = G @ spread @ G.T
    error = np.sqrt(np.maximum(np.diag(C), 0.0))
    parameters, initial = _reported(setup, problem, found.x)
    names = [*parameters, *initial]
    both = {**parameters, **initial}
    # what no column of the Jacobian moves has no error that the data could tell
    seen = np.linalg.norm(found.J, axis=0) > UNSEEN * max(float(np.linalg.norm(found.J)), 1e-300)
    unseen = [name for i, name in enumerate(names) if np.any(G[i]) and not np.any((G[i] != 0.0) & seen)]
    error = np.where(np.isin(names, unseen), np.nan, error)
    errors = {name: float(value) for name, value in zip(names, error, strict=True)}
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.nan_to_num(C / np.outer(error, error), nan=0.0, posinf=0.0, neginf=0.0)
    np.fill_diagonal(correlation, 1.0)
    measured = np.concatenate([piece.measured for piece in problem.pieces])
    predicted = measured + found.residual * problem.size
    aic, bic = criteria(
        found.residual * problem.size, independent_samples([p.measured for p in problem.pieces]), len(found.x)
    )
    warnings = () if found.converged else ("the search ended by its limit of iterations; give better start values",)

    def unit_of(name: str) -> str:
        return setup.units.get(name.split(" (")[0], "1")

    def estimate(name: str) -> Estimate:
        return Estimate(name, both[name], errors[name], unit_of(name))

    return Identification(
        model=contact.name,
        method=method,
        parameters={name: estimate(name) for name in parameters},
        initial={name: estimate(name) for name in initial},
        fixed={name: float(value) for name, value in setup.constants.items()},
        correlation=correlation,
        t=np.concatenate([piece.t for piece in problem.pieces]),
        measured=measured,
        predicted=predicted,
        signal=signal,
        unit=unit,
        train=score(measured, predicted),
        validation=None,
        aic=aic,
        bic=bic,
        weak=weak_parameters(
            contact, list(parameters), parameters, errors, correlation, _at_bound(problem, found.x), unseen
        ),
        warnings=warnings,
        seconds=0.0,
        simulations=problem.simulations,
        errors="robust" if robust else "classic",
        block=model,
        records=tuple(records),
        settings=settings,
    )


def _at_bound(problem: Problem, x: Array) -> dict[str, float]:
    found = {}
    lower, upper = problem.bounds()
    for c, at, low, high in zip(problem.coordinates, x, lower, upper, strict=True):
        for limit, value in ((low, c.lower), (high, c.upper)):
            if c.piece is None and np.isfinite(limit) and abs(at - limit) < 1e-6:
                found[c.name] = value
    return found


def _validated(result: Identification, validation: Record | Sequence[Record]) -> Score:
    records = (validation,) if isinstance(validation, Record) else tuple(validation)
    pairs = [result.compare(record) for record in records]
    return score(np.concatenate([m for m, _ in pairs]), np.concatenate([p for _, p in pairs]))
