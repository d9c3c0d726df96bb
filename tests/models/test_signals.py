"""References and sensors: each block against mathematics that is written down here a second time, another way."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from scipy.signal import bilinear, butter, lfilter, lfilter_zi
from thorough import few, some

from friction_fmus import build_record
from friction_fmus.blocks.catalogue import source_folder

Array = NDArray[np.float64]
Load = Callable[..., "Block"]

PROPERTY = settings(
    max_examples=few(60), deadline=20_000, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


class Block:
    """An FMU that is started again and again."""

    def __init__(self, path: Path, folder: Path) -> None:
        description = fmpy.read_model_description(str(path))
        self.variables = {v.name: v for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), unzipdir=str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="tested",
        )
        self.fmu.instantiate()
        self.time = 0.0

    def set(self, **values: Any) -> None:
        for name, value in values.items():
            v = self.variables[name]
            getattr(self.fmu, f"set{v.type}")([v.valueReference], [value])

    def get(self, *names: str) -> Array:
        return np.array(self.fmu.getReal([self.variables[name].valueReference for name in names]))

    def begin(self, time: float = 0.0, **start: Any) -> Block:
        self.fmu.reset()
        self.fmu.setupExperiment(startTime=time)
        self.set(**start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.time = time
        return self

    def step_to(self, time: float) -> None:
        self.fmu.doStep(self.time, time - self.time)
        self.time = time

    def at(self, time: float, *names: str, **start: Any) -> Array:
        """The outputs at a time, of a block that starts there."""
        return self.begin(time, **start).get(*names)

    def trace(self, times: ArrayLike, *names: str, **start: Any) -> Array:
        """The outputs at increasing times, reached by steps: one column for each name."""
        first, *others = [float(t) for t in np.asarray(times)]
        rows = [self.begin(first, **start).get(*names)]
        for t in others:
            self.step_to(t)
            rows.append(self.get(*names))
        return np.array(rows).T


@pytest.fixture(scope="module")
def load(build_fmu: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Load]:
    """``load(name_or_path)``: a started block; freed at the end."""
    loaded: dict[str | Path, Block] = {}
    with ExitStack() as stack:

        def get(which: str | Path) -> Block:
            if which not in loaded:
                path = which if isinstance(which, Path) else build_fmu(which)
                loaded[which] = Block(path, tmp_path_factory.mktemp("unpacked"))
                stack.callback(loaded[which].fmu.freeInstance)
            return loaded[which]

        yield get


# ---- Profile ---------------------------------------------------------------------------------------------------

MOTION = ("r", "rd", "rdd", "rddd")


def durations(L: float, v: float, a: float, j: float) -> tuple[float, float, float]:
    """Constant jerk, acceleration and velocity [s], by asking which limits a move of length L reaches."""
    if L == 0.0:
        return 0.0, 0.0, 0.0
    tj, ta = (a / j, v / a - a / j) if v * j > a * a else (np.sqrt(v / j), 0.0)
    if v * (2.0 * tj + ta) <= L:
        return tj, ta, L / v - (2.0 * tj + ta)
    if 2.0 * a**3 / j**2 < L:
        peak = max(np.roots([1.0 / a, a / j, -L]).real)  # v (v/a + a/j) = L
        return a / j, peak / a - a / j, 0.0
    return (L / (2.0 * j)) ** (1.0 / 3.0), 0.0, 0.0


def move(times: Array, L: float, v: float, a: float, j: float) -> Array:
    """The move from 0 to L, its jerk pattern integrated three times from the beginning on."""
    tj, ta, tv = durations(abs(L), v, a, j)
    lengths = [tj, ta, tj, tv, tj, ta, tj]
    jerks = np.sign(L) * j * np.array([1, 0, -1, 0, -1, 0, 1])
    out = np.zeros((4, times.size))
    p = s = acceleration = begin = 0.0
    for h, jerk in zip(lengths, jerks, strict=True):
        end = begin + h
        u = times - begin
        inside = (times >= begin) & (times < end)
        segment = np.array(
            [
                p + s * u + acceleration * u**2 / 2.0 + jerk * u**3 / 6.0,
                s + acceleration * u + jerk * u**2 / 2.0,
                acceleration + jerk * u,
                np.full_like(u, jerk),
            ]
        )
        out[:, inside] = segment[:, inside]
        p += s * h + acceleration * h**2 / 2.0 + jerk * h**3 / 6.0
        s += acceleration * h + jerk * h**2 / 2.0
        acceleration += jerk * h
        begin = end
    out[0, times >= begin] = p
    return out


def limits(v: float, a: float, j: float) -> dict[str, float]:
    return {"v_max": v, "a_max": a, "j_max": j}


def logarithmic(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(np.log10(low), np.log10(high)).map(lambda exponent: 10.0**exponent)


ANY_LIMITS = {"v": logarithmic(1e-3, 10.0), "a": logarithmic(1e-2, 100.0), "j": logarithmic(0.1, 1e5)}

# L, v_max, a_max, j_max, duration: the known closed forms, by which limits are reached
CASES = {
    "v, a and j": (0.1, 0.25, 2.5, 50.0, 0.1 / 0.25 + 0.25 / 2.5 + 2.5 / 50.0),
    "v and j": (1.0, 0.5, 100.0, 8.0, 1.0 / 0.5 + 2.0 * np.sqrt(0.5 / 8.0)),
    "a and j": (0.1, 9.0, 2.0, 40.0, 2.0 / 40.0 + np.sqrt((2.0 / 40.0) ** 2 + 4.0 * 0.1 / 2.0)),
    "j": (0.004, 9.0, 90.0, 20.0, (32.0 * 0.004 / 20.0) ** (1.0 / 3.0)),
}


@pytest.mark.parametrize(("L", "v", "a", "j", "T"), CASES.values(), ids=CASES)
def test_a_move_lasts_as_long_as_its_closed_form(load: Load, L: float, v: float, a: float, j: float, T: float) -> None:
    profile = load("Profile")
    early, late = 0.9 * T, 1.1 * T  # the last segment has jerk, rest has none
    while late - early > 1e-13:
        middle = 0.5 * (early + late)
        under_way = profile.at(middle, "rddd", r_end=L, **limits(v, a, j))[0] != 0.0
        early, late = (middle, late) if under_way else (early, middle)
    assert late == pytest.approx(T, rel=1e-11)


@pytest.mark.parametrize(("L", "v", "a", "j", "T"), CASES.values(), ids=CASES)
def test_no_admissible_jerk_goes_farther_in_the_same_time(
    load: Load, L: float, v: float, a: float, j: float, T: float
) -> None:
    assert load("Profile").at(T * (1.0 + 1e-12), "r", r_end=L, **limits(v, a, j))[0] == L

    # piecewise constant jerk u in [-1, 1] j: a linear programme for the longest way from rest to rest
    n = 160
    h = T / n
    lag = np.subtract.outer(np.arange(1, n + 1), np.arange(n))  # steps from the begin of jerk i to time k
    past = np.maximum(lag, 0)
    acceleration = np.where(lag > 0, j * h, 0.0)
    velocity = np.where(lag > 0, j * h**2 * (past - 0.5), 0.0)
    way = j * h**3 * (past[-1] ** 2 / 2.0 - past[-1] / 2.0 + 1.0 / 6.0)
    best = linprog(
        -way / L,
        A_ub=np.vstack([acceleration, -acceleration, velocity, -velocity]),
        b_ub=np.repeat([a, a, v, v], n),
        A_eq=np.vstack([acceleration[-1] / a, velocity[-1] / v]),
        b_eq=[0.0, 0.0],
        bounds=(-1.0, 1.0),
    )
    assert best.success
    assert -best.fun == pytest.approx(1.0, abs=2e-3)


@PROPERTY
@given(L=logarithmic(1e-6, 10.0), way=st.sampled_from([-1.0, 1.0]), r_start=st.floats(-1.0, 1.0), **ANY_LIMITS)
@example(L=0.1, way=1.0, r_start=0.0, v=0.25, a=2.5, j=50.0)
@example(L=0.5 * 0.25 * 2.0, way=-1.0, r_start=0.0, v=0.5, a=2.0, j=8.0)  # v and a reached for an instant only
def test_a_move_is_its_jerk_integrated_three_times(
    load: Load, L: float, way: float, r_start: float, v: float, a: float, j: float
) -> None:
    t_start = 0.3
    r_end = r_start + way * L
    T = float(np.dot([4.0, 2.0, 1.0], durations(abs(r_end - r_start), v, a, j)))
    times = np.concatenate([[0.0], t_start + T * np.linspace(0.0, 1.1, 98)])
    r, rd, rdd, rddd = load("Profile").trace(
        times, *MOTION, r_start=r_start, r_end=r_end, t_start=t_start, **limits(v, a, j)
    )
    expected = move(times - t_start, r_end - r_start, v, a, j)
    expected[:, times < t_start] = 0.0
    tj, ta, tv = durations(abs(r_end - r_start), v, a, j)
    late = 2e-15 * (t_start + T)  # [s] rounding of a time
    coarse = 1e-15 * (abs(r_start) + abs(r_end))  # [m] rounding of a position
    for got, want, rate, floor in (
        (r - r_start, expected[0], j * tj * (tj + ta), coarse),
        (rd, expected[1], j * tj, 0.0),
        (rdd, expected[2], j, 0.0),
    ):
        np.testing.assert_allclose(got, want, rtol=0, atol=rate * late + 1e-13 * np.abs(want).max() + floor)
    # the jerk, but at its jumps
    jumps = t_start + np.cumsum([0.0, tj, ta, tj, tv, tj, ta, tj])
    clear = np.abs(np.subtract.outer(times, jumps)).min(axis=1) > 1e-6 * T
    np.testing.assert_allclose(rddd[clear], expected[3][clear], rtol=1e-15)


@PROPERTY
@given(L=logarithmic(1e-6, 10.0), cyclic=st.booleans(), **ANY_LIMITS)
def test_a_motion_keeps_its_limits_and_has_no_jumps(
    load: Load, L: float, cyclic: bool, v: float, a: float, j: float
) -> None:
    T = float(np.dot([4.0, 2.0, 1.0], durations(L, v, a, j)))
    times = np.linspace(0.0, 3.0 * T, 200)
    trace = load("Profile").trace(times, *MOTION, r_start=0.0, r_end=L, cyclic=cyclic, dwell=0.1 * T, **limits(v, a, j))
    assert trace[0].min() >= 0.0
    assert trace[0].max() <= L
    assert set(np.unique(np.abs(trace[3]))) <= {0.0, j}
    for rate, limit in zip(trace[1:], (v, a, j), strict=True):
        assert np.abs(rate).max() <= limit * (1.0 + 1e-14)
    for value, limit in zip(trace[:3], (v, a, j), strict=True):
        assert np.all(np.abs(np.diff(value)) <= limit * np.diff(times) * (1.0 + 1e-9) + 1e-12 * np.abs(value).max())


@PROPERTY
@given(r_start=st.floats(-10.0, 10.0), r_end=st.floats(-10.0, 10.0), **ANY_LIMITS)
@example(r_start=0.1, r_end=0.1 + 1e-300, v=1.0, a=1.0, j=1.0)
@example(r_start=0.0, r_end=5e-324, v=1.0, a=1.0, j=1e5)
def test_a_move_ends_exactly_at_rest(load: Load, r_start: float, r_end: float, v: float, a: float, j: float) -> None:
    start = {"r_start": r_start, "r_end": r_end, **limits(v, a, j)}
    T = float(np.dot([4.0, 2.0, 1.0], durations(abs(r_end - r_start), v, a, j)))
    assert load("Profile").at(T * (1.0 + 1e-9), *MOTION, **start).tolist() == [r_end, 0.0, 0.0, 0.0]
    if T > 0.0:
        assert load("Profile").at(-1e-9, *MOTION, **start).tolist() == [r_start, 0.0, 0.0, 0.0]


@PROPERTY
@given(share=st.floats(0.0, 1.0), L=logarithmic(1e-6, 10.0), **ANY_LIMITS)
def test_the_second_half_is_the_first_one_backwards(
    load: Load, share: float, L: float, v: float, a: float, j: float
) -> None:
    tj, ta, tv = durations(L, v, a, j)
    T = 4.0 * tj + 2.0 * ta + tv
    start = {"r_end": L, **limits(v, a, j)}
    here = load("Profile").at(share * T, "r", "rd", "rdd", **start)
    there = load("Profile").at(T - share * T, "r", "rd", "rdd", **start)
    peak = np.array([L, j * tj * (tj + ta), j * tj])
    np.testing.assert_allclose(
        (here - [L, 0.0, 0.0]) / peak, there * [-1.0, 1.0, -1.0] / peak, atol=1e-12 + 2e-15 * T / tj
    )


def test_a_move_of_no_distance_is_rest(load: Load) -> None:
    for cyclic in (False, True):
        for dwell in (0.0, 0.2):
            start = {"r_start": 0.3, "r_end": 0.3, "cyclic": cyclic, "dwell": dwell}
            trace = load("Profile").trace(np.linspace(-0.1, 1.0, 12), *MOTION, **start)
            assert np.array_equal(trace, np.outer([0.3, 0.0, 0.0, 0.0], np.ones(12)))


def test_a_long_cruise_loses_no_digits(load: Load) -> None:
    L, v, a, j = 1e4, 1.0, 1e3, 1e7
    late = L / v + v / a + a / j - 1e-5  # 10 us before the end, in the last segment: j u^3 / 6 to go
    r, rdd = load("Profile").at(late, "r", "rdd", r_end=L, **limits(v, a, j))
    assert rdd == pytest.approx(-j * 1e-5, rel=1e-5)  # the time has 2 ps of rounding
    assert L - r == pytest.approx(j * 1e-15 / 6.0, abs=5e-12)  # r itself has 2e-12 of rounding
    r_middle = load("Profile").at(0.5 * (L / v + v / a + a / j), "r", r_end=L, **limits(v, a, j))[0]
    assert r_middle == pytest.approx(0.5 * L, rel=1e-15)


@PROPERTY
@given(place=st.floats(0.0, 5.0), dwell=st.floats(0.0, 0.5), way=st.sampled_from([-0.1, 0.1]))
@example(place=1.0, dwell=0.0, way=0.1)
def test_a_cyclic_motion_goes_back_and_repeats(load: Load, place: float, dwell: float, way: float) -> None:
    v, a, j = 0.25, 2.5, 50.0
    T = 0.1 / v + v / a + a / j
    leg = T + dwell
    time = place * leg
    number, local = int(place), (place - int(place)) * leg
    assume(abs(place - round(place)) > 1e-6 or dwell > 0.0)
    r, rd, rdd, _ = move(np.array([local]), way, v, a, j)[:, 0]
    expected = [r, rd, rdd] if number % 2 == 0 else [way - r, -rd, -rdd]
    start = {"r_end": way, "cyclic": True, "dwell": dwell, "t_start": 0.4}
    got = load("Profile").at(0.4 + time, "r", "rd", "rdd", **start)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * 50.0)
    if local > T + 1e-9 and dwell > local - T + 1e-9:
        assert got.tolist() == [way if number % 2 == 0 else 0.0, 0.0, 0.0]


def test_a_plan_changes_with_its_parameters(load: Load) -> None:
    profile = load("Profile").begin(0.0)
    profile.step_to(2.0)
    assert profile.get("r")[0] == 0.1
    profile.set(r_end=-0.2)
    assert profile.get("r")[0] == -0.2


@pytest.mark.parametrize("changed", [{"r_end": 0.3}, {"r_end": -0.1}, {"v_max": 0.2}, {"a_max": 2.0}, {"j_max": 30.0}])
def test_a_plan_changes_within_a_motion_and_back(load: Load, changed: dict[str, float]) -> None:
    usual = {"r_end": 0.1, "v_max": 0.25, "a_max": 2.5, "j_max": 50.0}
    profile = load("Profile").begin(0.0)
    for time, values in ((0.11, usual), (0.23, usual | changed), (0.31, usual | changed), (0.37, usual)):
        profile.set(**values)
        profile.step_to(time)
        expected = move(np.array([time]), *values.values())[:, 0]
        np.testing.assert_allclose(profile.get(*MOTION), expected, rtol=1e-12, atol=1e-14)


# ---- Sine ------------------------------------------------------------------------------------------------------


@PROPERTY
@given(
    amplitude=st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4),
    frequency=st.lists(st.floats(0.0, 50.0), min_size=4, max_size=4),
    phase=st.lists(st.floats(-7.0, 7.0), min_size=4, max_size=4),
    offset=st.floats(-1.0, 1.0),
)
def test_sines_are_rotating_phasors(
    load: Load, amplitude: list[float], frequency: list[float], phase: list[float], offset: float
) -> None:
    start = {"offset": offset}
    for k in range(4):
        start |= {f"amplitude[{k + 1}]": amplitude[k], f"frequency[{k + 1}]": frequency[k], f"phase[{k + 1}]": phase[k]}
    times = np.linspace(0.0, 3.0, 31)
    got = load("Sine").trace(times, "r", "rd", "rdd", **start)
    turn = 2j * np.pi * np.array(frequency)[:, None]
    phasors = np.array(amplitude)[:, None] * np.exp(turn * times + 1j * np.array(phase)[:, None])
    for order in range(3):
        expected = (turn**order * phasors).imag.sum(axis=0) + (offset if order == 0 else 0.0)
        scale = (np.abs(turn) ** order * np.abs(phasors)).sum() / times.size
        np.testing.assert_allclose(got[order], expected, rtol=0, atol=1e-11 * scale + 1e-15)


def test_the_default_sine_is_one_of_10_mm_at_1_hz(load: Load) -> None:
    got = load("Sine").at(0.25, "r", "rd", "rdd")
    np.testing.assert_allclose(got, [0.01, 0.0, -0.01 * (2.0 * np.pi) ** 2], rtol=1e-14, atol=1e-16)


# ---- Differentiator --------------------------------------------------------------------------------------------


def estimate(x: Array, Ts: float, window: int, tau: float) -> tuple[Array, Array]:
    """v and x_mean at the samples of x."""
    rested = np.concatenate([np.full(window, x[0]), x])
    mean = np.convolve(rested, np.full(window, 1.0 / window), mode="valid")  # from the sample before x[0] on
    d = np.diff(mean) / Ts
    decay = np.exp(-Ts / tau) if tau > 0.0 else 0.0
    return lfilter([1.0 - decay], [1.0, -decay], d), mean[1:]


@PROPERTY
@given(
    seed=st.integers(0, 1000),
    window=st.sampled_from([1, 2, 3, 7, 63, 64]),
    tau=st.sampled_from([0.0, 1e-6, 5e-3, 0.3]),
    Ts=st.sampled_from([1e-3, 1e-3 / 3.0, 0.7]),
)
def test_velocity_of_random_positions(load: Load, seed: int, window: int, tau: float, Ts: float) -> None:
    x = np.random.default_rng(seed).normal(size=150)
    block = load("Differentiator").begin(0.0, x=x[0], Ts=Ts, window=window, tau=tau)
    assert block.get("v", "x_mean") == pytest.approx([0.0, x[0]], rel=1e-14)
    got = []
    for k, value in enumerate(x):
        block.set(x=value)
        block.step_to((k + 1) * Ts)
        got.append(block.get("v", "x_mean"))
    v, mean = estimate(x, Ts, window, tau)
    np.testing.assert_allclose(np.array(got)[:, 0], v, rtol=0, atol=1e-13 * np.abs(v).max() + 1e-14 / Ts)
    np.testing.assert_allclose(np.array(got)[:, 1], mean, rtol=0, atol=1e-13)


@PROPERTY
@given(seed=st.integers(0, 1000), scale=st.sampled_from([0.13, 1.0 / 3.0, 1.0, 2.5, 40.0]))
def test_samples_fall_on_their_grid_whatever_the_steps(load: Load, seed: int, scale: float) -> None:
    Ts, window, tau = 1e-3, 3, 2e-3
    draw = np.random.default_rng(seed)
    steps = Ts * scale * (draw.uniform(0.5, 1.5, size=60) if seed % 2 else np.ones(60))
    ends = np.cumsum(steps)
    begins = np.concatenate([[0.0], ends[:-1]])
    x = draw.normal(size=60)
    # sample k takes the input of the step that it falls into; just at its end it belongs to the next one
    k = np.arange(int(np.ceil(ends[-1] / Ts - 1e-6)))
    holder = np.searchsorted(begins, k * Ts + 1e-6 * Ts, side="right") - 1
    v, mean = estimate(x[holder], Ts, window, tau)
    taken = np.ceil(ends / Ts - 1e-6).astype(int)  # samples in [0, end)

    block = load("Differentiator").begin(0.0, x=x[0], Ts=Ts, window=window, tau=tau)
    got = []
    for value, end in zip(x, ends, strict=True):
        block.set(x=value)
        block.step_to(float(end))
        got.append(block.get("v", "x_mean"))
    np.testing.assert_allclose(got, np.array([v, mean]).T[taken - 1], rtol=1e-9, atol=1e-9)


def test_window_2_is_the_estimate_of_the_emps_servo(load: Load) -> None:
    Ts, times = 1e-3, np.arange(200) * 1e-3
    q = 0.1 * np.sin(9.0 * times) + 1e-5 * np.cos(4e4 * times)
    qb = np.array([(q[k] + q[max(k - 1, 0)]) / 2.0 for k in range(q.size)])
    block = load("Differentiator").begin(0.0, x=q[0])
    for k, value in enumerate(q):
        block.set(x=value)
        block.step_to((k + 1) * Ts)
        v, mean = block.get("v", "x_mean")
        assert mean == pytest.approx(qb[k], abs=1e-16)
        assert v == pytest.approx((qb[k] - qb[k - 1]) / Ts if k else 0.0, abs=1e-11)


def test_a_ramp_has_its_slope_at_every_window(load: Load) -> None:
    for window in (1, 2, 5, 64):
        block = load("Differentiator").begin(0.0, x=0.0, window=window)
        x = block.variables["x"].valueReference
        block.fmu.setRealInputDerivatives([x], [1], [0.25])
        block.step_to(0.1)
        v, mean = block.get("v", "x_mean")
        assert v == pytest.approx(0.25, rel=1e-12)
        assert mean == pytest.approx(0.25 * (0.099 - (window - 1) / 2.0 * 1e-3), rel=1e-12)


def test_a_saved_state_holds_the_past_samples(load: Load) -> None:
    x = np.random.default_rng(4).normal(size=40)

    def rest_of_run(block: Block) -> list[list[float]]:
        out = []
        for k in range(20, 40):
            block.set(x=x[k])
            block.step_to((k + 1) * 1e-3)
            out.append(block.get("v", "x_mean").tolist())
        return out

    block = load("Differentiator").begin(0.0, x=x[0], window=9, tau=3e-3)
    for k in range(20):
        block.set(x=x[k])
        block.step_to((k + 1) * 1e-3)
    state = block.fmu.getFMUstate()
    first = rest_of_run(block)
    block.fmu.setFMUstate(state)
    block.time = 0.02
    assert rest_of_run(block) == first
    block.fmu.freeFMUstate(state)


# ---- Quantiser -------------------------------------------------------------------------------------------------


@PROPERTY
@given(halves=st.integers(-(2**40), 2**40), exponent=st.integers(-30, 10))
@example(halves=1, exponent=-1)
@example(halves=-1, exponent=-1)
@example(halves=5, exponent=0)
def test_halves_are_rounded_away_from_zero(load: Load, halves: int, exponent: int) -> None:
    q = 2.0**exponent  # a tie is exact only in binary fractions
    expected = float((Decimal(halves) / 2).quantize(Decimal(1), ROUND_HALF_UP))  # decimal's "half up" is away from zero
    assert load("Quantiser").at(0.0, "y", x=0.5 * halves * q, q=q)[0] == expected * q


@PROPERTY
@given(x=st.floats(-1e3, 1e3), q=logarithmic(1e-9, 10.0))
def test_the_nearest_multiple(load: Load, x: float, q: float) -> None:
    y = load("Quantiser").at(0.0, "y", x=x, q=q)[0]
    assert abs(y - x) <= 0.5 * q * (1.0 + 1e-12) + 1e-15 * abs(x)
    assert y / q == pytest.approx(round(y / q), rel=1e-15)
    assert load("Quantiser").at(0.0, "y", x=-x, q=q)[0] == -y


@PROPERTY
@given(x=st.floats(-1e300, 1e300))
def test_no_step_means_no_rounding(load: Load, x: float) -> None:
    assert load("Quantiser").at(0.0, "y", x=x, q=0.0)[0] == x


def test_the_quantiser_follows_a_moving_input(load: Load) -> None:
    block = load("Quantiser").begin(0.0, x=-1.0, q=0.25)
    block.fmu.setRealInputDerivatives([block.variables["x"].valueReference], [1], [2.2])
    block.step_to(1.0)
    assert block.get("y")[0] == 1.25


# ---- Sum, SampledSum -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Sum", "SampledSum"])
def test_each_signal_of_a_sum_has_its_gain(load: Load, name: str) -> None:
    """Decimal digits that do not mix: a wrong gain or sign shows in its own digit."""
    signals = {"u1": 1.0, "u2": 20.0, "u3": 300.0, "u4": 4000.0}
    gains = {"gain[1]": 1.0, "gain[2]": -2.0, "gain[3]": 3.0, "gain[4]": 0.5}
    assert load(name).at(0.0, "y", **signals, **gains)[0] == 1.0 - 40.0 + 900.0 + 2000.0


# ---- Record ----------------------------------------------------------------------------------------------------

COLUMNS = ("r", "rd", "rdd")


def default_series() -> Array:
    """The table of series.h, read as text."""
    text = (source_folder() / "signals" / "series.h").read_text(encoding="utf-8")
    rows = re.findall(r"^\s*\{([^{}]+)\},?$", text, re.M)
    return np.array([[float(number) for number in row.split(",")] for row in rows])


def interpolated(table: Array, times: Array) -> Array:
    outside = (times < table[0, 0]) | (times > table[-1, 0])
    values = np.array([np.interp(times, table[:, 0], column) for column in table.T[1:]])
    values[1:, outside] = 0.0
    return values


def test_the_default_record_is_a_motion() -> None:
    t, r, rd, rdd = default_series().T
    assert np.all(np.diff(t) > 0.0)
    # corners of rdd lie on rows, so the trapezoidal rule is exact up to the rounding of rdd at the corners
    np.testing.assert_allclose(np.diff(rd), np.diff(t) * (rdd[1:] + rdd[:-1]) / 2.0, atol=0.11 * 0.05)
    np.testing.assert_allclose(np.diff(r), np.diff(t) * (rd[1:] + rd[:-1]) / 2.0, atol=1e-12)


def test_the_default_record_is_a_triangle_with_rounded_corners() -> None:
    """At 20 mm/s, with 0.4 m/s2 at the corners, where a row has the mean of both sides."""
    t, r, rd, rdd = default_series().T
    corners, speeds = (0.0, 0.05, 0.45, 0.55, 0.95, 1.0), (0.0, 0.02, 0.02, -0.02, -0.02, 0.0)
    np.testing.assert_array_equal(t, np.arange(21) / 20.0)
    np.testing.assert_allclose(rd, np.interp(t, corners, speeds), atol=1e-15)
    np.testing.assert_allclose(r, np.append(0.0, np.cumsum(np.diff(t) * (rd[1:] + rd[:-1]) / 2.0)), atol=1e-15)
    slopes = np.repeat((0.4, 0.0, -0.4, 0.0, 0.4), (1, 8, 2, 8, 1))
    np.testing.assert_allclose(rdd, np.r_[0.4, (slopes[1:] + slopes[:-1]) / 2.0, 0.4], atol=1e-15)


def test_a_record_is_exact_at_its_samples(load: Load) -> None:
    for t, *row in default_series():
        for time in (t, np.nextafter(t, -1.0), np.nextafter(t, 2.0), t * (1.0 + 4e-16)):
            assert load("Record").at(float(time), *COLUMNS).tolist() == row


def test_a_record_holds_its_ends_at_rest(load: Load, tmp_path: Path) -> None:
    path = build_record([1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0], tmp_path, "TwoRows")
    record = load(path)
    expected = {
        -1.0: [3, 0, 0],
        0.999: [3, 0, 0],
        1.0: [3, 5, 7],
        1.5: [3.5, 5.5, 7.5],
        2.0: [4, 6, 8],
        2.001: [4, 0, 0],
    }
    for t, row in expected.items():
        assert record.at(t, *COLUMNS).tolist() == row
    np.testing.assert_array_equal(record.trace(list(expected), *COLUMNS).T, list(expected.values()))


def uneven(seed: int) -> Array:
    """A table with pauses, so that a guess from uniform sampling lies far off."""
    draw = np.random.default_rng(seed)
    gaps = 10.0 ** draw.uniform(-4.0, 1.0, size=300)
    return np.column_stack([np.cumsum(gaps) - 20.0, draw.normal(size=(300, 3))])


@pytest.mark.parametrize("kind", some(["default", "uniform", "uneven"], ["uneven"]))
def test_a_record_is_linear_between_its_samples(load: Load, tmp_path: Path, kind: str) -> None:
    if kind == "default":
        table, record = default_series(), load("Record")
    else:
        table = uneven(1)
        if kind == "uniform":
            table[:, 0] = 5.0 + np.arange(300) * 1e-3
        record = load(build_record(*table.T, tmp_path, f"Record_{kind}"))
    begin, end = table[0, 0], table[-1, 0]
    span = end - begin
    draw = np.random.default_rng(2)
    times = np.sort(
        np.concatenate(
            [
                draw.uniform(begin - 0.1 * span, end + 0.1 * span, 400),
                table[:, 0],
                draw.choice(table[:-1, 0], 100) + 1e-5,
            ]
        )
    )
    forwards = record.trace(np.unique(times), *COLUMNS)
    np.testing.assert_allclose(forwards, interpolated(table, np.unique(times)), rtol=0, atol=1e-9)
    backwards = np.array([record.at(float(t), *COLUMNS) for t in times[::-1]]).T
    np.testing.assert_allclose(backwards, interpolated(table, times[::-1]), rtol=0, atol=1e-9)


def test_simulate_fmu_plays_a_record(build_fmu: Callable[..., Path]) -> None:
    result = fmpy.simulate_fmu(
        str(build_fmu("Record")), stop_time=1.0, step_size=0.05, output_interval=0.05, output=list(COLUMNS)
    )
    np.testing.assert_allclose(np.array([list(row) for row in result]), default_series(), rtol=0, atol=1e-12)


# ---- SecondOrderFilter -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("f", "low", "band", "high"), [(40.0, 1.0, 0.0, 0.0), (120.0, 1.0, 0.05, 1.0), (7.0, 0.0, 1.0, 0.0)]
)
@pytest.mark.parametrize("zeta", [0.5, np.sqrt(0.5)])
def test_the_second_order_filter_is_the_prewarped_bilinear_transform(
    load: Load, f: float, low: float, band: float, high: float, zeta: float
) -> None:
    Ts, x = 1e-3, np.random.default_rng(5).normal(size=100)
    w = 2.0 / Ts * np.tan(np.pi * f * Ts)
    b, a = bilinear([high / w**2, 2.0 * zeta * band / w, low], [1.0 / w**2, 2.0 * zeta / w, 1.0], 1.0 / Ts)
    expected, _ = lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])
    block = load("SecondOrderFilter").begin(0.0, u=x[0], Ts=Ts, f=f, zeta=zeta, low=low, band=band, high=high)
    got = []
    for k, value in enumerate(x):
        block.set(u=value)
        block.step_to((k + 1) * Ts)
        got.append(float(block.get("y")[0]))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12)
    if low == 1.0 and high == 0.0 and zeta == np.sqrt(0.5):
        np.testing.assert_allclose((b, a), butter(2, f, fs=1.0 / Ts), atol=1e-12)


@pytest.mark.parametrize("f", [0.0, 500.0, 1e4])
def test_a_frequency_beyond_half_of_the_sample_rate_is_no_filter(load: Load, f: float) -> None:
    block = load("SecondOrderFilter").begin(0.0, u=3.0, Ts=1e-3, f=f)
    for k, value in enumerate((3.0, -2.0, 5.0)):
        block.set(u=value)
        block.step_to((k + 1) * 1e-3)
        assert block.get("y") == value
