"""Output-error identification: least squares of simulated against measured signals.

The simulator is a callable that returns signals for parameter values, such as a co-simulated servo or a closed form.
The fit minimises the sum over the targets of |simulated - measured|^2 / scale^2.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from friction_fmus.errors import ExcitationError, FitError
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.estimate import Estimate, Estimated, dependent_columns, score_covariance

#: Function of parameter values that returns simulated signals, each with the shape of its target.
Simulator = Callable[[Mapping[str, float]], Mapping[str, Array]]


@dataclass(frozen=True)
class Unknown:
    """Parameter to fit."""

    name: str  # name that the simulator receives
    start: float  # start value, in `unit`
    step: float
    """Step of the finite differences, in `unit`; it also scales the search. The effect of the step must exceed
    quantisation and event errors of the simulation: use 0.5 to 5 % of the value, not the square root of the machine
    precision."""
    unit: str  # unit of the parameter
    lower: float = -math.inf
    upper: float = math.inf
    """Bounds, in `unit`."""


@dataclass(frozen=True, eq=False)
class TargetSignal:
    """Measured signal to be reproduced by the simulation."""

    measured: Array  # measured samples, shape (n,)
    scale: float  # error that counts as one, in the unit of the signal; determines the relative weight of the targets
    first: int = 0  # first sample used in the fit


@dataclass(frozen=True, eq=False)
class OutputErrorFit(Estimated):
    """Result of an output-error fit."""

    parameters: Mapping[str, Estimate]  # estimates with robust standard errors
    classic_errors: Mapping[str, float]
    """Standard errors for uncorrelated residuals; too small if the residuals of neighbouring samples are correlated."""
    rms: Mapping[str, float]  # root mean square error of each target, in its unit
    simulations: int  # number of simulations
    converged: bool  # whether the search converged before `max_iterations`
    correlation: Array  # correlation of the estimates, shape (p, p)


def fit_output_error(
    simulate: Simulator,
    unknowns: Sequence[Unknown],
    targets: Mapping[str, TargetSignal],
    *,
    tolerance: float = 1e-3,
    max_iterations: int = 6,
    correlation: int = 200,
) -> OutputErrorFit:
    """Fit the parameters of a simulation to measured signals."""
    # The trust-region method of `scipy.optimize.least_squares` on the parameters divided by their steps, with forward
    # differences of one step; it ends when the cost or a parameter over its step changes by less than `tolerance`. The
    # covariance is that of Newey and West, Econometrica 55, 1987, for residuals that are correlated over `correlation`
    # samples: the errors of a servo model are systematic, and s^2 (J'J)^-1 would count them as independent.
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
        return np.concatenate([_error(signals, name, targets[name]) * weight[name] for name in targets])

    # residuals by point, so that the Jacobian does not repeat the simulation
    latest: dict[bytes, Array] = {}
    # latest Jacobian, and the value of each unknown for its column
    J, at = np.empty((0, len(start))), np.full(len(start), np.inf)

    def residual(x: Array) -> Array:
        found = stacked(simulate(named(x)))
        latest[x.tobytes()] = found
        return found

    def jacobian(x: Array) -> Array:
        nonlocal J
        # a column hardly depends on the other unknowns
        stale = np.flatnonzero(np.abs(x - at) >= 1.0)
        if not len(stale):
            return J
        centre = latest.get(x.tobytes())
        centre = residual(x) if centre is None else centre
        J = J.copy() if len(J) else np.empty((len(centre), len(x)))
        for i in stale:
            direction = 1.0 if x[i] + 1.0 <= upper[i] else -1.0  # forward differences, backward at an upper bound
            J[:, i] = (stacked(simulate(named(x + direction * np.eye(len(x))[i]))) - centre) / direction
            at[i] = x[i]
        return J

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
