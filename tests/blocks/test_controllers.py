"""Controllers in C, each against mathematics that is written down here a second time, another way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from fmi.instance import Instance, load

BuildFmu = Callable[..., Path]
Run = Callable[..., np.ndarray]


@pytest.fixture
def samples(build_fmu: BuildFmu) -> Iterator[Run]:
    """``samples(model, inputs, outputs, **start)``: the outputs at every sample, shape (samples, outputs)."""

    def run(model: str, inputs: Mapping[str, np.ndarray], outputs: tuple[str, ...], **start: float) -> np.ndarray:
        rows = []
        with Instance(load(build_fmu(model))) as block:
            block.initialise(**start)
            Ts = block.get1("Ts")
            for k, values in enumerate(zip(*inputs.values(), strict=True)):
                block.set(dict(zip(inputs, values, strict=True)))
                block.step(k * Ts, Ts)
                rows.append(block.get(*outputs))
        return np.array(rows)

    return run


# ---- LocalFunctionEstimator ----------------------------------------------------------------------------------------


def by_least_squares(F: np.ndarray, n: int, degree: int) -> float:
    """The polynomial with the interval means nearest to F (oldest first), at the end; time unit: one interval."""
    ends = np.arange(-n + 1, 1)
    p = np.arange(degree + 1)
    means = (ends[:, None] ** (p + 1.0) - (ends[:, None] - 1.0) ** (p + 1.0)) / (p + 1.0)
    return float(np.linalg.lstsq(means, F, rcond=None)[0][0])


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("window", [1, 2, 3, 7, 64])
def test_local_function_is_least_squares(samples, window, degree):
    m, Ts, n = 2.5, 1e-3, 150
    v, u = np.random.default_rng(1).normal(size=(2, n)) * [[1e-2], [5.0]]
    parameters = {"m": m, "window": window, "degree": degree, "u_min": -1e9, "u_max": 1e9, "gain": 0.5, "v0": 0.004}
    found = samples("LocalFunctionEstimator", {"v": v, "u_prev": u}, ("F_hat", "u", "u_sat"), **parameters)
    F = np.concatenate([np.zeros(64), u - m * np.diff(v, prepend=0.004) / Ts])
    expected = [by_least_squares(F[k + 65 - window : k + 65], window, min(degree, window - 1)) for k in range(n)]
    assert np.abs(found[:, 0] - expected).max() < 1e-10 * np.abs(expected).max()
    assert np.array_equal(found[:, 1], 0.5 * found[:, 0])
    assert not found[:, 2].any()


@pytest.mark.parametrize(("degree", "lag"), [(0, 8 * 1e-3 / 2.0), (1, 0.0), (2, 0.0)])
def test_local_function_on_a_ramp(samples, degree, lag):
    m, Ts, c, n = 2.0, 1e-3, 20.0, 100
    t = Ts * np.arange(n)
    inputs = {"v": (3.0 * t - c * t**2 / 2.0) / m, "u_prev": np.full(n, 3.0)}
    found = samples("LocalFunctionEstimator", inputs, ("F_hat",), m=m, window=8, degree=degree)
    assert found[8:, 0] == pytest.approx(c * (t[8:] - lag), abs=1e-9)


def test_local_parabola_is_exact_on_a_parabola(samples):
    t = 1e-3 * np.arange(100)
    inputs = {"v": (3.0 * t - 400.0 * t**3 / 3.0) / 2.0, "u_prev": np.full(100, 3.0)}
    found = samples("LocalFunctionEstimator", inputs, ("F_hat",), m=2.0, window=8, degree=2)
    assert found[8:, 0] == pytest.approx(400.0 * t[8:] ** 2, abs=1e-9)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_noise_of_the_local_function(samples, degree):
    """The sum of the squared weights; an impulse of force shows them one after the other."""
    n = 12
    u = np.zeros(40)
    u[5] = 1.0
    found = samples("LocalFunctionEstimator", {"v": 0.0 * u, "u_prev": u}, ("F_hat",), window=n, degree=degree)[:, 0]
    expected = [1.0 / n, 3.0 * n / (n**2 - 1.0), 5.0 * n**3 / ((n**2 - 1.0) * (n**2 - 4.0))]
    assert (found**2).sum() == pytest.approx(sum(expected[: degree + 1]), rel=1e-12)
    assert found.sum() == pytest.approx(1.0, rel=1e-12)


def test_local_function_limits_reset_and_disable(samples):
    n = 40
    u = np.full(n, 3.0)
    on, reset = np.ones(n), np.zeros(n)
    on[20:25], reset[10] = 0.0, 1.0
    inputs = {"v": 0.0 * u, "u_prev": u, "enable": on, "reset": reset}
    found = samples("LocalFunctionEstimator", inputs, ("F_hat", "u", "u_sat"), window=3, degree=0, u_max=2.5)
    for begin in (0, 11, 25):
        assert found[begin : begin + 4, 0] == pytest.approx([1.0, 2.0, 3.0, 3.0])
    assert not found[[10, *range(20, 25)]].any()
    assert np.array_equal(found[:, 1], np.minimum(found[:, 0], 2.5))
    assert np.array_equal(found[:, 2], (found[:, 0] > 2.5).astype(float))
