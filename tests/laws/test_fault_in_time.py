"""Bad inputs to the controllers that know the time: what goes on meanwhile, against formulas that know the gaps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from shell.instance import ERROR, OK, WARNING, Instance, load
from thorough import landing

Ts = 1e-3


@pytest.fixture
def samples(build_fmu: Callable[..., Path]) -> Callable[..., np.ndarray]:
    """``samples(model, inputs, outputs, **start)``: the outputs at every sample, shape (samples, outputs)."""

    def run(model: str, inputs: Mapping[str, np.ndarray], outputs: tuple[str, ...], **start: float) -> np.ndarray:
        rows = []
        with Instance(load(build_fmu(model))) as block:
            block.initialise(**start)
            for k, values in enumerate(zip(*inputs.values(), strict=True)):
                block.set(dict(zip(inputs, values, strict=True)))
                assert block.call("DoStep", k * Ts, Ts, 1) in (OK, WARNING)
                rows.append(block.get(*outputs, "fault"))
        return np.array(rows)

    return run


def held(values: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Each bad value replaced by the last good one."""
    last = np.maximum.accumulate(np.where(bad, 0, np.arange(len(values))))
    return values[last]


def test_the_local_function_leaves_out_intervals_with_a_bad_end(samples):
    """The mean of the last four intervals that are known."""
    n, m, window = 60, 2.5, 4
    v, u = np.random.default_rng(1).normal(size=(2, n)) * [[1e-2], [5.0]]
    bad = np.zeros(n, bool)
    bad[[0, 20, 21, 22, 40, 50]] = True
    found = samples(
        "LocalFunctionEstimator",
        {"v": np.where(bad, math.nan, v), "u_prev": u},
        ("F_hat",),
        m=m,
        window=window,
        degree=0,
    )
    known, expected = [0.0] * window, []
    for k in range(n):
        if k > 0 and not bad[k] and not bad[k - 1]:
            known.append(u[k] - m * (v[k] - v[k - 1]) / Ts)
        expected.append(np.mean(known[-window:]))
    assert found[:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert np.array_equal(found[:, 1], bad)


def test_a_bad_input_in_a_pulse_counts_and_begins_the_dwell_anew(samples):
    """Pulses of three samples after four at rest."""
    n, bad = 24, np.zeros(24, bool)
    bad[[4, 9, 13]] = True
    inputs = {"r": np.full(n, 1e-3), "x": np.zeros(n), "v": np.where(bad, math.inf, 0.0)}
    start = {"n_stuck": 4, "n_pulse": 3, "sized": 0.0, "F_pulse": 7.0}
    found = samples("ImpulsiveControl", inputs, ("u",), **start)
    # pulse 3-5 with a bad sample in it; at rest from 6, bad at 9, so from 10 and, bad at 13, from 14
    expected = np.zeros(n)
    expected[[3, 4, 5, 17, 18, 19, 23]] = 7.0
    assert np.array_equal(found[:, 0], expected)


def test_a_pulse_ends_with_the_bad_samples_it_ends_in(samples):
    n, bad = 14, np.zeros(14, bool)
    bad[4:9] = True
    inputs = {"r": np.full(n, 1e-3), "x": np.where(bad, math.nan, 0.0), "v": np.zeros(n)}
    found = samples("ImpulsiveControl", inputs, ("u",), n_stuck=4, n_pulse=3, sized=0.0, F_pulse=7.0)
    assert np.array_equal(found[:, 0], [0.0] * 3 + [7.0] * 6 + [0.0] * 3 + [7.0] * 2)


def test_a_trial_with_a_bad_input_goes_on_and_teaches_nothing(samples):
    """L is a gain of 1e3 and rate 1, so that a trial adds 1e3 e; the trial after a spoilt one repeats it, in time."""
    n, trials = 10, 5
    e = np.random.default_rng(3).uniform(0.5e-3, 1e-3, size=(trials, n))
    bad = np.zeros((trials, n), bool)
    bad[1, 3:6] = True  # within a trial
    bad[3, 0] = True  # the sample that ends the trial before, which was good
    end = np.zeros((trials, n))
    end[1:, 0] = 1.0
    inputs = {"r": np.where(bad, math.nan, e).ravel(), "x": np.zeros(trials * n), "trial_end": end.ravel()}
    start = {"N": n, "fq": 0.0, "rate": 1.0, "m": 0.0, "Kp": 1e3, "Kd": 0.0, "Ki": 0.0}
    found = samples("IterativeLearning", inputs, ("F_hat", "trial"), **start)
    first, second = 1e3 * e[0], 1e3 * (e[0] + e[2])
    force = np.concatenate([np.zeros(n), first, first, second, second])
    assert found[:, 0] == pytest.approx(held(force, bad.ravel()), rel=1e-12)
    count = np.repeat(np.arange(trials), n)
    assert np.array_equal(found[:, 1], held(count, bad.ravel()))


@pytest.mark.parametrize(("N", "M", "gaps"), [(7, 0, [30]), (7, 3, [0, 1, 30, 31, 50]), (5, 2, list(range(20, 33)))])
def test_a_period_goes_on_over_bad_inputs(samples, N, M, gaps):
    """y of a bad sample is that of a period before; what needs an error that is not known is not learned."""
    n, rate = 80, 0.5
    gains = {"m": 2.0, "Kp": 700.0, "Kd": 30.0, "Ki": 900.0}
    e = np.random.default_rng(4).normal(size=n) * 1e-4
    bad = np.isin(np.arange(n), gaps)
    start = gains | {"N": N, "M": M, "fq": 150.0, "rate": rate, "u_min": -1e6, "u_max": 1e6}
    found = samples("RepetitiveController", {"r": np.where(bad, math.inf, e), "x": np.zeros(n)}, ("F_hat",), **start)
    i = np.arange(-M, M + 1)
    taps = np.sinc(2.0 * 150.0 * Ts * i) * np.hanning(2 * M + 3)[1:-1]
    taps /= taps.sum()
    begin = int(np.flatnonzero(~bad)[0])
    integral = Ts * (np.cumsum(np.where(bad, 0.0, e)) - np.where(bad, 0.0, e))
    y, F = np.zeros(n + M), np.zeros(n)
    for k in range(n):
        if bad[k]:
            y[k] = y[k - N] if k >= N else 0.0
            continue
        F[k] = sum(tap * y[k - N + j] for j, tap in zip(i, taps, strict=True) if k - N + j >= 0)
        before = e[k] if k == begin else e[k - 1]
        if k + 1 < n and not bad[k + 1] and (k == begin or not bad[k - 1]):
            L = gains["m"] * (e[k + 1] - 2.0 * e[k] + before) / Ts**2 + gains["Kd"] * (e[k + 1] - before) / (2.0 * Ts)
            y[k] = F[k] + rate * (L + gains["Kp"] * e[k] + gains["Ki"] * integral[k])
        else:
            y[k] = F[k]
    expected = held(np.where(bad, 0.0, F), bad)
    assert np.abs(found[:, 0] - expected).max() < 1e-9 * np.abs(F).max()


@landing
def test_leuven_curves_that_cannot_reach_sliding_are_refused(build_fmu):
    for values, accepted in (({"A": 2.99}, False), ({"A": 3.0}, True), ({"A": 3.0, "Fc": 1.51}, False)):
        with Instance(load(build_fmu("LeuvenFeedforward"))) as run:
            run.setup()
            run.must("EnterInitializationMode")
            run.set(values)
            assert run.call("ExitInitializationMode") == (OK if accepted else ERROR)
            assert accepted or b"must satisfy A >= 2 max(Fs, Fc)" in run.messages[-1][3]


def test_below_that_limit_the_deflection_grows_without_bound(build_fmu):
    """The friction block Leuven with the same A, which is free to show it; with A at the limit z settles."""
    last = []
    for A in (2.8, 3.0):
        with Instance(load(build_fmu("Leuven"))) as run:
            run.initialise(A=A, Fs=1.5, Fc=1.5)
            run.set({"v": 0.1})
            run.step(0.0, 1.0)
            run.set({"v": -0.1})
            run.step(1.0, 1.0)
            before = run.get1("z")
            run.step(2.0, 1.0)
            last.append(abs(run.get1("z") - before))
    # its slope is 1 - r^n, r = A/(2 Fc)
    assert last[0] == pytest.approx(0.1 * (1.0 - (2.8 / 3.0) ** 2), rel=1e-3)
    assert last[1] < 1e-9
