"""Controllers in C, each against mathematics that is written down here a second time, another way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from shell.instance import Instance, load
from thorough import nightly

from friction_fmus import build
from friction_fmus.blocks.arithmetic import evaluate
from friction_fmus.blocks.customise import with_long_arrays
from friction_fmus.errors import BuildError
from friction_fmus.study.compensators import compensators
from harness import AlgebraicLoopError, CallablePart, FmuPart, Port, System, Wire

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


def test_a_disabled_local_function_compensates_nothing_after_a_fault(samples):
    """Also in the sample with an input that is no number, which begins from scratch."""
    n = 20
    u = np.full(n, 5.0)
    u[15] = np.nan
    on = np.ones(n)
    on[15:] = 0.0
    inputs = {"v": np.linspace(0.0, 0.1, n), "u_prev": u, "enable": on}
    found = samples("LocalFunctionEstimator", inputs, ("F_hat", "u"), gain=0.5, window=2, m=1.0)
    assert found[14, 1] != 0.0
    assert found[15, 1] == 0.0


def test_the_window_of_the_local_function_has_the_delay_of_a_first_order_filter() -> None:
    """The mean over the window is late by half of it; a filter with this corner frequency by 1 / (2 pi corner)."""
    text = compensators()["LocalFunctionEstimator"].tuned["window"]
    for corner, Ts in ((20.0, 1e-3), (5.0, 1e-3), (50.0, 2e-4)):
        window = evaluate(text, {"corner": corner, "Ts": Ts})
        assert 0.5 * window * Ts == pytest.approx(1.0 / (2.0 * math.pi * corner), abs=0.25 * Ts)
    assert evaluate(text, {"corner": 1e4, "Ts": 1e-3}) == 3


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


# ---- IterativeLearning ---------------------------------------------------------------------------------------------


def inverse_sensitivity(e: np.ndarray, Ts: float, m: float, Kp: float, Kd: float, Ki: float) -> np.ndarray:
    """m e'' + Kd e' + Kp e + Ki int e by matrices; the ends continue constant, the integral is PID's."""
    wide = np.concatenate([e[:1], e, e[-1:]])
    second = np.convolve(wide, [1.0, -2.0, 1.0], "valid") / Ts**2
    first = np.convolve(wide, [1.0, 0.0, -1.0], "valid") / (2.0 * Ts)
    return m * second + Kd * first + Kp * e + Ki * Ts * (np.cumsum(e) - e)


LOOP = {"m": 2.0, "Kp": 700.0, "Kd": 30.0, "Ki": 900.0}


@pytest.mark.parametrize("fq", [0.0, 20.0, 60.0, 600.0])
def test_a_learning_step_is_the_formula(samples, fq):
    n, Ts, rate = 60, 1e-3, 0.4
    e = np.random.default_rng(1).normal(size=(3, n)) * 1e-4
    end = np.zeros((3, n))
    end[1:, 0] = 1.0  # true for one sample in one case, for many in the other
    end[2, :5] = 1.0
    inputs = {"r": e.ravel(), "x": np.zeros(3 * n), "trial_end": end.ravel()}
    start = LOOP | {"N": n, "fq": fq, "rate": rate, "u_min": -1e6, "u_max": 1e6, "gain": 0.5}
    found = samples("IterativeLearning", inputs, ("F_hat", "u", "rms", "trial"), **start)
    w = np.zeros(n)
    expected = [w]
    for error in e[:2]:
        w = w + rate * inverse_sensitivity(error, Ts, **LOOP)
        if 0.0 < fq < 500.0:
            w = filtfilt(*butter(2, fq, fs=1.0 / Ts), w, padlen=0)
        expected.append(w)
    flat = np.concatenate(expected)
    assert np.abs(found[:, 0] - flat).max() < 1e-9 * np.abs(flat).max()
    assert np.array_equal(found[:, 1], 0.5 * found[:, 0])
    assert np.array_equal(found[:, 3], np.repeat([0.0, 1.0, 2.0], n))
    assert found[[n, 2 * n], 2] == pytest.approx(np.sqrt((e[:2] ** 2).mean(axis=1)))


def test_learning_commands_and_limits(samples):
    n = 10
    trials = 6
    end, learn, on, reset = (np.zeros((trials, n)) for _ in range(4))
    end[1:, 0] = 1.0
    learn[:] = on[:] = 1.0
    learn[2, 0] = 0.0  # the second trial teaches nothing
    on[3, 5:8] = 0.0
    reset[5, 0] = 1.0
    inputs = {"r": np.full(trials * n, 1e-3), "x": np.zeros(trials * n), "trial_end": end.ravel()}
    inputs |= {"learn": learn.ravel(), "enable": on.ravel(), "reset": reset.ravel()}
    start = {"N": n, "fq": 0.0, "rate": 1.0, "m": 0.0, "Kp": 1e3, "Kd": 0.0, "Ki": 0.0, "u_max": 2.5}
    found = samples("IterativeLearning", inputs, ("u",), **start).reshape(trials, n)
    assert np.array_equal(found[:3], np.repeat([[0.0], [1.0], [1.0]], n, axis=1))
    # disabled it is silent, and stays out of this trial, from which nothing is learned
    assert np.array_equal(found[3], [2.0] * 5 + [0.0] * 5)
    # the next trial repeats what was learned before
    assert np.array_equal(found[4], [2.0] * 10)
    assert not found[5].any()


@pytest.mark.parametrize("command", ["enable", "reset"])
def test_learning_waits_for_the_next_trial_after_an_interruption(samples, command):
    """L is a gain of 1e3, so that the force of sample k is 1e3 e[k] of the trials that were heard from the start."""
    n, trials = 10, 4
    e = np.random.default_rng(5).uniform(0.5e-3, 1e-3, size=(trials, n))
    end, interrupted = np.zeros((2, trials, n))
    end[1:, 0] = 1.0
    interrupted[1, 4] = 1.0
    commands = {"enable": 1.0 - interrupted, "reset": 0.0 * interrupted}
    if command == "reset":
        commands = {"enable": 1.0 + 0.0 * interrupted, "reset": interrupted}
    inputs = {"r": e.ravel(), "x": np.zeros(trials * n), "trial_end": end.ravel()}
    inputs |= {name: value.ravel() for name, value in commands.items()}
    start = {"N": n, "fq": 0.0, "rate": 1.0, "m": 0.0, "Kp": 1e3, "Kd": 0.0, "Ki": 0.0}
    found = samples("IterativeLearning", inputs, ("F_hat",), **start)[:, 0].reshape(trials, n)
    first = 1e3 * e[0] * (command == "enable")
    expected = [np.zeros(n), np.append(1e3 * e[0, :4], np.zeros(6)), first, first + 1e3 * e[2]]
    assert found == pytest.approx(np.array(expected), rel=1e-12)


def test_errors_of_a_linear_loop_contract_by_one_minus_rate(build_fmu):
    """On r = A (1 - cos(2 pi t)), which starts and ends at rest, with a rate of 0.5."""
    gains = {"m": 1.0, "Kp": 12e3, "Kd": 190.0, "Ki": 250e3}
    names = {"reference": "Sine", "ilc": "IterativeLearning", "pid": "PID", "mass": "Mass", "friction": "Viscous"}
    parts = [FmuPart(name, build_fmu(model)) for name, model in names.items()]
    ends = CallablePart("ends", lambda t, u, x: float(round(t / 1e-3) % 1000 == 0), [], [Port("end", type="Boolean")])
    wires = ["reference.r -> pid.r", "reference.rd -> pid.rd", "mass.x -> pid.x", "mass.v -> pid.v"]
    wires += ["reference.r -> ilc.r", "mass.x -> ilc.x", "ends.end -> ilc.trial_end", "ilc.u -> pid.f"]
    wires += ["pid.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"pid.rdd": 0.0, "mass.F_load": 0.0, "mass.v_support": 0.0, "friction.Fv": 20.0, "ilc.fq": 100.0}
    start |= {"reference.offset": 0.01, "reference.amplitude[1]": -0.01, "reference.phase[1]": np.pi / 2.0}
    start |= {"ilc.N": 1000} | {f"ilc.{name}": value for name, value in gains.items()}
    with System([*parts, ends], wires, start) as system:
        result = system.run(stop=8.0, step=1e-3, record=["reference.r", "mass.x"])
    error = (result["reference.r"] - result["mass.x"]).to_numpy()[:-1].reshape(8, 1000)
    rms = np.sqrt(np.mean(error**2, axis=1))
    # the second trial still has the transient of the first one's end
    assert rms[2:] / rms[1:-1] == pytest.approx([0.5] * 6, rel=0.1)


def test_a_trial_longer_than_the_buffer_ends_silently(samples):
    inputs = {"r": np.full(12, 1e-3), "x": np.zeros(12), "trial_end": np.eye(12)[6]}
    start = {"N": 4, "fq": 0.0, "rate": 1.0, "m": 0.0, "Kp": 1e3, "Kd": 0.0, "Ki": 0.0}
    found = samples("IterativeLearning", inputs, ("F_hat",), **start)[:, 0]
    assert np.array_equal(found, [0.0] * 6 + [1.0] * 4 + [0.0] * 2)


# ---- RepetitiveController ------------------------------------------------------------------------------------------


def hann_sinc(M: int, corner: float) -> np.ndarray:
    """The taps of Q, of the sum 1; numpy's Hann window begins and ends with a zero."""
    i = np.arange(-M, M + 1)
    taps = 2.0 * corner * np.sinc(2.0 * corner * i) * np.hanning(2 * M + 3)[1:-1]
    return taps / taps.sum()


