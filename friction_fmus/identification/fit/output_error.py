"""Least squares of a simulation against measured signals (output error), simulator passed in.

The simulator is any callable from parameter values to signals: here a co-simulated servo made of FMUs, in
the tests a closed form. What the fit minimises is the sum over the targets of |simulated - measured|^2 /
scale^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
import scipy.optimize

from friction_fmus.identification.data.record import Array
from friction_fmus.identification.errors import ExcitationError, FitError
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.rank import not_separated

S = TypeVar("S")
T = TypeVar("T")

#: From parameter values to simulated signals, each of the shape of its target.
Simulator = Callable[[Mapping[str, float]], Mapping[str, Array]]


class Mapper(Protocol):
    """Applies a function to several items: `map`, or the `map` of an executor."""

    def __call__(self, function: Callable[[S], T], items: Iterable[S], /) -> Iterable[T]:
        """Return the results in the order of the items."""


@dataclass(frozen=True)
class Unknown:
    """A parameter to be fitted.

    Attributes
    ----------
    name : str
        Name under which the simulator receives it.
    start : float
        Start value, in `unit`.
    step : float
        Step of the finite differences, in `unit`. It also scales the search. Take a step whose effect stands
        clear of quantisation and of the events in the simulation: 0.5 to 5 % of the value, not the square
        root of the machine precision.
    unit : str
        Unit of the parameter.
    lower, upper : float
        Bounds, in `unit`.
    """

    name: str
    start: float
    step: float
    unit: str
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True, eq=False)
class Target:
    """A measured signal the simulation is to reproduce.

    Attributes
    ----------
    measured : array, shape (n,)
        The measurement.
    scale : float
        Error that counts as one, in the unit of the signal: it weighs the targets against each other.
    first : int
        Samples before this one are left out.
    """

    measured: Array
    scale: float
    first: int = 0


@dataclass(frozen=True, eq=False)
class OutputErrorFit:
    """Result of an output-error fit.

    Attributes
    ----------
    parameters : mapping of str to Estimate
        Estimates with robust standard errors.
    classic_errors : mapping of str to float
        Standard errors for uncorrelated residuals; too small wherever neighbouring samples err alike.
    rms : mapping of str to float
        Root mean square error of each target, in its unit.
    simulations : int
        Number of simulations used.
    converged : bool
        Whether the search ended by its tolerances rather than by `max_iterations`.
    correlation : array, shape (p, p)
        Correlation of the estimates.
    """

    parameters: Mapping[str, Estimate]
    classic_errors: Mapping[str, float]
    rms: Mapping[str, float]
    simulations: int
    converged: bool
    correlation: Array

    def values(self) -> dict[str, float]:
        """Parameter values without their errors."""
        return {name: estimate.value for name, estimate in self.parameters.items()}


def fit_output_error(
    simulate: Simulator,
    unknowns: Sequence[Unknown],
    targets: Mapping[str, Target],
    *,
    mapper: Mapper = map,
    tolerance: float = 1e-3,
    max_iterations: int = 6,
    correlation: int = 200,
    iterated: Callable[[int], None] | None = None,
) -> OutputErrorFit:
    """Fit the parameters of a simulation to measured signals.

    Parameters
    ----------
    simulate : callable
        From parameter values to signals.
    unknowns : sequence of Unknown
        Parameters to be fitted.
    targets : mapping of str to Target
        Measured signals by the name the simulator gives them.
    mapper : callable, optional
        How the runs of one Jacobian are done; the `map` of a pool runs them side by side.
    tolerance : float
        The search ends when the cost, or the parameters in units of their steps, change by less than this
        part.
    max_iterations : int
        Largest number of points tried; each costs at most ``1 + len(unknowns)`` simulations.
    correlation : int
        Lag in samples up to which the residuals may be correlated, for the robust standard errors.
    iterated : callable, optional
        Called with the number of simulations done so far.

    Returns
    -------
    OutputErrorFit

    Raises
    ------
    FitError
        No unknowns or targets, names given twice, a start value outside its bounds, a step or scale that is
        not positive, a signal that is missing, of the wrong shape or not finite.
    ExcitationError
        The targets do not depend on a parameter, or not independently.

    Notes
    -----
    The search is the trust-region method of `scipy.optimize.least_squares` on the parameters divided by
    their steps, with forward differences of one step. The covariance is (J'J)^-1 S (J'J)^-1 with S the sum
    over lags of the products of neighbouring scores J_k r_k, weighted linearly down to `correlation` (W.
    Newey, K. West, "A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
    covariance matrix", Econometrica 55, 1987): the errors of a servo model are systematic and last for many
    samples, which the classic formula s^2 (J'J)^-1 would count as so many independent measurements.
    """
    _check(unknowns, targets)
    names = [unknown.name for unknown in unknowns]
    step = np.array([unknown.step for unknown in unknowns])
    start = np.array([unknown.start for unknown in unknowns]) / step
    lower = np.array([unknown.lower for unknown in unknowns]) / step
    upper = np.array([unknown.upper for unknown in unknowns]) / step
    weight = {
        name: 1.0 / (target.scale * math.sqrt(len(target.measured) - target.first)) for name, target in targets.items()
    }
    simulations = 0

    def named(x: Array) -> dict[str, float]:
        return {name: float(value) for name, value in zip(names, x * step, strict=True)}

    def stacked(signals: Mapping[str, Array]) -> Array:
        nonlocal simulations
        simulations += 1
        if iterated is not None:
            iterated(simulations)
        return np.concatenate([_error(signals, name, targets[name]) * weight[name] for name in targets])

    # the residual of every point, so that its Jacobian need not simulate it again
    latest: dict[bytes, Array] = {}
    # the latest Jacobian and where it was taken
    known: tuple[Array, Array] | None = None

    def residual(x: Array) -> Array:
        found = stacked(simulate(named(x)))
        latest[x.tobytes()] = found
        return found

    def jacobian(x: Array) -> Array:
        nonlocal known
        if known is not None and np.max(np.abs(x - known[0])) < 1.0:
            return known[1]
        centre = latest.get(x.tobytes())
        if centre is None:
            centre = residual(x)
        # forwards, or backwards where the bound is in the way
        direction = np.where(x + 1.0 <= upper, 1.0, -1.0)
        shifted = [named(x + direction[i] * np.eye(len(x))[i]) for i in range(len(x))]
        moved = [stacked(signals) for signals in mapper(simulate, shifted)]
        known = x, np.column_stack([(m - centre) / d for m, d in zip(moved, direction, strict=True)])
        return known[1]

    result = scipy.optimize.least_squares(
        residual,
        start,
        jac=jacobian,
        bounds=(lower, upper),
        x_scale=1.0,
        ftol=tolerance,
        xtol=tolerance,
        gtol=None,
        max_nfev=max_iterations,
    )
    J = np.asarray(result.jac, dtype=np.float64)
    _require_excitation(J, names)
    r = np.asarray(result.fun, dtype=np.float64)
    inverse = np.linalg.inv(J.T @ J)
    classic = np.sqrt(np.diag(inverse) * float(r @ r) / max(1, len(r) - len(names))) * step
    lengths = [len(target.measured) - target.first for target in targets.values()]
    covariance = inverse @ score_covariance(J, r, lengths, correlation) @ inverse
    spread = np.sqrt(np.diag(covariance))
    robust = spread * step

    parameters = {
        unknown.name: Estimate(unknown.name, float(value), float(error), unknown.unit)
        for unknown, value, error in zip(unknowns, result.x * step, robust, strict=True)
    }
    parts = np.split(r, np.cumsum(lengths)[:-1])
    rms = {
        name: float(np.linalg.norm(part)) * target.scale
        for (name, target), part in zip(targets.items(), parts, strict=True)
    }
    return OutputErrorFit(
        parameters,
        classic_errors=dict(zip(names, (float(error) for error in classic), strict=True)),
        rms=rms,
        simulations=simulations,
        converged=bool(result.status > 0),
        correlation=covariance / np.outer(spread, spread),
    )


def score_covariance(J: Array, r: Array, lengths: Sequence[int], correlation: int) -> Array:
    """Newey-West estimate of the covariance of J' r; targets add up sample by sample where they share a time
    axis."""
    products = np.split(J * r[:, None], np.cumsum(lengths)[:-1])
    if len(set(lengths)) == 1:
        products = [np.sum(products, axis=0)]
    total = np.zeros((J.shape[1], J.shape[1]))
    for score in products:
        lags = min(correlation, len(score) - 1)
        total += score.T @ score
        for lag in range(1, lags + 1):
            gamma = score[lag:].T @ score[:-lag]
            total += (1.0 - lag / (lags + 1.0)) * (gamma + gamma.T)
    return total


def _error(signals: Mapping[str, Array], name: str, target: Target) -> Array:
    if name not in signals:
        raise FitError(
            f"The simulation returned {', '.join(signals) or 'nothing'} and not {name!r}; name the target as it does."
        )
    simulated = np.asarray(signals[name], dtype=np.float64)
    if simulated.shape != target.measured.shape:
        raise FitError(
            f"The simulation returned {name!r} with shape {simulated.shape}, measured is "
            f"{target.measured.shape}; simulate the instants of the record."
        )
    error: Array = (simulated - target.measured)[target.first :]
    if not np.all(np.isfinite(error)):
        raise FitError(
            f"The simulation of {name!r} is not finite from sample "
            f"{int(np.argmin(np.isfinite(error))) + target.first} on; reduce the communication step or "
            "narrow the bounds of the parameters."
        )
    return error


def _require_excitation(J: Array, names: Sequence[str]) -> None:
    length = np.linalg.norm(J, axis=0)
    if np.any(length == 0.0):
        raise ExcitationError(
            f"The simulation does not depend on {names[int(np.argmin(length))]}; leave it out or record a "
            "motion that needs it."
        )
    _, singular, right = np.linalg.svd(J / length, full_matrices=False)
    if mixed := not_separated(singular, right, names):
        raise ExcitationError(
            f"The measured signals do not tell {' and '.join(mixed)} apart; fix one of them or record another motion."
        )


def _check(unknowns: Sequence[Unknown], targets: Mapping[str, Target]) -> None:
    if not unknowns or not targets:
        raise FitError("A fit needs at least one unknown and one target.")
    names = [unknown.name for unknown in unknowns]
    if len(set(names)) < len(names):
        raise FitError(f"An unknown is given twice among {', '.join(names)}.")
    for unknown in unknowns:
        if not (math.isfinite(unknown.step) and unknown.step > 0.0):
            raise FitError(f"The step of {unknown.name} is {unknown.step:g}; it must be positive and finite.")
        if not unknown.lower <= unknown.start <= unknown.upper:
            raise FitError(
                f"The start value {unknown.start:g} of {unknown.name} is outside {unknown.lower:g} .. "
                f"{unknown.upper:g}; move it or the bounds."
            )
    for name, target in targets.items():
        if not (math.isfinite(target.scale) and target.scale > 0.0):
            raise FitError(f"The scale of the target {name!r} is {target.scale:g}; it must be positive and finite.")
        if not 0 <= target.first < len(target.measured):
            raise FitError(
                f"The target {name!r} starts at sample {target.first} of {len(target.measured)}; choose one within."
            )
