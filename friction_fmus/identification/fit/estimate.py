"""Estimated parameters: values and standard errors, covariance from coloured residuals, dependent columns."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.signal
import scipy.stats

from friction_fmus.identification.data.record import Array

WHITE = 0.01  # probability (p value) below which residuals count as correlated
TESTABLE = 200  # fewest residuals that are tested for correlation
HIGHEST, EACH = 10, 10  # highest order of the autoregressive model, and smallest number of residuals for each order

#: Corrections of the autocovariances, and the number of residuals above which none is needed.
CORRECTIONS, MANY = 4, 2000

STATIONARY = 0.98  # largest partial correlation: a model beyond is a drift


def autocovariance(values: Array) -> Array:
    """Return the sums of the products of values at all distances, shape (n,)."""
    n = len(values)
    size = 1 << (2 * n - 1).bit_length()
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2, size)[:n], dtype=np.float64)


def correlation_length(residual: Array) -> int:
    """Return the lag in samples up to which residuals are correlated; 0 for white noise."""
    # Whiteness is tested with G. Ljung, G. Box, "On a measure of lack of fit in time series models", Biometrika 65,
    # 1978, over 20 lags at the level `WHITE`; fewer than `TESTABLE` residuals do not count as white. For correlated
    # residuals, the result is twice the first lag with a correlation within 2/sqrt(n) of zero.
    n = len(residual)
    centred = residual - np.mean(residual)
    power = float(centred @ centred)
    if n < 3 or power == 0.0:
        return 0
    rho = autocovariance(centred) / power
    if n >= TESTABLE:
        lags = np.arange(1, 21)
        statistic = n * (n + 2) * float(np.sum(rho[1:21] ** 2 / (n - lags)))
        if scipy.stats.chi2.sf(statistic, 20) > WHITE:
            return 0
    small = np.flatnonzero(np.abs(rho[1:]) < 2.0 / math.sqrt(n))
    first = int(small[0]) + 1 if small.size else n // 4
    return min(max(2 * first, 1), max(n // 4, 1))


def widening(part: float) -> float:
    """Return the factor of intervals of 90 % whose Newey-West estimate uses lags up to this part of the record."""
    # It follows from the distribution of the statistic for a fixed part (N. Kiefer, T. Vogelsang, "A new asymptotic
    # theory for heteroskedasticity-autocorrelation robust tests", Econometric Theory 21, 2005).
    return 1.0 + (2.1859 * part + 0.3142 * part**2 - 0.3427 * part**3) / 1.6449


def score_covariance(J: Array, r: Array, lengths: Sequence[int], correlation: int) -> Array:
    """Return the Newey-West estimate of the covariance of J' r; targets of equal length are added sample by sample."""
    # It is too small unless a record is much longer than `correlation`, and therefore enlarged by `widening`.
    products = np.split(J * r[:, None], np.cumsum(lengths)[:-1])
    if len(set(lengths)) == 1:
        products = [np.sum(products, axis=0)]
    total = np.zeros((J.shape[1], J.shape[1]))
    for score in products:
        lags = min(correlation, len(score) - 1)
        one = score.T @ score
        for lag in range(1, lags + 1):
            gamma = score[lag:].T @ score[:-lag]
            one += (1.0 - lag / (lags + 1.0)) * (gamma + gamma.T)
        part = (lags + 1.0) / len(score) if lags else 0.0
        total += one * widening(part) ** 2 * len(score) / max(len(score) - J.shape[1], 1)
    return total


def coloured_covariance(back: Array, U: Array, residual: Array, lengths: Sequence[int], lag: int) -> Array:
    """Return the covariance of estimates from the scores U' r."""
    # The estimate from an autoregressive model is enlarged where that of Newey and West is larger, as for residuals
    # whose variance changes along the record.
    ends = np.cumsum(lengths)[:-1]
    total = np.zeros((U.shape[1], U.shape[1]))
    for rows, errors in zip(np.split(U, ends), np.split(residual, ends), strict=True):
        total += score_covariance(rows, errors, [len(errors)], lag)
    newey_west, model = back @ total @ back.T, back @ _of_model(U, residual) @ back.T
    with np.errstate(divide="ignore", invalid="ignore"):
        larger = np.sqrt(np.fmax(np.diag(newey_west) / np.diag(model), 1.0))
    larger[~np.isfinite(larger)] = 1.0
    return np.asarray(model * np.outer(larger, larger))