@pytest.mark.parametrize(("N", "M", "fq"), [(20, 5, 60.0), (20, 0, 60.0), (20, 40, 100.0), (7, 2, 0.0), (2, 9, 60.0)])
def test_repetition_is_the_formula(samples, N, M, fq):
    n, Ts, rate = 120, 1e-3, 0.4
    e = np.random.default_rng(2).normal(size=n) * 1e-4
    start = LOOP | {"N": N, "M": M, "fq": fq, "rate": rate, "u_min": -1e6, "u_max": 1e6, "gain": 0.5}
    found = samples("RepetitiveController", {"r": e, "x": np.zeros(n)}, ("F_hat", "u"), **start)
    half = min(M, N - 2)
    taps = hann_sinc(half, fq * Ts) if fq and half else np.eye(2 * half + 1)[half]
    # the first error counts as the one before, and nothing is learned from the last
    Le = np.concatenate([inverse_sensitivity(e, Ts, **LOOP)[:-1], [0.0]])
    y, F = np.zeros(n), np.zeros(n)
    for k in range(n):
        for i, tap in zip(range(-half, half + 1), taps, strict=True):
            if k - N + i >= 0:
                F[k] += tap * y[k - N + i]
        y[k] = F[k] + rate * Le[k]
    assert np.abs(found[:, 0] - F).max() < 1e-9 * np.abs(F).max()
    assert np.array_equal(found[:, 1], 0.5 * found[:, 0])


