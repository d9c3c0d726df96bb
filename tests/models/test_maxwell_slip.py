"""MaxwellSlip and GMS against closed forms, tables and scipy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from shell.instance import DISCARD, OK, Instance, Library, load
from thorough import few

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
velocity = st.one_of(st.floats(-5e-3, 5e-3), st.floats(-0.5, 0.5), st.sampled_from([0.0, 1e-9, -1e-9])).map(
    lambda v: round(v, 15)
)
held = st.lists(st.tuples(velocity, st.floats(1e-6, 0.02)), min_size=1, max_size=12)
ramps = st.lists(
    st.tuples(velocity, st.floats(-5.0, 5.0).map(lambda a: round(a, 9)), st.floats(1e-5, 0.02)), min_size=1, max_size=5
)
own = st.one_of(
    st.just({}), st.fixed_dictionaries({"Ci[1]": st.floats(1.0, 1e3), "Ci[3]": st.sampled_from([0.0, 300.0])})
)
loads = st.sampled_from([(1.0, 1.0), (3.0, 2.0), (0.25, 1.0), (0.0, 1.0), (-1.0, 1.0)])

B19 = ((5e4, 3e4, 1.5e4, 0.5e4), (0.25, 0.25, 0.3, 0.2))
LEVELS = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "C": 100.0}
SHARES = ((6e4, 3e4, 1e4), (0.5, 0.3, 0.2))


@pytest.fixture(scope="module")
def maxwell(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("MaxwellSlip"))


@pytest.fixture(scope="module")
def gms(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("GMS"))


def vector(**vectors: Sequence[float]) -> dict[str, float]:
    """k = (1, 2) -> k[1] = 1, k[2] = 2, and N = 2."""
    lengths = {len(values) for values in vectors.values()}
    elements = {f"{name}[{i}]": value for name, values in vectors.items() for i, value in enumerate(values, 1)}
    return elements | {"N": max(lengths)}


def forces(run: Instance, count: int) -> list[float]:
    return run.get(*(f"Fi[{i}]" for i in range(1, count + 1)))


def move(run: Instance, *distances: float, h: float = 1e-3) -> None:
    """Held velocities that cover these distances, one step each."""
    for distance in distances:
        run.set({"v": distance / h})
        run.step(run.get1("time"), h)


def pieces(v: float, slope: float, h: float) -> Iterator[tuple[float, float]]:
    """(v, duration) of the parts of a ramp without a change of sign."""
    zero = -v / slope if slope else math.inf
    if 0.0 < zero < h:
        yield v, zero
        yield 0.0, h - zero
    else:
        yield v, h


# ---- Maxwell slip


def element_paths(F: Sequence[float], k: Sequence[float], W: Sequence[float], dx: float) -> list[float]:
    """Each force after a monotone distance."""
    return [min(max(f + k_i * dx, -W_i), W_i) for f, k_i, W_i in zip(F, k, W, strict=True)]


def virgin(x: float, k: Sequence[float], W: Sequence[float]) -> float:
    return math.copysign(math.fsum(min(k_i * abs(x), W_i) for k_i, W_i in zip(k, W, strict=True)), x)


def test_b19_virgin_curve_masing_branches_and_loop_area(maxwell: Library) -> None:
    k, W = B19
    a, parts = 2e-5, 400
    with Instance(maxwell) as run:
        run.initialise(**vector(k=k, W=W))
        move(run, a)
        assert run.get1("F") == pytest.approx(0.9, rel=1e-12)
        assert run.get1("F") == pytest.approx(virgin(a, k, W), rel=1e-12)
        area, F_last = 0.0, run.get1("F")
        for way in (-1.0, 1.0):
            F_a, x_a = run.get1("F"), -way * a
            for j in range(1, parts + 1):
                move(run, way * 2.0 * a / parts)
                x = x_a + way * 2.0 * a * j / parts
                F = run.get1("F")
                assert pytest.approx(F_a - 2.0 * virgin((x_a - x) / 2.0, k, W), rel=1e-12, abs=1e-12) == F
                area += way * (F + F_last) * a / parts  # trapezia; the kinks lie on the grid
                F_last = F
        expected = sum(4.0 * W_i * max(a - W_i / k_i, 0.0) for k_i, W_i in zip(k, W, strict=True))
        assert expected == pytest.approx(2.66666667e-5, rel=1e-8)
        assert area == pytest.approx(expected, rel=1e-4)


def test_b19_the_loop_area_in_steps_that_end_at_the_kinks(maxwell: Library) -> None:
    k, W = B19
    a = 2e-5
    kinks = sorted({2.0 * W_i / k_i for k_i, W_i in zip(k, W, strict=True) if 2.0 * W_i / k_i < 2.0 * a})
    with Instance(maxwell) as run:
        run.initialise(**vector(k=k, W=W))
        move(run, a)
        area, F_last = 0.0, run.get1("F")
        for way in (-1.0, 1.0):
            for begin, end in itertools.pairwise([0.0, *kinks, 2.0 * a]):
                move(run, way * (end - begin))
                F = run.get1("F")
                area += way * (F + F_last) / 2.0 * (end - begin)
                F_last = F
    assert area == pytest.approx(sum(4.0 * W_i * max(a - W_i / k_i, 0.0) for k_i, W_i in zip(*B19, strict=True)), 1e-12)


def test_inner_loops_are_wiped_out(maxwell: Library) -> None:
    """A minor loop, whatever happened in it, leaves no trace once its first reversal point is passed."""
    k, W = B19
    draw = np.random.default_rng(1)
    for _ in range(20):
        with Instance(maxwell) as direct, Instance(maxwell) as looped:
            for run in (direct, looped):
                run.initialise(**vector(k=k, W=W))
                move(run, 1.5e-5, -1.1e-5)
            x = np.concatenate(([0.0], draw.uniform(0.0, 8e-6, 9), [0.0]))  # back up and down within the branch
            x[1] = 8e-6
            move(looped, *np.diff(x))
            assert looped.get1("F") == pytest.approx(direct.get1("F"), rel=1e-12), "return-point memory"
            for run in (direct, looped):
                move(run, -3e-6)
            assert forces(looped, 4) == pytest.approx(forces(direct, 4), rel=1e-11, abs=1e-14)


@reproducibly
@given(steps=held, normal=loads)
def test_held_velocities_are_exact(maxwell: Library, steps: list[tuple[float, float]], normal: tuple[float, float]):
    k, W = B19
    F = [0.0] * 4
    with Instance(maxwell) as run:
        run.initialise(Fn=normal[0], Fn0=normal[1], **vector(k=k, W=W))
        for v, h in steps:
            run.set({"v": v})
            run.step(run.get1("time"), h)
            F = element_paths(F, k, W, v * h)
            assert forces(run, 4) == pytest.approx(F, rel=1e-12, abs=1e-15)
            assert run.get1("F") == pytest.approx(max(normal[0], 0.0) / normal[1] * sum(F), rel=1e-12, abs=1e-14)


@reproducibly
@given(steps=ramps)
def test_linear_velocities_are_exact_through_their_reversal(maxwell: Library, steps: list[tuple[float, float, float]]):
    k, W = B19
    F = [0.0] * 4
    with Instance(maxwell) as run:
        run.initialise(**vector(k=k, W=W))
        for v, slope, h in steps:
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(run.get1("time"), h)
            for v_0, duration in pieces(v, slope, h):
                F = element_paths(F, k, W, v_0 * duration + slope * duration**2 / 2.0)
            assert forces(run, 4) == pytest.approx(F, rel=1e-9, abs=1e-10)


@reproducibly
@given(steps=held, cuts=st.integers(1, 9))
def test_maxwell_is_odd_bounded_dissipative_rate_independent_and_may_be_cut(
    maxwell: Library, steps: list[tuple[float, float]], cuts: int
) -> None:
    k, W = B19
    with Instance(maxwell) as run, Instance(maxwell) as mirror, Instance(maxwell) as slow, Instance(maxwell) as cut:
        for each in (run, mirror, slow, cut):
            each.initialise(**vector(k=k, W=W))
        for v, h in steps:
            stored = [sum(f * f / (2.0 * k_i) for f, k_i in zip(forces(run, 4), k, strict=True))]
            before = forces(run, 4)
            for each, speed, duration in ((run, v, h), (mirror, -v, h), (slow, v / 8.0, 8.0 * h)):
                each.set({"v": speed})
                each.step(each.get1("time"), duration)
            cut.set({"v": v})
            for _ in range(cuts):
                cut.step(cut.get1("time"), h / cuts)
            F = run.get1("F")
            assert mirror.get1("F") == -F
            assert slow.get1("F") == F
            assert cut.get1("F") == pytest.approx(F, rel=1e-12, abs=1e-13)
            assert abs(F) <= sum(W)
            # work done on the elements, each a straight line and then a constant
            work = 0.0
            for f_0, f_1, k_i in zip(before, forces(run, 4), k, strict=True):
                elastic = (f_1 - f_0) / k_i
                work += (f_0 + f_1) / 2.0 * elastic + f_1 * (v * h - elastic)
            stored.append(sum(f * f / (2.0 * k_i) for f, k_i in zip(forces(run, 4), k, strict=True)))
            assert work - (stored[1] - stored[0]) >= -1e-16 - 1e-12 * abs(work)


def test_an_initial_force_beyond_the_limit_counts_as_the_limit(maxwell: Library) -> None:
    k, W = B19
    with Instance(maxwell) as run:
        run.initialise(**vector(k=k, W=W), **{"Fi[1]": 7.0, "Fi[2]": -0.1, "Fi[7]": 3.0})
        assert run.get1("F") == pytest.approx(0.25 - 0.1, rel=1e-15)
        run.step(0.0, 1.0)
        assert run.get("Fi[1]", "Fi[2]") == [0.25, -0.1]


def test_parameters_at_their_limits_give_numbers(maxwell: Library, gms: Library) -> None:
    with Instance(maxwell) as run:
        run.initialise(**vector(k=[0.0] * 10, W=[0.0] * 10), v=1e-3)
        run.step(0.0, 0.1)
        assert run.get("F", "slipping[1]") == [0.0, 1.0]
    limits: tuple[dict[str, float], ...] = (
        {"Fc": 1e-9, "Fs": 1e-9},
        {"Fs": 0.2},
        {"Fs": 1.0},
        {"vs": 1e-12},
        {"delta": 1e-3},
        {"delta": 100.0},
        {"C": 0.0},
        {"C": 1e15},
        vector(k=[0.0] * 10),
        vector(alpha=[0.0] * 10),
        {"sigma": 10.0, "k[1]": 0.0},
    )
    for p, slope in itertools.product(limits, (0.0, 0.2, -0.2)):
        with Instance(gms) as run:
            run.initialise(**p)
            for k, v in enumerate((1e-3, 0.0, -2e-3, -2e-3, 1e-3)):
                run.set({"v": v})
                assert run.input_derivatives({"v": slope}) == OK
                run.step(0.01 * k, 0.01)
                assert math.isfinite(run.get1("F")), p
    with Instance(gms) as run:
        assert run.try_set({"N": 0}) == [DISCARD]
        assert run.try_set({"N": 11}) == [DISCARD]


# ---- GMS


def level(v: float, p: dict[str, float]) -> float:
    return p["Fc"] + (p["Fs"] - p["Fc"]) * math.exp(-((abs(v) / p["vs"]) ** p["delta"]))


class Elements:
    """The GMS model, each element by itself: closed forms for constant v, scipy for a linear one."""

    def __init__(self, k: Sequence[float], alpha: Sequence[float], p: dict[str, float]) -> None:
        self.k, self.p = k, p
        self.alpha = [a / sum(alpha) for a in alpha]
        self.C = [p.get(f"Ci[{i}]", p["C"]) for i in range(1, len(k) + 1)]
        self.F = [0.0] * len(k)
        self.slips = [False] * len(k)
        self.way = 0.0

    def step(self, v: float, slope: float, h: float) -> None:
        for v_0, duration in pieces(v, slope, h):
            middle = v_0 + slope * duration / 2.0
            way = float(np.sign(middle))
            if way != self.way:
                self.slips = [False] * len(self.k)
            self.way = way or self.way
            if way:
                for i in range(len(self.k)):
                    self._element(i, way, abs(v_0), way * slope, duration)

    def _element(self, i: int, way: float, speed: float, slope: float, h: float) -> None:
        """In the direction of motion, in which the speed is positive."""
        G, k, a, C, p = way * self.F[i], self.k[i], self.alpha[i], self.C[i], self.p

        def S(t: float) -> float:
            return level(speed + slope * t, p)

        def stuck(t: float) -> float:
            return G + k * (speed + slope * t / 2.0) * t

        start = 0.0
        if not self.slips[i] and stuck(0.0) < a * S(0.0):
            t = np.linspace(0.0, h, 3001)
            w = speed + slope * t
            S_at = p["Fc"] + (p["Fs"] - p["Fc"]) * np.exp(-((np.abs(w) / p["vs"]) ** p["delta"]))
            behind = 1 + np.flatnonzero((G + k * (speed + slope * t / 2.0) * t - a * S_at)[1:] >= 0.0)
            if not behind.size:
                self.F[i] = way * stuck(h)
                return
            start = brentq(lambda s: stuck(s) - a * S(s), t[behind[0] - 1], t[behind[0]], xtol=1e-18, rtol=1e-15)
            G = a * S(start)
        self.slips[i] = True
        if slope == 0.0:
            self.F[i] = way * (a * S(0.0) + (G - a * S(0.0)) * math.exp(-C * (h - start) / S(0.0)))
            return
        span = min(h - start, 0.3 * p["vs"] / abs(slope))
        result = solve_ivp(
            lambda t, y: [C * (a - y[0] / S(t))],
            (start, h),
            [G],
            method="Radau" if C * h > 50.0 * p["Fc"] else "DOP853",
            rtol=1e-10,
            atol=1e-12,
            max_step=max(span, (h - start) / 1000.0),
        )
        assert result.success
        self.F[i] = way * float(result.y[0, -1])


def test_b20_frictional_lag_of_one_element(gms: Library) -> None:
    """C = 1e-3 m/s in the deflection form is k times as much, over alpha, in the force form."""
    p = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3, "delta": 2.0, "sigma2": 0.0, "C": 1e-3 * 1e5}
    tabulated = {0.0: 1.38940039, 5e-3: 1.23618328, 0.01: 1.1432524, 0.02: 1.05269961, 0.1: 1.00001768}
    slow, fast = level(5e-4, p), level(5e-3, p)
    for t, expected in tabulated.items():
        with Instance(gms) as run:
            run.initialise(v=5e-4, N=1, **{"k[1]": 1e5, "alpha[1]": 1.0}, **p)
            run.step(0.0, 0.1)
            run.set({"v": 5e-3})
            if t > 0.0:
                run.step(0.1, t)
            assert run.get1("F") == pytest.approx(expected, abs=1e-8)
            assert run.get1("F") == pytest.approx(fast + (slow - fast) * math.exp(-100.0 * t / fast), rel=1e-12)


def test_each_element_has_an_attraction_of_its_own(gms: Library) -> None:
    """(1.23) of the study, dz/dt = ci (1 - zi/si), after a jump of the velocity: zi relaxes to si at the rate ci/si."""
    k, alpha = SHARES
    c = (1e-3, 2e-4, 5e-3)
    slow, fast = level(5e-4, LEVELS), level(5e-3, LEVELS)
    given = {f"Ci[{i}]": c_i * k_i / a for i, (c_i, k_i, a) in enumerate(zip(c, k, alpha, strict=True), 1)}
    for t in (1e-4, 5e-3, 0.02):
        with Instance(gms) as run:
            run.initialise(v=5e-4, **vector(k=k, alpha=alpha), **LEVELS, **given)
            run.step(0.0, 60.0)
            run.set({"v": 5e-3})
            run.step(60.0, t)
            z = [
                a / k_i * (fast + (slow - fast) * math.exp(-t * c_i / (a * fast / k_i)))
                for k_i, a, c_i in zip(k, alpha, c, strict=True)
            ]
            assert forces(run, 3) == pytest.approx([k_i * z_i for k_i, z_i in zip(k, z, strict=True)], rel=1e-12)


def test_an_attraction_that_is_not_given_is_the_common_one(gms: Library) -> None:
    """Negative: C, to the last bit; 0 is no attraction at all."""
    for slope in (0.0, 3.0):
        with Instance(gms) as common, Instance(gms) as named, Instance(gms) as none:
            common.initialise(C=37.0)
            named.initialise(C=5.0, **{f"Ci[{i}]": 37.0 for i in range(1, 11)})
            none.initialise(C=37.0, **{"Ci[2]": 0.0})
            for j, v in enumerate((5e-4, 5e-3, 5e-3, -1e-3, -8e-3)):
                for run in (common, named, none):
                    run.set({"v": v})
                    assert run.input_derivatives({"v": slope * v}) == OK
                    run.step(0.1 * j, 0.1)
                assert forces(named, 10) == forces(common, 10)
                assert named.get1("F") == common.get1("F")
                assert [forces(none, 10)[i] for i in (0, 2, 9)] == [forces(common, 10)[i] for i in (0, 2, 9)]
            assert none.get1("Fi[2]") != common.get1("Fi[2]")
    assert [gms.start(name) for name in ("C", "Ci[1]", "Ci[10]")] == [100.0, -1.0, -1.0]


@reproducibly
@given(
    steps=held,
    Fs=st.floats(0.5, 3.0),
    C=st.sampled_from([0.0, 1.0, 100.0, 1e4]),
    delta=st.sampled_from([0.5, 1.0, 2.0]),
    own=own,
)
def test_gms_at_held_velocities_is_exact(
    gms: Library, steps: list[tuple[float, float]], Fs: float, C: float, delta: float, own: dict[str, float]
) -> None:
    p = LEVELS | {"Fs": Fs, "C": C, "delta": delta} | own
    oracle = Elements(*SHARES, p)
    with Instance(gms) as run:
        run.initialise(**vector(k=SHARES[0], alpha=SHARES[1]), **p)
        for v, h in steps:
            run.set({"v": v})
            run.step(run.get1("time"), h)
            oracle.step(v, 0.0, h)
            assert forces(run, 3) == pytest.approx(oracle.F, rel=1e-11, abs=1e-11)
            assert run.get1("F") == pytest.approx(sum(oracle.F) + 0.4 * v, rel=1e-10, abs=1e-11)
            flags = [s and v != 0.0 for s in oracle.slips]
            assert run.get("slipping[1]", "slipping[2]", "slipping[3]") == [float(flag) for flag in flags]


@settings(reproducibly, max_examples=few(80))
@given(
    steps=ramps,
    Fs=st.floats(0.5, 3.0),
    C=st.sampled_from([1.0, 100.0, 1e3]),
    delta=st.sampled_from([1.0, 2.0]),
    own=own,
)
def test_gms_at_linear_velocities_agrees_with_scipy(
    gms: Library, steps: list[tuple[float, float, float]], Fs: float, C: float, delta: float, own: dict[str, float]
) -> None:
    p = LEVELS | {"Fs": Fs, "C": C, "delta": delta, "vs": 5e-3} | own
    oracle = Elements(*SHARES, p)
    with Instance(gms) as run:
        run.initialise(**vector(k=SHARES[0], alpha=SHARES[1]), **p)
        for v, slope, h in steps:
            run.set({"v": v})
            assert run.input_derivatives({"v": slope}) == OK
            run.step(run.get1("time"), h)
            oracle.step(v, slope, h)
            assert forces(run, 3) == pytest.approx(oracle.F, abs=1e-8 * max(Fs, 1.0))


@reproducibly
@given(steps=ramps, cuts=st.integers(2, 7))
def test_how_a_span_is_cut_does_not_matter(gms: Library, steps: list[tuple[float, float, float]], cuts: int) -> None:
    with Instance(gms) as whole, Instance(gms) as cut:
        for run in (whole, cut):
            run.initialise()
        for v, slope, h in steps:
            t = whole.get1("time")
            whole.set({"v": v})
            assert whole.input_derivatives({"v": slope}) == OK
            whole.step(t, h)
            for j in range(cuts):
                cut.set({"v": v + slope * h * j / cuts})
                assert cut.input_derivatives({"v": slope}) == OK
                cut.step(t + h * j / cuts, h / cuts)
            assert forces(cut, 10) == pytest.approx(forces(whole, 10), abs=1e-9)


@reproducibly
@given(steps=held, normal=loads)
def test_gms_is_odd_bounded_and_scales_with_the_normal_force(
    gms: Library, steps: list[tuple[float, float]], normal: tuple[float, float]
) -> None:
    with Instance(gms) as run, Instance(gms) as mirror, Instance(gms) as loaded:
        for each in (run, mirror):
            each.initialise()
        loaded.initialise(Fn=normal[0], Fn0=normal[1])
        for v, h in steps:
            for each, speed in ((run, v), (mirror, -v), (loaded, v)):
                each.set({"v": speed})
                each.step(each.get1("time"), h)
            F = run.get1("F")
            assert mirror.get1("F") == -F
            assert abs(F - 0.4 * v) <= 1.5 * (1.0 + 1e-12)
            expected = max(normal[0], 0.0) / normal[1] * (F - 0.4 * v) + 0.4 * v
            assert loaded.get1("F") == pytest.approx(expected, rel=1e-12, abs=1e-12)


@reproducibly
@given(steps=held, slopes=st.booleans())
def test_b17_gms_with_a_constant_level_is_maxwell_slip(
    gms: Library, maxwell: Library, steps: list[tuple[float, float]], slopes: bool
) -> None:
    k, alpha = SHARES
    level_of_all = 1.2
    with Instance(gms) as one, Instance(maxwell) as other:
        one.initialise(sigma2=0.0, Fc=level_of_all, Fs=level_of_all, **vector(k=k, alpha=alpha))
        other.initialise(**vector(k=k, W=[level_of_all * a for a in alpha]))
        for v, h in steps:
            for run in (one, other):
                run.set({"v": v})
                if slopes:
                    assert run.input_derivatives({"v": -1.5 * v / h}) == OK
                run.step(run.get1("time"), h)
            assert one.get1("F") == pytest.approx(other.get1("F"), abs=1e-9)


@reproducibly
@given(steps=held)
def test_b17_dahl_with_n_zero_is_one_element(
    build_fmu: Callable[..., Path], maxwell: Library, steps: list[tuple[float, float]]
) -> None:
    with Instance(load(build_fmu("Dahl"))) as dahl, Instance(maxwell) as run:
        dahl.initialise(n=0.0, sigma=1e5, Fc=1.0)
        run.initialise(**vector(k=[1e5], W=[1.0]))
        for v, h in steps:
            for each in (dahl, run):
                each.set({"v": v})
                each.step(each.get1("time"), h)
            assert dahl.get1("F") == pytest.approx(run.get1("F"), abs=1e-11)


def test_attraction_and_slip_test_are_signed(gms: Library) -> None:
    """An element above the level for v < 0 is attracted, and one that is unloaded from above the level sticks."""
    p = LEVELS | {"sigma2": 0.0}
    one = {"k[1]": 1e5, "alpha[1]": 1.0, "N": 1}
    for way in (1.0, -1.0):
        with Instance(gms) as run:
            run.initialise(v=way * 0.1, **{"Fi[1]": way * 1.4}, **one, **p)
            run.step(0.0, 1.0)
            assert run.get1("F") == pytest.approx(way, rel=1e-9)
        with Instance(gms) as run:
            run.initialise(v=-way * 0.1, **{"Fi[1]": way * 1.4}, **one, **p)  # |F| > S = 1, but unloading
            assert run.get("slipping[1]", "der(Fi[1])") == [0.0, -way * 1e4]
            run.step(0.0, 5e-5)
            assert run.get1("F") == pytest.approx(way * (1.4 - 0.5), rel=1e-12)


def test_slip_lasts_until_the_velocity_passes_zero(gms: Library) -> None:
    """Sliding slows down: S rises above the force, but the element goes on slipping; a hold makes it stick."""
    p = LEVELS | {"sigma2": 0.0, "C": 10.0}
    one = {"k[1]": 1e5, "alpha[1]": 1.0, "N": 1}
    with Instance(gms) as run:
        run.initialise(v=0.1, **one, **p)
        run.step(0.0, 1.0)
        run.set({"v": 1e-4})
        assert run.get("slipping[1]", "F") == pytest.approx([1.0, 1.0], rel=1e-9)
        run.step(1.0, 1e-3)
        S = level(1e-4, p)
        expected = S + (1.0 - S) * math.exp(-10.0 * 1e-3 / S)
        assert run.get1("F") == pytest.approx(expected, rel=1e-9)
        for v in (0.0, 1e-4):
            run.set({"v": v})
            run.step(run.get1("time"), 1e-4)
            assert run.get1("slipping[1]") == 0.0
        assert run.get1("F") == pytest.approx(expected + 1e5 * 1e-8, rel=1e-9)


@pytest.mark.parametrize("h", [1e-3, 3.3e-4, 0.0123])
def test_a_ramp_to_zero_and_up_again_only_touches_zero(gms: Library, h: float) -> None:
    """Whatever the rounding of v / slope: the element goes on slipping, with C = 0 at the force it had."""
    draw = np.random.default_rng(7)
    for v in draw.uniform(1e-4, 1e-2, 40):
        with Instance(gms) as run:
            run.initialise(v=0.1, N=1, C=0.0, **{"k[1]": 1e5, "alpha[1]": 1.0})
            run.step(0.0, 1.0)
            force = run.get1("Fi[1]")
            for begin, slope in ((v, -v / h), (0.0, v / h)):
                run.set({"v": begin})
                assert run.input_derivatives({"v": slope}) == OK
                run.step(run.get1("time"), h)
            assert run.get("Fi[1]", "slipping[1]") == [force, 1.0], v


def test_element_damping_acts_with_the_rate_of_deflection(gms: Library) -> None:
    p = LEVELS | {"sigma": 50.0, "sigma2": 0.4}
    k, alpha = SHARES
    with Instance(gms) as run:
        run.initialise(v=2e-3, Fn=2.0, **vector(k=k, alpha=alpha), **p)
        assert run.get1("F") == pytest.approx(2.0 * 3 * 50.0 * 2e-3 + 0.4 * 2e-3, rel=1e-12)
        run.step(0.0, 0.1)  # all slip, at rest on the level
        S = level(2e-3, p)
        assert run.get1("F") == pytest.approx(2.0 * S + 0.4 * 2e-3, rel=1e-12)
        run.set({"v": 5e-3})
        S_new = level(5e-3, p)
        rate = sum(100.0 * a * (1.0 - S / S_new) / k_i for k_i, a in zip(k, alpha, strict=True))
        assert run.get1("F") == pytest.approx(2.0 * (S + 50.0 * rate) + 0.4 * 5e-3, rel=1e-11)


def test_shares_are_normalised(gms: Library) -> None:
    with Instance(gms) as one, Instance(gms) as other:
        one.initialise(v=0.05, **vector(k=SHARES[0], alpha=SHARES[1]))
        other.initialise(v=0.05, **vector(k=SHARES[0], alpha=[7.0 * a for a in SHARES[1]]))
        for run in (one, other):
            run.step(0.0, 1.0)
        assert other.get1("F") == pytest.approx(one.get1("F"), rel=1e-14)
        assert one.get1("F") == pytest.approx(level(0.05, LEVELS) + 0.4 * 0.05, rel=1e-12)


def test_gms_does_not_drift_under_a_bias_with_vibration(gms: Library) -> None:
    """A cycle of the position within presliding brings the force back after the first one."""
    with Instance(gms) as run:
        run.initialise()
        move(run, 4e-6)
        seen = []
        for _ in range(5):
            move(run, 2e-6, -2e-6)
            seen.append(run.get1("F"))
        assert seen == pytest.approx([seen[0]] * 5, rel=1e-12)


@reproducibly
@given(steps=held)
def test_gms_takes_energy_out_over_a_closed_path(gms: Library, steps: list[tuple[float, float]]) -> None:
    """Work at least the change of what the springs hold, in steps so fine that the force is a line in each."""
    k, alpha = SHARES
    with Instance(gms) as run:
        run.initialise(sigma2=0.0, **vector(k=k, alpha=alpha), **LEVELS)
        work = 0.0
        for v, h in steps:
            run.set({"v": v})
            parts = 50
            for _ in range(parts):
                F = run.get1("F")
                run.step(run.get1("time"), h / parts)
                work += (F + run.get1("F")) / 2.0 * v * h / parts
            stored = sum(f * f / (2.0 * k_i) for f, k_i in zip(forces(run, 3), k, strict=True))
            slack = sum(abs(v) * h for v, h in steps) * 1.5 / parts
            assert work >= stored - slack
