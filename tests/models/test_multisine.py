"""Multisine against its Fourier transform, Schroeder's closed form, and a bounded search for its peak."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from shell.instance import Instance, Library, load

SHAPES = {
    "one line": {"lines": 1, "first": 3},
    "Schroeder": {"lines": 20},
    "Schroeder, many": {"lines": 256, "first": 2},
    "odd lines": {"lines": 15, "first": 1, "spacing": 2},
    "flat velocity": {"lines": 30, "first": 2, "spacing": 3, "tilt": 1.0},
    "flat acceleration": {"lines": 12, "tilt": 2.0},
    "rising": {"lines": 12, "tilt": -1.5, "seed": 4},
    "random": {"lines": 40, "first": 5, "seed": 1},
}


@pytest.fixture(scope="module")
def multisine(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Multisine"))


def period(run: Instance, n: int, f0: float) -> np.ndarray:
    """r, rd, rdd at n times of a period, from t = 0."""
    rows = [run.get("r", "rd", "rdd")]
    for i in range(n - 1):
        run.step(i / n / f0, 1.0 / n / f0)
        rows.append(run.get("r", "rd", "rdd"))
    return np.array(rows).T


def harmonics(shape: dict[str, float]) -> np.ndarray:
    return shape.get("first", 1) + shape.get("spacing", 1) * np.arange(shape["lines"])


def continuous(lines: np.ndarray, coefficients: np.ndarray, u: float) -> float:
    """The sum of Re(c exp(2 pi i h u))."""
    return float((coefficients @ np.exp(2j * np.pi * lines * u)).real)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_power_is_where_it_is_wanted_and_the_peak_is_met(multisine: Library, shape: dict[str, float]) -> None:
    f0, peak, offset, lines = 0.25, 0.02, 0.1, harmonics(shape)
    n = 4 * int(lines[-1])
    with Instance(multisine) as run:
        run.initialise(f0=f0, peak=peak, offset=offset, **shape)
        crest = run.get1("crest")
        r, rd, rdd = period(run, n, f0)
    spectrum = np.fft.rfft(r - offset) * 2.0 / n
    found = spectrum[lines]
    assert np.abs(np.delete(spectrum, lines)).max(initial=0.0) < 1e-13 * peak * math.sqrt(n)
    tilt = shape.get("tilt", 0.0)
    np.testing.assert_allclose(np.abs(found) / np.abs(found[0]), (lines / lines[0]) ** -tilt, rtol=1e-9)

    # derivatives: each line turned by i w
    w = 2.0 * np.pi * f0 * lines
    for order, signal in ((1, rd), (2, rdd)):
        turned = np.fft.rfft(signal)[lines] * 2.0 / n
        scale = float(np.abs(w**order * found).max())
        np.testing.assert_allclose(turned, (1j * w) ** order * found, rtol=0, atol=1e-11 * scale)

    # the largest of |r|, by a bounded search around the largest of a fine grid of the trigonometric polynomial
    grid = np.fft.irfft(np.concatenate([np.fft.rfft(r - offset) * 16, np.zeros(15 * n // 2)]), 16 * n)
    best = 0.0
    for i in np.flatnonzero(np.abs(grid) > 0.99 * np.abs(grid).max()):
        top = minimize_scalar(
            lambda u: -abs(continuous(lines, found, u)),
            bounds=((i - 1) / (16 * n), (i + 1) / (16 * n)),
            method="bounded",
            options={"xatol": 1e-9 / n},
        )
        best = max(best, -top.fun)
    assert best == pytest.approx(peak, rel=1e-10)
    rms = math.sqrt(float(np.sum(np.abs(found) ** 2)) / 2.0)
    assert crest == pytest.approx(peak / rms, rel=1e-10)


def test_phases_are_schroeders(multisine: Library) -> None:
    """Equal amplitudes: phi_k = -pi k (k - 1) / N; any others: -2 pi sum_(l<k) (k - l) p_l."""
    for shape in ({"lines": 20}, {"lines": 20, "tilt": 1.0}):
        lines = harmonics(shape)
        N, k = 20, np.arange(1, 21)
        power = lines ** (-2.0 * shape.get("tilt", 0.0))
        power /= power.sum()
        phi = [-2.0 * np.pi * sum((j - i) * power[i - 1] for i in range(1, j)) for j in k]
        if "tilt" not in shape:
            np.testing.assert_allclose(phi, -np.pi * k * (k - 1) / N, atol=1e-12)
        with Instance(multisine) as run:
            run.initialise(f0=1.0, **shape)
            found = np.fft.rfft(period(run, 128, 1.0)[0])[lines] * 2.0 / 128
        np.testing.assert_allclose(found / np.abs(found), np.exp(1j * np.array(phi)), rtol=0, atol=1e-10)


def test_schroeder_phases_keep_the_crest_low_and_random_ones_do_not(multisine: Library) -> None:
    def crest(**shape: float) -> float:
        with Instance(multisine) as run:
            run.initialise(**shape)
            return run.get1("crest")

    assert crest(lines=1) == pytest.approx(math.sqrt(2.0), rel=1e-12)
    # of an inverse FFT with 64 points for each line
    schroeder = [crest(lines=n) for n in (10, 20, 50, 100, 256)]
    assert schroeder == pytest.approx([1.9162371, 1.7639856, 1.7214673, 1.6760850, 1.6801343], rel=2e-3)
    random = [crest(lines=100, seed=seed) for seed in range(1, 21)]
    assert min(random) > 2.3 and max(random) < 4.5
    assert len(set(random)) == 20
    assert random[:3] == [crest(lines=100, seed=seed) for seed in (1, 2, 3)]


def test_it_repeats_with_its_period_also_late(multisine: Library) -> None:
    found = []
    for t in (0.3, 4.3, 4e5 + 0.3):
        with Instance(multisine) as run:
            run.initialise(start=t, f0=0.25, lines=50)
            found.append(run.get("r", "rd", "rdd"))
    for one in found[1:]:
        # 4e5 s is a hundred thousand periods; its last bit, 6e-11 s, is 8e-10 rad of the 50th line
        np.testing.assert_allclose(one, found[0], rtol=1e-6, atol=1e-12)


def test_parameters_of_the_run_scale_and_shift(multisine: Library) -> None:
    with Instance(multisine) as run:
        run.initialise(start=0.37, lines=10)
        r, rd, rdd = run.get("r", "rd", "rdd")
        crest = run.get1("crest")
        run.set({"peak": 5e-3, "offset": 0.2})
        assert run.get("r", "rd", "rdd") == pytest.approx([0.2 + 5.0 * r, 5.0 * rd, 5.0 * rdd], rel=1e-14)
        assert run.get1("crest") == crest