@nightly
def test_a_long_period_is_chosen_when_it_is_built(build_fmu, tmp_path):
    """With an error at a single sample and Q = 1, the force is an impulse that returns every N samples."""
    N, n = 16384, 3 * 16384
    e = np.zeros(n)
    e[100] = 1e-3
    found = np.zeros(n)
    with Instance(load(build_fmu("RepetitiveController", N=N))) as block:
        block.initialise(M=0, fq=0.0, rate=1.0, m=0.0, Kp=1e3, Kd=0.0, Ki=0.0)
        for k in range(n):
            block.set({"r": e[k]})
            block.step(k * 1e-3, 1e-3)
            found[k] = block.get1("F_hat")
    expected = np.zeros(n)
    expected[[100 + N, 100 + 2 * N]] = 1.0
    assert np.array_equal(found, expected)
    for value in (16385, 5000.5):
        with pytest.raises(BuildError, match=f"N = {value:g}: above 4096, give an integer up to 16384"):
            build("RepetitiveController", tmp_path, start={"N": value})


@pytest.mark.parametrize("row", ["SIZE(N, LONGEST)", "SIZE(N, TAPS, 16384)", "SIZE(N, LONGEST, many)"])
def test_a_malformed_size_is_named(row):
    code = f"#define LONGEST 4096\n#define SIZES {row}\n"
    with pytest.raises(BuildError, match="Mine has the malformed row SIZE"):
        with_long_arrays(code, "Mine", {"N": 5000})


