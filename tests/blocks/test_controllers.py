"""Controllers in C, each against mathematics that is written down here a second time, another way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from fmi.instance import Instance, load

from harness import FmuPart, System

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


# ---- ImpulsiveControl ----------------------------------------------------------------------------------------------

STILL = {"n_stuck": 4, "n_pulse": 3, "tol": 1e-5, "v_stuck": 1e-3, "m": 2.0, "Fc": 1.5, "Fs": 1.5}


def slide(force: float, m: float, Fc: float, tp: float) -> float:
    return force * (force - Fc) * tp**2 / (2.0 * m * Fc)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_pulse_train_at_rest(samples, side):
    n, e = 30, side * 1e-3
    inputs = {"r": np.full(n, e), "x": np.zeros(n), "v": np.zeros(n), "f": np.full(n, 0.25)}
    found = samples("ImpulsiveControl", inputs, ("u", "pulse", "pulses"), **STILL)
    force = found[3, 0]
    # the inverse of the slide
    assert slide(abs(force), 2.0, 1.5, 3e-3) == pytest.approx(1e-3, rel=1e-12)
    assert np.sign(force) == side
    # three samples at rest, the fourth is the first of three with the pulse, again and again
    pattern = np.tile([0.0, 0.0, 0.0, force, force, force], 5)
    assert np.array_equal(found[:, 1], pattern)
    assert np.array_equal(found[:, 0], np.where(pattern, pattern, 0.25))
    assert found[-1, 2] == 5
    added = samples("ImpulsiveControl", inputs, ("u",), **STILL, alone=0.0)
    assert np.array_equal(added[:, 0], 0.25 + pattern)


def test_pulses_need_an_error_and_rest(samples):
    n = 40
    zero = np.zeros(n)
    for inputs in ({"r": np.full(n, 0.9e-5), "v": zero}, {"r": np.full(n, 1e-3), "v": np.tile([0, 0, 0, 2e-3], 10)}):
        found = samples("ImpulsiveControl", inputs | {"x": zero, "f": zero + 0.5}, ("u", "pulse", "pulses"), **STILL)
        assert np.array_equal(found, np.tile([0.5, 0.0, 0.0], (n, 1)))


def test_pulse_forces(samples):
    n = 6
    inputs = {"r": np.full(n, 1e-3), "x": np.zeros(n), "v": np.zeros(n)}

    def force(**start: float) -> float:
        return float(samples("ImpulsiveControl", inputs, ("u",), **(STILL | start))[4, 0])

    assert force(sized=0.0, F_pulse=7.0, gain=0.5) == 3.5
    assert force(u_max=5.0) == 5.0
    assert force(Fs=1e2, u_max=1e3) == 1e2
    assert slide(force(gain=0.25), 2.0, 1.5, 3e-3) == pytest.approx(0.25e-3, rel=1e-12)


def test_impulsive_reset_and_disable_end_a_pulse(samples):
    n = 30
    on, reset = np.ones(n), np.zeros(n)
    reset[4], on[14:17] = 1.0, 0.0
    inputs = {"r": np.full(n, 1e-3), "x": np.zeros(n), "v": np.zeros(n), "enable": on, "reset": reset}
    found = samples("ImpulsiveControl", inputs, ("u", "u_sat"), **STILL, u_max=2.0)
    # the sample of the reset counts as one at rest already, those without enable do not
    expected = np.zeros(n)
    expected[[3, 7, 8, 9, 13, 20, 21, 22, 26, 27, 28]] = 2.0
    assert np.array_equal(found[:, 0], expected)
    assert np.array_equal(found[:, 1], (expected > 0.0).astype(float))


@pytest.fixture(scope="module")
def stuck_axis(build_fmu: BuildFmu) -> Iterator[Callable[..., np.ndarray]]:
    """Position error over time of a rigid mass that is 0.3 mm off its target, under PD control and pulses."""
    parts = [
        FmuPart("pd", build_fmu("PID"), every=10),
        FmuPart("pulses", build_fmu("ImpulsiveControl"), every=10),
        FmuPart("mass", build_fmu("KarnoppMass")),
    ]
    wires = ["mass.x -> pd.x", "mass.v -> pd.v", "mass.x -> pulses.x", "mass.v -> pulses.v"]
    wires += ["pd.u -> pulses.f", "pulses.u -> mass.F_ext"]
    values = {"pd.r": 3e-4, "pd.rd": 0.0, "pd.rdd": 0.0, "pd.Kp": 1e3, "pd.Kd": 100.0, "pd.Ki": 0.0, "pulses.r": 3e-4}
    values |= {"mass.m": 2.0, "mass.Fc": 1.5, "mass.Fv": 0.0, "mass.DV": 1e-9}
    values |= {"pulses.m": 2.0, "pulses.Fc": 1.5, "pulses.tol": 1e-5, "pulses.n_pulse": 3}
    with System(parts, wires, values) as system:

        def error(Fs: float, **start: float) -> np.ndarray:
            given = {"mass.Fs": Fs, "pulses.Fs": Fs} | {name.replace("_at_", "."): v for name, v in start.items()}
            result = system.with_start(given).run(stop=2.0, step=1e-4, record=["mass.x"])
            return 3e-4 - result["mass.x"].to_numpy()

        yield error


def test_one_pulse_slides_a_rigid_mass_by_the_closed_form(stuck_axis):
    """Without the position controller the error e becomes (1 - gain) e, pulse by pulse."""
    error = stuck_axis(1.5, pd_at_Kp=0.0, pd_at_Kd=0.0, pulses_at_gain=0.5, pulses_at_tol=1e-6)
    rests = np.unique(error[np.flatnonzero(np.diff(error) == 0.0)])[::-1]
    assert rests == pytest.approx([3e-4 * 0.5**j for j in range(len(rests))], rel=1e-3)
    assert len(rests) == 10  # 3e-4/2^9 is the first below the tolerance


def test_pulses_remove_an_error_inside_the_stiction_band(stuck_axis):
    """Kp e = 0.3 N cannot move it, static friction is 2.4 N."""
    held = stuck_axis(2.4, pulses_at_enable=1.0, pulses_at_gain=0.0, pulses_at_sized=0.0)
    freed = stuck_axis(2.4)
    assert np.ptp(held) == 0.0
    assert abs(freed[-1]) < 1e-5
    assert len(np.unique(freed[np.flatnonzero(np.diff(freed) == 0.0)])) <= 6
