"""Output-error identification: least squares of simulated against measured signals.

The simulator is a callable that returns signals for parameter values, such as a co-simulated servo or a closed form.
The fit minimises the sum over the targets of |simulated - measured|^2 / scale^2.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
import scipy.optimize

from friction_fmus.errors import ExcitationError, FitError
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.estimate import Estimate, Estimated, dependent_columns, score_covariance

S = TypeVar("S")
T = TypeVar("T")

#: Function of parameter values that returns simulated signals, each with the shape of its target.
Simulator = Callable[[Mapping[str, float]], Mapping[str, Array]]


class Mapper(Protocol):
    """Function that applies another function to several items: `map`, or the `map` method of an executor."""

    def __call__(self, function: Callable[[S], T], items: Iterable[S], /) -> Iterable[T]:
        """Return the results in the order of the items."""


@dataclass(frozen=True)
class Unknown:
    """Parameter to fit.

    Attributes
    ----------
    name : str
        Name that the simulator receives.
    start : float
        Start value, in `unit`.
    step : float
        Step of the finite differences, in `unit`; it also scales the search. The effect of the step must exceed
        quantisation and event errors of the simulation: use 0.5 to 5 % of the value, not the square root of the machine
        precision.
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
class TargetSignal:
    """Measured signal to be reproduced by the simulation.

    Attributes
    ----------
    measured : array, shape (n,)
        Measured samples.
    scale : float
        Error that counts as one, in the unit of the signal; determines the relative weight of the targets.
    first : int
        First sample used in the fit.
    """

    measured: Array
    scale: float
    first: int = 0


@dataclass(frozen=True, eq=False)
class OutputErrorFit(Estimated):
    """Result of an output-error fit.

    Attributes
    ----------
    parameters : mapping of str to Estimate
        Estimates with robust standard errors.
    classic_errors : mapping of str to float
        Standard errors for uncorrelated residuals; too small if the residuals of neighbouring samples are correlated.
    rms : mapping of str to float
        Root mean square error of each target, in its unit.
    simulations : int
        Number of simulations.
    converged : bool
        Whether the search converged before `max_iterations`.
    correlation : array, shape (p, p)
        Correlation of the estimates.
    """

    parameters: Mapping[str, Estimate]
    classic_errors: Mapping[str, float]
    rms: Mapping[str, float]
    simulations: int
    converged: bool
    correlation: Array


def fit_output_error(
    simulate: Simulator,
    unknowns: Sequence[Unknown],
    targets: Mapping[str, TargetSignal],
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
        Function of parameter values that returns signals.
    unknowns : sequence of Unknown
        Parameters to fit.
    targets : mapping of str to TargetSignal
        Measured signals, by the name of the simulated signal.
    mapper : callable, optional
        Map function for the simulations of one Jacobian; the `map` method of a pool runs them in parallel.
    tolerance : float
        Relative change of the cost, or of the parameters divided by their steps, at which the search ends.
    max_iterations : int
        Largest number of iterations; each needs at most ``1 + len(unknowns)`` simulations.
    correlation : int
        Largest lag at which residuals may be correlated, for the robust standard errors [samples].
    iterated : callable, optional
        Called with the number of simulations after each simulation.

    Returns
    -------
    OutputErrorFit
        Estimates with standard errors and correlation.

    Raises
    ------
    FitError
        If there are no unknowns or targets, a name occurs twice, a start value is outside its bounds, a step or scale
        is not positive, or a signal is missing, has the wrong shape or is not finite.
    ExcitationError
        If the targets do not depend on a parameter, or the effects of parameters are linearly dependent.

    Notes
    -----
    The search uses the trust-region method of `scipy.optimize.least_squares` on the parameters divided by their steps,
    with forward differences of one step. The covariance is (J'J)^-1 S (J'J)^-1, where S is the sum over lags of the
    products of scores J_k r_k, with weights that decrease linearly up to `correlation` (W. Newey, K. West, "A simple,
    positive semi-definite, heteroskedasticity and autocorrelation consistent covariance matrix", Econometrica 55,
    1987). The errors of a servo model are systematic and last for many samples; the classic formula s^2 (J'J)^-1 would
    count these samples as independent measurements.
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

    # residuals by point, so that the Jacobian does not repeat the simulation
    latest: dict[bytes, Array] = {}
    # latest Jacobian and its point
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
        # forward differences, backward at an upper bound
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


def _error(signals: Mapping[str, Array], name: str, target: TargetSignal) -> Array:
    if name not in signals:
        raise FitError(
            f"The simulation returned {', '.join(signals) or 'nothing'}, but not {name!r}; correct the target's name."
        )
    simulated = np.asarray(signals[name], dtype=np.float64)
    if simulated.shape != target.measured.shape:
        raise FitError(
            f"The simulation returned {name!r} with shape {simulated.shape}, but the measurement has shape "
            f"{target.measured.shape}; simulate at the samples of the record."
        )
    error: Array = (simulated - target.measured)[target.first :]
    if not np.all(np.isfinite(error)):
        raise FitError(
            f"The simulation of {name!r} is not finite from sample "
            f"{int(np.argmin(np.isfinite(error))) + target.first} on; reduce the communication step, or narrow the "
            "bounds of the parameters."
        )
    return error


def _require_excitation(J: Array, names: Sequence[str]) -> None:
    length = np.linalg.norm(J, axis=0)
    if np.any(length == 0.0):
        raise ExcitationError(
            f"The simulation does not depend on {names[int(np.argmin(length))]}; fix it, or record a motion that "
            "depends on it."
        )
    _, singular, right = np.linalg.svd(J / length, full_matrices=False)
    if mixed := dependent_columns(singular, right, names):
        raise ExcitationError(
            f"The measured signals do not allow {' and '.join(mixed)} to be separated; fix one of them, or record "
            "another motion."
        )


def _check(unknowns: Sequence[Unknown], targets: Mapping[str, TargetSignal]) -> None:
    if not unknowns or not targets:
        raise FitError("A fit needs at least one unknown and one target.")
    names = [unknown.name for unknown in unknowns]
    if len(set(names)) < len(names):
        raise FitError(f"The unknowns {', '.join(names)} contain a name twice; remove one.")
    for unknown in unknowns:
        if not (math.isfinite(unknown.step) and unknown.step > 0.0):
            raise FitError(f"The step of {unknown.name} is {unknown.step:g}; it must be positive and finite.")
        if not unknown.lower <= unknown.start <= unknown.upper:
            raise FitError(
                f"The start value {unknown.start:g} of {unknown.name} is outside its bounds {unknown.lower:g} .. "
                f"{unknown.upper:g}; change it or the bounds."
            )
    for name, target in targets.items():
        if not (math.isfinite(target.scale) and target.scale > 0.0):
            raise FitError(f"The scale of the target {name!r} is {target.scale:g}; it must be positive and finite.")
        if not 0 <= target.first < len(target.measured):
            raise FitError(
                f"The target {name!r} starts at sample {target.first}, but has only {len(target.measured)} samples; "
                "reduce first."
            )
