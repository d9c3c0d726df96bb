"""The search: trust region from several starts, robust loss, covariance of what was found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import scipy.optimize
import scipy.stats
from threadpoolctl import threadpool_limits

from friction_fmus.identification.data.record import Array
from friction_fmus.identification.errors import FitError
from friction_fmus.identification.fit.output_error import score_covariance
from friction_fmus.identification.fit.problem import Problem

#: Random points that are looked at for each start of the search after the first one.
CANDIDATES = 12

#: Largest factor by which a random start is off the first one, and largest change of what is linear, in its size.
SPREAD = 3.0

#: Relative change of the cost at which a search on a part of the samples ends, and on all of them.
NEAR, CLOSE = 1e-4, 1e-7

#: Distance from a bound at which a search begins at least.
INSIDE = 1e-9

#: Probability below which residuals are taken for correlated.
WHITE = 1e-3

Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]


@dataclass(frozen=True, eq=False)
class Found:
    """The end of a search.

    Attributes
    ----------
    x : array, shape (p,)
        Coordinates.
    residual : array, shape (n,)
        In parts of the size of the signal.
    J : array, shape (n, p)
        Jacobian there.
    converged : bool
        Whether it ended by its tolerances.
    loss : str
        The loss that was minimised.
    scale : float
        Error from which on it is not the square.
    """

    x: Array
    residual: Array
    J: Array
    converged: bool
    loss: str
    scale: float

    @property
    def cost(self) -> float:
        """Mean square of the residual."""
        return float(np.mean(np.square(self.residual)))


def search(problem: Problem, loss: Loss, starts: int) -> Found:
    """Least squares from the start of the problem and from others around it.

    Parameters
    ----------
    problem : Problem
        Residuals and coordinates.
    loss : str
        One of `Loss`; all but "linear" scale by 1.48 times the median of the absolute residuals.
    starts : int
        How many searches; the second and later ones begin at the best of random points. Long records are searched on a
        part of their samples first, and on all of them from the best end only.

    Raises
    ------
    FitError
        The loss is unknown, or the block refuses the start values.
    """
    if loss not in get_args(Loss):
        raise FitError(f"There is no loss {loss!r}; choose one of {', '.join(get_args(Loss))}.")
    if starts < 1:
        raise FitError(f"There are to be {starts} starts; give at least 1.")
    lower, upper = problem.bounds()
    first = np.clip(problem.start(), lower, upper)
    thin = problem.thinned()
    quick = thin or problem
    points = [first]
    random = np.random.default_rng(7)
    for _ in range(starts - 1):
        drawn = [_drawn(problem, first, lower, upper, random) for _ in range(CANDIDATES)]
        points.append(min(drawn, key=lambda x: _cost(quick.residual(x))))
    # the matrices are tall and narrow: threads of the linear algebra cost more than they save
    with threadpool_limits(1):
        if thin is not None:
            near = [_one(thin, point, lower, upper, loss, NEAR) for point in points]
            points = [f.x for f in sorted((f for f in near if f is not None), key=lambda f: f.cost)[:1]] or [first]
            problem.simulations += thin.simulations
        found = [_one(problem, point, lower, upper, loss, CLOSE) for point in points]
    best = min((f for f in found if f is not None), key=lambda f: f.cost, default=None)
    if best is None:
        # what the block says of its start values is the reason
        problem.simulate(first, 0)
        raise FitError("The model cannot be simulated from any start; give others.")
    return best


def _drawn(problem: Problem, first: Array, lower: Array, upper: Array, random: np.random.Generator) -> Array:
    """A random point around the first one."""
    x = np.array(first)
    for i, c in enumerate(problem.coordinates):
        factor = math.log(SPREAD) * random.uniform(-1.0, 1.0)
        x[i] = x[i] + factor if c.log else x[i] * math.exp(factor) if c.lower >= 0.0 else x[i]
    return np.clip(x, lower, upper)


def _cost(residual: Array) -> float:
    cost = float(np.mean(np.square(residual)))
    return cost if math.isfinite(cost) else math.inf


def _one(problem: Problem, start: Array, lower: Array, upper: Array, loss: Loss, tolerance: float) -> Found | None:
    """One search; None where the block refuses its start."""
    latest: dict[bytes, Array] = {}

    def residual(x: Array) -> Array:
        latest.clear()
        found = latest[x.tobytes()] = problem.residual(x)
        return found

    def jacobian(x: Array) -> Array:
        return problem.jacobian(x, latest.get(x.tobytes()))

    x = np.clip(start, lower + INSIDE, upper - INSIDE)
    error = residual(x)
    if not np.all(np.isfinite(error)):
        return None
    scale, converged = 1.0, False
    for _ in range(1 if loss == "linear" else 3):
        if loss != "linear":
            scale = max(1.4826 * float(np.median(np.abs(error))), 1e-9)
        result = scipy.optimize.least_squares(
            residual,
            np.clip(x, lower + INSIDE, upper - INSIDE),
            jac=jacobian,
            bounds=(lower, upper),
            loss=loss,
            f_scale=scale,
            ftol=tolerance,
            xtol=10.0 * tolerance,
            gtol=1e-12,
            max_nfev=80,
        )
        x, converged = np.asarray(result.x, dtype=np.float64), bool(result.status > 0)
        error = problem.residual(x)
    return Found(x, error, problem.jacobian(x, error), converged, loss, scale)


def correlation_length(residual: Array) -> int:
    """Lag in samples up to which residuals are correlated; 0 where nothing speaks against white noise.

    Notes
    -----
    White by the test of G. Ljung, G. Box, "On a measure of lack of fit in time series models", Biometrika 65, 1978,
    over 20 lags at the level `WHITE`; otherwise twice the first lag with a correlation within 2/sqrt(n) of zero.
    """
    n = len(residual)
    centred = residual - np.mean(residual)
    power = float(centred @ centred)
    if n < 60 or power == 0.0:
        return 0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    rho = np.fft.irfft(spectrum, size)[:n] / power
    lags = np.arange(1, 21)
    statistic = n * (n + 2) * float(np.sum(rho[1:21] ** 2 / (n - lags)))
    if scipy.stats.chi2.sf(statistic, 20) > WHITE:
        return 0
    small = np.flatnonzero(np.abs(rho[1:]) < 2.0 / math.sqrt(n))
    first = int(small[0]) + 1 if small.size else n // 4
    return min(max(2 * first, 1), n // 4)


def covariance(found: Found, lengths: Sequence[int]) -> tuple[Array, bool]:
    """Covariance of the coordinates, and whether it is the robust one.

    Notes
    -----
    s^2 (J'J)^-1 for white residuals and the loss "linear"; otherwise B^-1 S B^-1, with the S of Newey and West as in
    `fit_output_error`, and for a robust loss rho of P. Huber, "Robust estimation of a location parameter", Annals of
    Mathematical Statistics 35, 1964: the scores are rho'(z) r J and B = J' (rho' + 2 z rho'') J with z = (r/scale)^2.
    Directions that the residuals do not depend on get no variance from here.
    """
    J, residual = found.J, found.residual
    ends = np.cumsum(lengths)[:-1]
    lag = max(correlation_length(piece) for piece in np.split(residual, ends))
    weight, curvature = _weights(found.loss, (residual / found.scale) ** 2)
    # by the singular values of J: those of J'J would be cut off among its rounding errors
    _, singular, right = np.linalg.svd(J * np.sqrt(curvature)[:, None], full_matrices=False)
    right, singular = right[singular > 1e-7 * singular[0]], singular[singular > 1e-7 * singular[0]]
    inverse = (right.T / singular**2) @ right
    if lag == 0 and found.loss == "linear":
        return inverse * float(residual @ residual) / max(1, len(residual) - J.shape[1]), False
    total = np.zeros((J.shape[1], J.shape[1]))
    for rows, errors in zip(np.split(J, ends), np.split(weight * residual, ends), strict=True):
        total += score_covariance(rows, errors, [len(errors)], lag)
    return inverse @ total @ inverse, True


def _weights(loss: str, z: Array) -> tuple[Array, Array]:
    """rho' and rho' + 2 z rho'' of the losses of `scipy.optimize.least_squares`, the latter not negative."""
    if loss == "linear":
        first, second = np.ones_like(z), np.zeros_like(z)
    elif loss == "soft_l1":
        first, second = (1.0 + z) ** -0.5, -0.5 * (1.0 + z) ** -1.5
    elif loss == "huber":
        beyond = np.maximum(z, 1.0)
        first, second = beyond**-0.5, np.where(z <= 1.0, 0.0, -0.5 * beyond**-1.5)
    elif loss == "cauchy":
        first, second = 1.0 / (1.0 + z), -((1.0 + z) ** -2)
    else:
        first, second = 1.0 / (1.0 + z**2), -2.0 * z / (1.0 + z**2) ** 2
    return first, np.maximum(first + 2.0 * z * second, 0.0)
