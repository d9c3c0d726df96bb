"""Standard errors and correlations against the scatter of estimates from many simulated records."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.optimize
import scipy.signal
from thorough import nightly, some

from friction_fmus import identify
from friction_fmus.identification import Record
from friction_fmus.identification.fit.estimate import widening
from friction_fmus.identification.fit.idim import identify_inverse_model
from friction_fmus.identification.fit.search import SearchResult, covariance

TRUTH = {"M": 20.0, "Fv": 40.0, "Fc": 8.0, "OF": -1.5}
NINETY = 1.6449  # quantile of an interval of 90 %


def axis(rate: float, seconds: float, tau: float, random: np.random.Generator) -> Record:
    """Two sines, cut in mid-motion; the exact force in closed form with noise of the correlation time tau [s]."""
    n = round(rate * seconds)
    t = np.arange(n) / rate
    q, v, a = np.zeros((3, n))
    for frequency, size in ((random.uniform(0.9, 1.5), 0.04), (random.uniform(2.0, 3.5), 0.006)):
        w, begin = 2.0 * np.pi * frequency, random.uniform(0.0, 2.0 * np.pi)
        q += size * np.sin(w * t + begin)
        v += size * w * np.cos(w * t + begin)
        a -= size * w**2 * np.sin(w * t + begin)
    white = random.standard_normal(n + round(8.0 * tau * rate) + 1)
    pole = np.exp(-1.0 / (tau * rate)) if tau else 0.0
    noise = scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[-n:]
    force = TRUTH["M"] * a + TRUTH["Fv"] * v + TRUTH["Fc"] * np.sign(v) + TRUTH["OF"] + 0.5 * noise
    return Record("axis", t, q=q, force=force)


CASES = [(250.0, 3.0, 0.0), (250.0, 6.0, 0.03), (1000.0, 1.5, 0.01), (1000.0, 4.0, 0.05), (8000.0, 2.0, 0.01)]


def covered(count: int, found: Callable[[Record], dict[str, tuple[float, float]]]) -> dict[str, float]:
    """Return how often intervals of 90 % contain the truth, over all cases."""
    hits: dict[str, list[bool]] = {name: [] for name in TRUTH}
    random = np.random.default_rng(11)
    for case in CASES:
        for _ in range(count):
            for name, (value, error) in found(axis(*case, random)).items():
                hits[name].append(abs(value - TRUTH[name]) < NINETY * error)
    return {name: float(np.mean(each)) for name, each in hits.items()}


def regression(record: Record) -> dict[str, tuple[float, float]]:
    return {name: (e.value, e.standard_error) for name, e in identify_inverse_model(record).parameters.items()}


def block(record: Record) -> dict[str, tuple[float, float]]:
    """Noise alone: the model is right, and there is no delay for which the total error allows."""
    found = identify("Coulomb", record, viscous=True, starts=1).parameters
    return {name: (found[name].value, found[name].noise_error) for name in TRUTH}


@nightly
def test_intervals_of_the_regression_cover_the_truth_as_often_as_they_say() -> None:
    """Of 150 records; the standard deviation of each share is 2.4 %."""
    shares = covered(30, regression)
    assert all(0.83 <= share <= 0.97 for share in shares.values()), shares
    assert 0.85 <= np.mean(list(shares.values())) <= 0.95


@nightly
@pytest.mark.parametrize(("found", "count"), [(regression, 200), (block, 60)])
def test_intervals_of_many_records_cover_the_truth(
    found: Callable[[Record], dict[str, tuple[float, float]]], count: int
) -> None:
    shares = covered(count, found)
    assert all(0.85 <= share <= 0.95 for share in shares.values()), shares


@pytest.mark.parametrize("loss", some(["soft_l1", "huber", "cauchy", "arctan"], ["huber"]))
def test_standard_errors_of_a_robust_loss_are_the_scatter_of_its_estimates(loss: str) -> None:
    random = np.random.default_rng(4)
    n, scale = 300, 1.1  # as in a search: 1.48 times the median of the absolute residuals
    J = np.column_stack([np.ones(n), np.sin(np.arange(n) / 7.0)])
    estimates, errors = [], []
    for _ in range(100):
        noise = random.standard_normal(n) * np.where(random.random(n) < 0.1, 8.0, 1.0)
        fit = scipy.optimize.least_squares(lambda x, e=noise: J @ x - e, [0.0, 0.0], loss=loss, f_scale=scale)
        spread, _ = covariance(SearchResult(fit.x, J @ fit.x - noise, J, True, loss, scale), [n])
        estimates.append(fit.x)
        errors.append(np.sqrt(np.diag(spread)))
    ratio = np.median(errors, axis=0) / np.std(estimates, axis=0)
    assert np.all((ratio > 0.85) & (ratio < 1.25)), ratio


@pytest.mark.parametrize("samples", [40, 59, 200, 1000])
def test_coloured_residuals_of_few_samples_do_not_count_as_white(samples: int) -> None:
    """A mean of correlated noise: its scatter is known in closed form."""
    random, pole = np.random.default_rng(6), 0.8
    J = np.ones((samples, 1))
    lags = np.arange(1, samples)
    truth = np.sqrt((1.0 + 2.0 * np.sum((1.0 - lags / samples) * pole**lags)) / samples)
    errors = []
    for _ in range(60):
        noise = scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], random.standard_normal(samples + 60))[60:]
        spread, _ = covariance(SearchResult(np.zeros(1), noise - noise.mean(), J, True, "linear", 1.0), [samples])
        errors.append(np.sqrt(spread[0, 0]))
    assert 0.8 * truth < np.median(errors) < 1.35 * truth


def test_collinear_parameters_are_correlated_and_named() -> None:
    """At nearly one speed, only Fc + Fv |v| is known; a misfit adds to errors, but does not separate them."""
    random = np.random.default_rng(2)
    speed = 0.1 * (1.0 + 1e-3 * random.standard_normal(2000))
    v = np.where(np.arange(2000) % 500 < 250, speed, -speed)
    friction = 8.0 * np.sign(v) + 40.0 * v + 0.05 * random.standard_normal(2000) + 0.3 * np.roll(v, 3)
    found = identify("Stribeck", Record("one speed", 1e-3 * np.arange(2000.0), v=v, friction=friction), starts=1)
    names = [*found.parameters, *found.initial]
    assert found.correlation[names.index("Fc"), names.index("Fv")] < -0.99
    assert {"Fc", "Fv"} <= set(found.weak)


@nightly
@pytest.mark.parametrize("part", [0.05, 0.2, 0.5, 1.0])
def test_the_widening_is_the_limit_distribution_of_the_statistic(part: float) -> None:
    """The 90 % quantile of W(1) / sqrt(Q), with Q the Newey-West estimate of a Brownian bridge, by simulation."""
    random, n, statistics = np.random.default_rng(1), 1000, []
    for _ in range(20):
        steps = random.standard_normal((2000, n))
        bridge = np.cumsum(steps - steps.mean(axis=1, keepdims=True), axis=1) / np.sqrt(n)
        lag = round(part * n)
        Q = 2.0 / part * (np.mean(bridge**2, axis=1) - np.sum(bridge[:, lag:] * bridge[:, : n - lag], axis=1) / n)
        statistics.append(np.abs(steps.sum(axis=1)) / np.sqrt(n * Q))
    assert widening(part) * NINETY == pytest.approx(np.quantile(np.concatenate(statistics), 0.9), rel=0.03)