def test_repetition_forgets_on_reset_and_disable_and_keeps_its_limits(samples):
    n = 60
    on, reset = np.ones(n), np.zeros(n)
    reset[20], on[40:45] = 1.0, 0.0
    inputs = {"r": np.full(n, 1e-3), "x": np.zeros(n), "enable": on, "reset": reset}
    start = {"N": 5, "M": 0, "fq": 0.0, "rate": 1.0, "m": 0.0, "Kp": 1e3, "Kd": 0.0, "Ki": 0.0, "u_max": 2.5}
    found = samples("RepetitiveController", inputs, ("F_hat",), **start)[:, 0]
    rise = np.minimum(np.arange(20) // 5, 2.5)
    assert np.array_equal(found[:40], np.tile(rise, 2))
    assert not found[40:45].any()
    assert np.array_equal(found[45:], rise[:15])


@pytest.fixture(scope="module")
def repeated(build_fmu: BuildFmu) -> Iterator[Callable[..., np.ndarray]]:
    """Error of a mass under PD and repetitive control that is shaken by a force of the given frequencies."""

    def error(frequencies: list[float], periods: int, **start: float) -> np.ndarray:
        shake = CallablePart(
            "shake", lambda t, u, x: sum(np.sin(2.0 * np.pi * f * t + f) for f in frequencies), outputs=["F"]
        )
        parts = [
            FmuPart("repetition", build_fmu("RepetitiveController")),
            FmuPart("pd", build_fmu("PID")),
            FmuPart("mass", build_fmu("Mass")),
            shake,
        ]
        wires = ["mass.x -> pd.x", "mass.v -> pd.v", "mass.x -> repetition.x", "repetition.u -> pd.f"]
        wires += ["pd.u -> mass.F_drive", "shake.F -> mass.F_load"]
        values = {"pd.r": 0.0, "pd.rd": 0.0, "pd.rdd": 0.0, "repetition.r": 0.0, "mass.F_friction": 0.0}
        values |= {f"{part}.{name}": value for part in ("pd", "repetition") for name, value in GAINS.items()}
        values |= {"mass.m": 2.0, "repetition.m": 2.0, "repetition.N": 200, "mass.v_support": 0.0}
        values |= {f"repetition.{name}": value for name, value in start.items()}
        with System(parts, wires, values) as system:
            result = system.run(stop=0.2 * periods, step=1e-3, record=["mass.x"])
        return result["mass.x"].to_numpy()[-200:]

    yield error


GAINS = {"Kp": 4e3, "Kd": 120.0, "Ki": 0.0}


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_harmonics_vanish_within_16_periods(repeated):
    harmonics = [5.0, 10.0, 15.0, 35.0]
    assert rms(repeated(harmonics, 16)) < 0.1 * rms(repeated(harmonics, 16, gain=0.0))


def test_between_the_harmonics_errors_grow_by_at_most_two(repeated):
    """With the rate 0.5 and an exact L by 2/(2 - rate) = 4/3 half way between two harmonics."""
    ratio = rms(np.concatenate([repeated([7.5], n) for n in (39, 40)]))
    ratio /= rms(np.concatenate([repeated([7.5], n, gain=0.0) for n in (39, 40)]))
    assert ratio == pytest.approx(4.0 / 3.0, rel=0.03)


@pytest.mark.parametrize(("wrong", "stable"), [(1.0, True), (3.0, True), (5.0, False)])
def test_the_condition_of_convergence(repeated, wrong, stable):
    """L too large by a factor: |1 - 0.5 factor| < 1 below the corner of Q."""
    L = {"m": 2.0 * wrong} | {name: wrong * value for name, value in GAINS.items()}
    late, later = (rms(repeated([5.0], n, **L)) for n in (12, 20))
    assert (later < late) == stable


def test_a_reset_by_the_controller_that_the_learned_force_acts_on_is_a_loop(build_fmu: Callable[..., Path]) -> None:
    """A reset acts in its sample: without a delay, it would be a sample late in one of the two orders."""
    values = dict.fromkeys(("pid.r", "pid.rd", "pid.rdd", "pid.x", "pid.v", "ilc.r", "ilc.x"), 0.0)
    parts = [FmuPart("pid", build_fmu("PID")), FmuPart("ilc", build_fmu("IterativeLearning"))]
    with pytest.raises(AlgebraicLoopError, match=r"pid\.fault -> ilc\.reset -> ilc\.u"):
        System(parts, ["pid.fault -> ilc.reset", "ilc.u -> pid.f"], values).run(0.01, step=1e-3)
    late = Wire("ilc.u", "pid.f", delay=1)
    System(parts, ["pid.fault -> ilc.reset", late], values).run(0.01, step=1e-3)