def _of_model(U: Array, residual: Array) -> Array:
    """Return the covariance U' S U of the scores, where the residuals have the covariance S."""
    # S is that of an autoregressive model, whose order has the smallest AIC. What a regression takes out of the
    # residuals makes them seem less correlated; the autocovariances are corrected by the difference between S and M S
    # M, the expectation of the model with M = 1 - U U'. The result is enlarged by the square of the ratio of the
    # quantiles of 90 % of Student's t distribution, with the degrees of freedom of the independent residuals, and of
    # the normal one.
    n, p = U.shape
    order = min(HIGHEST, n // EACH)
    sums = autocovariance(residual)[: order + 1]
    if n <= p + 1 or sums[0] <= 0.0:
        return np.zeros((p, p))
    given = sums / n
    for left in range(CORRECTIONS if n < MANY else 0, -1, -1):
        g = _model(given, n)
        circular = np.concatenate([g, [0.0], g[:0:-1]])
        SU = np.fft.irfft(np.fft.rfft(circular)[:, None] * np.fft.rfft(U, 2 * n, axis=0), 2 * n, axis=0)[:n]
        scores = U.T @ SU
        if not left:
            break
        taken = [
            np.sum(U[: n - k] * SU[k:]) + np.sum(SU[: n - k] * U[k:]) - np.sum((U[: n - k] @ scores) * U[k:])
            for k in range(order + 1)
        ]
        corrected = (sums + np.arange(order + 1) * g[: order + 1] + taken) / n
        if np.any(np.abs(corrected[1:]) >= corrected[0]):
            break
        given = corrected
    variance = float(residual @ residual) / max(n * g[0] - float(np.trace(scores)), 1e-3 * n * g[0])
    independent = n / max(1.0 + 2.0 * float(np.sum(g[1:])) / g[0], 1.0)
    wider = scipy.stats.t.ppf(0.95, max(independent - p, 1.0)) / scipy.stats.norm.ppf(0.95)
    return np.asarray(scores * variance * wider**2)


def _model(g: Array, n: int) -> Array:
    """Return n autocovariances of the autoregressive model of the first ones, by the recursion of Levinson."""
    a, variance = np.zeros(0), float(g[0])
    best = n * math.log(variance), a, variance
    for k in range(1, len(g)):
        partial = float(np.clip((g[k] - a @ g[k - 1 : 0 : -1]) / variance, -STATIONARY, STATIONARY))
        a = np.append(a - partial * a[::-1], partial)
        variance *= 1.0 - partial**2
        best = min(best, (n * math.log(variance) + 2.0 * k, a, variance), key=lambda each: each[0])
    _, a, variance = best
    response = scipy.signal.lfilter([1.0], np.concatenate([[1.0], -a]), np.eye(1, 4 * n)[0])
    return autocovariance(response)[:n] * variance


#: Ratio of the smallest to the largest singular value, of normalised columns, below which they count as dependent. The
#: limit is far above the errors of rounding (1e-15) and difference quotients (1e-9), and far below useful excitation.
RANK_TOLERANCE = 1e-6


def dependent_columns(singular: Array, right: Array, names: Sequence[str]) -> list[str]:
    """Return the names of linearly dependent columns; empty if all columns are independent."""
    # With two dependences, the singular vectors are an arbitrary basis of the null space, determined by rounding. The
    # test therefore uses the length of the projection of each unit vector onto the null space, which does not depend on
    # the basis.
    dependent = right[singular < RANK_TOLERANCE * singular[0]]
    parts = np.linalg.norm(dependent, axis=0)
    return [name for name, part in zip(names, parts, strict=True) if part > 0.1]


@dataclass(frozen=True)
class Estimate:
    """Estimated parameter.

    Attributes
    ----------
    name : str
        Name of the parameter.
    value : float
        Estimate, in `unit`.
    standard_error : float
        Standard error, in `unit`; NaN if it is not available.
    unit : str
        Unit of value and standard error.
    noise_error : float or None
        Part of the standard error that is due to noise, without the bias by delays and filters of the measurement; None
        if the parts are not known.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    noise_error: float | None = None

    @property
    def relative_error(self) -> float:
        """Standard error divided by the magnitude of the value."""
        return self.standard_error / abs(self.value) if self.value else float("inf")


class Estimated:
    """What has estimated parameters."""

    parameters: Mapping[str, Estimate]

    def values(self) -> dict[str, float]:
        """Return the parameter values without standard errors, in the units of the estimates."""
        return {name: estimate.value for name, estimate in self.parameters.items()}
