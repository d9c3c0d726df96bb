"""Choice of what acts beside a friction model, by cross-validation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Final

import numpy as np

from friction_fmus.errors import FitError, RecordError, did_you_mean
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.axis_terms import CANDIDATES, LIMITS, OF_FRICTION, TERMS, VALUES, force_beside
from friction_fmus.identification.fit.block_fit import BlockFit, FitData
from friction_fmus.identification.fit.contact_model import ContactModel
from friction_fmus.identification.fit.position import BLOCKS, crossed
from friction_fmus.identification.fit.search import covariance

LESS: Final = 0.99  # largest error of the cross-validation with a term, relative to the error without it
CLEAR: Final = 4.0  # smallest magnitude of a value over its standard error
WRONG: Final = 0.3  # deviation of the factor of a known load from 1 that is an error
NOTABLE: Final = (
    1.1  # least error of the fit without a factor of the load, relative to the error with it, that shows it
)
SLOW: Final = 0.1  # Stribeck velocity of the regression, over the largest speed


def check_terms(
    terms: Sequence[str],
    contact: ContactModel,
    signal: str,
    fixed: Mapping[str, float],
    records: Sequence[Record],
) -> None:
    """Raise an error for terms that cannot be identified."""
    for term in terms:
        if term not in TERMS:
            raise FitError(f"There is no term {term!r}{did_you_mean(term, TERMS)}; use {', '.join(TERMS)}.")
        if term in OF_FRICTION and not contact.loaded:
            raise FitError(
                f"{contact.name} has no input Fn, which {term} changes; use a model with it, or omit {term}."
            )
        if twice := [name for name in TERMS[term] if name in contact.parameters]:
            raise FitError(f"{contact.name} has a parameter {twice[0]} of its own, as {term} has; omit {term}.")
    if "temperature" in terms and any(record.temperature is None for record in records):
        raise FitError("The term temperature needs the column temperature; add it, or omit the term.")
    if terms and signal != "force":
        raise FitError("Terms beside the friction model need a drive force; add the column, or omit the terms.")
    if {"load", "sides"} <= set(terms):
        raise FitError("The terms load and sides describe the same; use one of them.")
    if "gain" in terms and "G_sin" not in fixed:
        raise FitError("The gain of the drive needs a known torque: fix G_sin, the largest torque of gravity.")


def check_load(fit: BlockFit) -> None:
    """Raise an error if the known load would act on the axis with quite another factor."""
    segments = fit.problem.segments
    loads = [np.zeros(len(each.record)) if each.record.load is None else each.record.load for each in segments]
    column = np.concatenate([each.rows(load) for each, load in zip(segments, loads, strict=True)]) / fit.problem.size
    if not np.any(column):
        return
    A = np.column_stack([fit.found.J, column])
    A /= np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    without, x = (np.linalg.lstsq(part, fit.found.residual, rcond=1e-10)[0] for part in (A[:, :-1], A))
    errors = [np.linalg.norm(fit.found.residual - A[:, : len(each)] @ each) for each in (without, x)]
    if errors[0] < NOTABLE * errors[1]:  # a constant load is like an offset, and a small one does not show
        return
    factor = 1.0 + float(x[-1] / np.linalg.norm(column))
    if not 1.0 - WRONG < factor < 1.0 + WRONG:
        raise RecordError(
            f"The drive force shows {factor:.2g} times the load; correct its sign, which is positive if it pushes the "
            "axis forward, its unit, or the gain of the drive."
        )


def with_starts(data: FitData) -> FitData:
    """Return the data with start values of their terms from a linear regression, as far as it has them."""
    terms = tuple(term for term in CANDIDATES if term in data.terms)
    if not terms or "gain" in data.terms:
        return data
    measured = np.concatenate([segment.measured for segment in data.segments])
    values = _regression(data, terms, {}, measured)
    return _starting_at(data, {name: value for term in terms for name in TERMS[term] if (value := values[name])})


def _starting_at(data: FitData, values: Mapping[str, float]) -> FitData:
    """Return the data with these start values within their limits, beside those of the user."""
    limits = {name: LIMITS.get(name, (-inf, inf)) for name in VALUES}
    inside = {name: float(np.clip(value, *limits[name])) for name, value in values.items() if name in VALUES}
    return replace(data, constraints=replace(data.constraints, start={**inside, **data.constraints.start}))


def with_terms(
    data: FitData, again: Callable[[FitData], BlockFit], candidates: Sequence[str]
) -> tuple[FitData, BlockFit]:
    """Return the data and the fit with the terms that improve the prediction."""
    # They are chosen with Coulomb, Stribeck and viscous friction, which make a linear regression; a search that has to
    # explain gravity by friction ends anywhere. Those that are not clear beside the model are left out again.
    terms, values = _chosen(data, candidates)
    data = _starting_at(replace(data, terms=terms), values)
    start = data.constraints.start
    while True:
        fit = again(data)
        spread = covariance(fit.found, [len(each.measured) for each in data.segments])[0]
        names = [c.name for c in fit.problem.coordinates]
        unclear = [
            term
            for term in data.terms
            if not _clear(fit.found.x, spread, [names.index(n) for n in TERMS[term] if n in names])
        ]
        if not unclear:
            return data, fit
        kept = tuple(term for term in data.terms if term not in unclear)
        gone = VALUES - {name for term in kept for name in TERMS[term]}
        start = {name: value for name, value in start.items() if name not in gone}
        data = replace(data, terms=kept, constraints=replace(data.constraints, start=start))


def _clear(x: Array, spread: Array, at: Sequence[int]) -> bool:
    """Return whether values differ from zero, together: on a short stroke, no part of gravity does so alone."""
    own = spread[np.ix_(at, at)]
    return bool(np.all(np.diag(own) > 0.0)) and float(x[at] @ np.linalg.pinv(own) @ x[at]) > CLEAR**2


def _possible(data: FitData, term: str) -> bool:
    if term == "temperature" and any(each.record.temperature is None for each in data.segments):
        return False
    turns = term != "gravity" or (data.units.rotary and all(each.record.q is not None for each in data.segments))
    own = data.model.parameters.keys() & TERMS[term]
    return turns and not own and (term not in OF_FRICTION or data.model.loaded)


def _chosen(data: FitData, candidates: Sequence[str]) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return the terms that a linear regression needs, and all its values."""
    terms: tuple[str, ...] = ()
    measured = np.concatenate([segment.measured for segment in data.segments])
    block = np.arange(len(measured)) * BLOCKS // len(measured)
    values = _regression(data, terms, {}, measured)

    def error(tried: tuple[str, ...]) -> float:
        columns = np.column_stack(list(_columns(data, tried, values).values()))
        scale = np.linalg.norm(columns, axis=0)
        A = columns / np.where(scale > 0.0, scale, 1.0)
        found = np.linalg.lstsq(A, measured, rcond=None)[0]
        return crossed(A, np.zeros((len(A), 0)), measured - A @ found, block)

    left = [term for term in candidates if _possible(data, term)]
    while left:
        without = error(terms)
        errors = {term: error((*terms, term)) for term in left}
        best = min(errors, key=lambda each: errors[each])
        if errors[best] > LESS * without:
            break
        left.remove(best)
        found = _regression(data, (*terms, best), values, measured)
        limits = [(found[name], *LIMITS.get(name, (-inf, inf))) for name in TERMS[best]]
        if all(low <= value <= high for value, low, high in limits):  # else perhaps after another term
            terms, values = (*terms, best), found
            left = [term for term in candidates if term not in terms and _possible(data, term)]
    return terms, values


