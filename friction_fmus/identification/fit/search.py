"""Search for the minimum: trust region from several start points, robust losses, covariance of the result."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
import scipy.optimize
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from friction_fmus.errors import FitError
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.estimate import coloured_covariance, correlation_length
from friction_fmus.identification.fit.least_squares import Problem

CANDIDATES = 12  # number of random candidates for each additional start point
SPREAD = 3.0  # largest factor between a coordinate of a random start point and of the first one

#: Largest factor between the value of a logarithmic coordinate and its start value: beyond it, a contact is as good as
#: rigid, and rounding errors decide.
FARTHEST = 1e6

#: Relative change of the cost at which a search ends, on a part of the samples and on all samples.
NEAR, CLOSE = 1e-4, 1e-7

INSIDE = 1e-9  # smallest distance of a start point from the bounds

#: Norm of a column of the Jacobian relative to the matrix, below which the residual does not depend on a coordinate.
UNSEEN = 1e-7

#: Relative increase of the cost for which an undetermined coordinate may be moved back towards its start value.
SAME = 1e-4

FAR = 1.0  # shortest way that an undetermined coordinate is moved: a factor of e, or the start value
HALVINGS = 8  # number of halvings of the way back
FLATTEST = 0.01  # smallest curvature of a robust loss in a direction, relative to the square: the loss is flat beyond

Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of a search."""

    x: Array  # coordinates
    residual: Array  # residual over the magnitude of the signal
    J: Array  # jacobian of the residual at x
    converged: bool  # whether the search converged before the iteration limit
    loss: str  # minimised loss
    scale: float  # residual above which a robust loss differs from the square

    @property
    def cost(self) -> float:
        """Mean square of the residual."""
        return float(np.mean(np.square(self.residual)))


def search(
    problem: Problem, loss: Loss, starts: int, tolerance: float = CLOSE, begin: Array | None = None
) -> SearchResult:
    """Minimise the residuals from the start point of the problem and from random points around it."""
    if loss not in get_args(Loss):
        raise FitError(f"There is no loss {loss!r}; use one of {', '.join(get_args(Loss))}.")
    if starts < 1:
        raise FitError(f"The number of starts is {starts}; use at least 1.")
    lower, upper = problem.bounds()
    first = np.clip(problem.start() if begin is None else begin, lower, upper)
    farthest = np.where([c.log for c in problem.coordinates], math.log(FARTHEST), np.inf)
    lower, upper = np.maximum(lower, first - farthest), np.minimum(upper, first + farthest)
    thin = problem.thinned()
    quick = thin or problem
    points = [first]
    random = np.random.default_rng(7)
    for _ in range(starts - 1):
        drawn = [_drawn(problem, first, lower, upper, random) for _ in range(CANDIDATES)]
        points.append(min(drawn, key=lambda x: _cost(quick.residual(x))))
    # the matrices are tall and narrow: threads in the linear algebra cost more than they save
    with threadpool_limits(1):
        if thin is not None:
            near = [_one(thin, point, lower, upper, loss, NEAR) for point in points]
            points = [f.x for f in sorted((f for f in near if f is not None), key=lambda f: f.cost)[:1]] or [first]
            problem.simulations += thin.simulations
        found = [_one(problem, point, lower, upper, loss, tolerance) for point in points]
    best = min((f for f in found if f is not None), key=lambda f: f.cost, default=None)
    if best is None:
        # repeat the simulation: the error of the block states why it rejects the start values
        problem.simulate(first, 0)
        raise FitError("The model cannot be simulated from any start point; give other start values.")
    return _moved_back(problem, best, first)


def unseen(J: Array) -> NDArray[np.bool_]:
    """Return the coordinates on which the residual does not depend, shape (p,)."""
    flat: NDArray[np.bool_] = np.linalg.norm(J, axis=0) <= UNSEEN * max(float(np.linalg.norm(J)), 1e-300)
    return flat