def _regression(data: FitData, terms: Sequence[str], before: Mapping[str, float], measured: Array) -> dict[str, float]:
    """Return the values of a linear regression; twice, as the load depends on gravity and offset."""
    values = dict(before)
    for _ in range(2):
        columns = _columns(data, terms, values)
        A = np.column_stack(list(columns.values()))
        scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        found = np.linalg.lstsq(A / scale, measured, rcond=None)[0] / scale
        values = dict(zip(columns, (float(value) for value in found), strict=True))
        level = abs(values["Fc"]) or 1.0
        values |= {name: values[name] / level for name in ("direction", "drift", "warming") if name in values}
    return values


def _columns(data: FitData, terms: Sequence[str], values: Mapping[str, float]) -> dict[str, Array]:
    """Return the drive force for a unit of each value, at the rows of the fit."""
    parts = []
    for segment in data.segments:
        v, t = segment.inputs["v"], segment.record.t
        assert segment.a is not None
        way, one = np.sign(v), np.ones(len(v))
        slow = np.exp(-((v / (SLOW * data.traits.speed)) ** 2))
        outside = -force_beside(values, segment) - values.get("OF", 0.0)
        load = np.abs(outside - segment.drive)
        found = {"M": segment.a, "OF": one, "Fc": way, "slow": way * slow, "Fv": v}
        level = 1.0 + values.get("a", 0.0) * load / (abs(values.get("Fc", 0.0)) or 1.0)
        if "gravity" in terms:
            q = segment.record.column("q")
            found |= {"G_sin": np.sin(q), "G_cos": np.cos(q)}
        if "load" in terms:
            found["a"] = way * load
        if "direction" in terms:
            found["direction"] = level
        if "drift" in terms:
            found["drift"] = way * level * (t - segment.middle)
        if "temperature" in terms:
            found["warming"] = way * level * (segment.record.column("temperature") - segment.warm)
        parts.append({name: segment.rows(column) for name, column in found.items()})
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