def _moved_back(problem: Problem, found: SearchResult, first: Array) -> SearchResult:
    """Return the solution with undetermined coordinates as near to their start values as the cost allows."""
    # A search goes on as long as the cost decreases, for example to a stiffness of 1e14 N/m for a rigid contact, where
    # other parameters have no effect and any value. The nearest value that fits as well is one that an axis can have.
    x, limit, flat = np.array(found.x), (1.0 + SAME) * found.cost, unseen(found.J)

    def fits(i: int, share: float) -> bool:
        moved = np.array(x)
        moved[i] += share * (first[i] - x[i])
        return _cost(problem.residual(moved)) <= limit

    for i, c in enumerate(problem.coordinates):
        way = abs(first[i] - x[i])
        shortest = 0.0 if flat[i] else FAR
        if way <= shortest or not (flat[i] or c.log):
            continue
        near, far = shortest / way, 1.0  # shares of the way
        if near > 0.0 and not fits(i, near):
            continue
        if fits(i, far):
            near = far
        for _ in range(HALVINGS if near < far else 0):
            middle = 0.5 * (near + far)
            near, far = (middle, far) if fits(i, middle) else (near, middle)
        x[i] += near * (first[i] - x[i])
    if np.array_equal(x, found.x):
        return found
    residual = problem.residual(x)
    return replace(found, x=x, residual=residual, J=problem.jacobian(x, residual))


def _drawn(problem: Problem, first: Array, lower: Array, upper: Array, random: np.random.Generator) -> Array:
    """Return a random point around the first one."""
    x = np.array(first)
    for i, c in enumerate(problem.coordinates):
        factor = math.log(SPREAD) * random.uniform(-1.0, 1.0)
        x[i] = x[i] + factor if c.log else x[i] * math.exp(factor) if c.lower >= 0.0 else x[i]
    return np.clip(x, lower, upper)


def _cost(residual: Array) -> float:
    cost = float(np.mean(np.square(residual)))
    return cost if math.isfinite(cost) else math.inf


def _one(
    problem: Problem, start: Array, lower: Array, upper: Array, loss: Loss, tolerance: float
) -> SearchResult | None:
    """Run one search; return None if the block rejects its start point."""
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
    return SearchResult(x, error, problem.jacobian(x, error), converged, loss, scale)


def covariance(found: SearchResult, lengths: Sequence[int]) -> tuple[Array, bool]:
    """Return the covariance of the coordinates, and whether it is the robust estimate."""
    # The covariance is s^2 (J'J)^-1 for white residuals and the loss "linear"; otherwise B^-1 S B^-1. For a robust loss
    # rho (P. Huber, "Robust estimation of a location parameter", Annals of Mathematical Statistics 35, 1964), the
    # scores are rho'(z) r J and B = J' (rho' + 2 z rho'') J with z = (r/scale)^2, in which single terms may be
    # negative. For S, see `coloured_covariance`. Directions that the residuals do not depend on have zero variance in
    # the result.
    J, residual = found.J, found.residual
    ends = np.cumsum(lengths)[:-1]
    lag = max(correlation_length(segment) for segment in np.split(residual, ends))
    weight, curvature = _weights(found.loss, (residual / found.scale) ** 2)
    # singular values of J, because small ones of J'J would be lost in rounding errors
    U, singular, right = np.linalg.svd(J, full_matrices=False)
    kept = singular > UNSEEN * singular[0]
    U, right = U[:, kept], right[kept].T / singular[kept]
    if lag == 0 and found.loss == "linear":
        return right @ right.T * float(residual @ residual) / max(1, len(residual) - J.shape[1]), False
    scale, axes = np.linalg.eigh(U.T @ (curvature[:, None] * U))
    inverse = (axes / np.maximum(scale, FLATTEST)) @ axes.T
    return coloured_covariance(right @ inverse, U, weight * residual, lengths, lag), True


def _weights(loss: str, z: Array) -> tuple[Array, Array]:
    """Return rho' and rho' + 2 z rho'' of a loss of `scipy.optimize.least_squares`."""
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
    return first, first + 2.0 * z * second
