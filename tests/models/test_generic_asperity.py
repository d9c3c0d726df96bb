"""GenericAsperity in its four limits, and single asperities against scipy phase by phase."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from shell.instance import DISCARD, OK, Instance, Library, load
from thorough import few, some

reproducibly = settings(max_examples=few(60), deadline=20_000, derandomize=True, database=None)
K_N, K_T, K_H, M, HEIGHT, A, WAVELENGTH, MU0 = 2e5, 5e3, 2e3, 1e-7, 1e-6, 2.5e-7, 1e-5, 0.25
KAPPA = 2.0 * math.pi / WAVELENGTH
PLAIN = {"dmu": 0.0, "creep": 0.0}
FLAT = {"A": 0.0}
EQUAL = {"height_spread": 0.0, "position_spread": 0.0, "wavelength_spread": 0.0}
moves = st.lists(
    st.tuples(st.one_of(st.floats(-2e-2, 2e-2), st.sampled_from([0.0, 1e-9, -3e-6, 1.0])), st.floats(1e-6, 0.02)),
    min_size=1,
    max_size=6,
)


@pytest.fixture(scope="module")
def asperities(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("GenericAsperity"))


def steps(run: Instance, trajectory: Sequence[tuple[float, float]]) -> float:
    """Hold each velocity for its time; the time at the end."""
    t = run.get1("time")
    for v, h in trajectory:
        run.set({"v": v})
        run.step(t, h)
        t = t + h
    return t


def mean_force(library: Library, v: float, distance: float, samples: int = 2000, **values: float) -> float:
    """Mean of F while sliding over a distance, after as much of running in."""
    with Instance(library) as run:
        run.initialise(v=v, **values)
        h = distance / v
        run.step(0.0, h)
        t, total = h, 0.0
        for _ in range(samples):
            run.step(t, h / samples)
            t = t + h / samples
            total += run.get1("F")
        return total / samples


# ---- (i) flat and without aging: Maxwell slip


@reproducibly
@given(trajectory=moves, height=st.floats(1e-8, 1e-5), k_t=st.floats(1e2, 1e6), mu0=st.floats(0.0, 2.0))
def test_equal_asperities_on_flat_ground_are_a_maxwell_element(
    asperities: Library, trajectory: list[tuple[float, float]], height: float, k_t: float, mu0: float
) -> None:
    W, z = 20 * mu0 * K_N * height, 0.0
    with Instance(asperities) as run:
        run.initialise(height=height, k_t=k_t, mu0=mu0, height_spread=0.0, **FLAT, **PLAIN)
        for v, h in trajectory:
            steps(run, [(v, h)])
            z = min(max(z + v * h, -W / (20 * k_t)), W / (20 * k_t))
            assert run.get1("F") == pytest.approx(20 * k_t * z, rel=1e-11, abs=1e-13 * W)


def heights(library: Library, n: int, **values: float) -> list[float]:
    """The heights of a flat population, read one by one: F_N = k_n h where the others are known."""
    sums = [0.0]
    for k in range(1, n + 1):
        with Instance(library) as run:
            run.initialise(N=k, **FLAT, **values)
            sums.append(run.get1("F_N") / K_N)
    return list(np.diff(sums))


@reproducibly
@given(trajectory=moves, seed=st.integers(0, 100), m=st.floats(1e-15, 1.0))
def test_a_population_on_flat_ground_is_maxwell_slip_for_any_mass_of_the_tips(
    asperities: Library, trajectory: list[tuple[float, float]], seed: int, m: float
) -> None:
    n = 7
    W = MU0 * K_N * np.array(heights(asperities, n, seed=seed))
    assert np.all((0.5 * MU0 * K_N * HEIGHT <= W) & (1.5 * MU0 * K_N * HEIGHT >= W))
    F = np.zeros(n)
    with Instance(asperities) as run:
        run.initialise(N=n, seed=seed, m=m, **FLAT, **PLAIN)
        for v, h in trajectory:
            steps(run, [(v, h)])
            F = np.clip(F + K_T * v * h, -W, W)
            assert run.get1("F") == pytest.approx(float(F.sum()), rel=1e-11, abs=1e-12)


def test_reversal_points_are_remembered(asperities: Library) -> None:
    """An inner loop that closes leaves no trace; the branch after a reversal is the virgin curve, doubled."""
    flat = FLAT | PLAIN
    with Instance(asperities) as run, Instance(asperities) as virgin:
        run.initialise(N=100, **flat)
        virgin.initialise(N=100, **flat)
        steps(run, [(1e-3, 9e-3)])
        top = run.get1("F")
        steps(run, [(-1e-3, 4e-3), (1e-3, 4e-3)])
        assert run.get1("F") == pytest.approx(top, rel=1e-12)
        for _ in range(8):
            steps(run, [(-1e-3, 1e-3)])
            steps(virgin, [(1e-3, 0.5e-3)])
            assert run.get1("F") == pytest.approx(top - 2.0 * virgin.get1("F"), rel=1e-11, abs=1e-12)


# ---- (ii) aging at rest


@pytest.mark.parametrize("creep", [0.02, 0.1])
def test_break_away_grows_with_the_logarithm_of_the_time_at_rest(asperities: Library, creep: float) -> None:
    """Peak over kinetic friction is 1 + creep ln(1 + t/t0), less what the reload ages on."""
    W, v = 20 * MU0 * K_N * HEIGHT, 1.0
    flat = {"height_spread": 0.0, "dmu": 0.0, "creep": creep} | FLAT
    for t in (1e-3, 0.1, 10.0, 1e3, 1e5):
        with Instance(asperities) as run:
            run.initialise(v=v, **flat)
            run.step(0.0, 1.0)
            assert run.get1("F") == pytest.approx(W, rel=1e-12), "sliding bonds are new"
            now = steps(run, [(0.0, t)])
            assert run.get("F", "F_max") == pytest.approx([W, W * (1.0 + creep * math.log1p(t / 1e-3))], rel=1e-12)

            def excess(s: float, age: float = t) -> float:
                return W + 20 * K_T * v * s - W * (1.0 + creep * math.log1p((age + s) / 1e-3))

            breaks = brentq(excess, 0.0, 1e-4, xtol=1e-18, rtol=1e-14)
            run.set({"v": v})
            run.step(now, breaks * (1.0 - 1e-9))
            peak = W + 20 * K_T * v * breaks
            assert run.get("F", "stuck") == pytest.approx([peak, 20.0], rel=1e-8)
            run.step(now + breaks * (1.0 - 1e-9), breaks * 2e-9)
            assert run.get("F", "slipping") == pytest.approx([W, 20.0], rel=1e-8)


def test_young_bonds_that_spread_fast_break_when_the_spring_reaches_them(asperities: Library) -> None:
    """Friction bends most where both effects of age are strong: bonds of the age tau, with an area grown twentyfold."""
    mu0, dmu, tau, creep, t0, age = 1e-3, 0.1, 0.1, 1.0, 1e-9, 0.1
    normal = 20 * K_N * HEIGHT
    v = 20.0 * normal / (20 * K_T)

    def overload(s: float) -> float:
        bond = (mu0 + dmu * -math.expm1(-(age + s) / tau)) * (1.0 + creep * math.log1p((age + s) / t0))
        return mu0 + 20.0 * s - bond

    breaks = brentq(overload, 1e-3, 1.0, xtol=1e-16, rtol=1e-14)
    with Instance(asperities) as run:
        run.initialise(v=v, height_spread=0.0, mu0=mu0, dmu=dmu, tau=tau, creep=creep, t0=t0, **FLAT)
        run.step(0.0, 1.0)
        now = steps(run, [(0.0, age)])
        state = run.serialised()
        run.set({"v": v})
        run.step(now, breaks * (1.0 - 1e-9))
        assert run.get("F", "stuck") == pytest.approx([normal * (mu0 + 20.0 * breaks), 20.0], rel=1e-8)
        run.restore(state)
        run.set({"v": v})
        run.step(now, breaks * (1.0 + 1e-9))
        assert run.get("F", "slipping") == pytest.approx([normal * mu0, 20.0], rel=1e-8)


def test_adhesion_saturates(asperities: Library) -> None:
    with Instance(asperities) as run:
        run.initialise(age0=0.0, creep=0.0, **FLAT, **EQUAL)
        for t in (0.0, 0.05, 0.2, 1.0, 20.0):
            if t > 0.0:
                steps(run, [(0.0, t - run.get1("time"))])
            mu = 0.25 + 0.1 * (1.0 - math.exp(-t / 0.1))
            assert run.get("F_max", "F_N") == pytest.approx([4.0 * mu, 4.0], rel=1e-12)
    with Instance(asperities) as run:
        run.initialise(age0=0.3, **FLAT, **EQUAL)
        mu = 0.25 + 0.1 * (1.0 - math.exp(-3.0))
        assert run.get1("F_max") == pytest.approx(4.0 * mu * (1.0 + 0.02 * math.log1p(300.0)), rel=1e-12)


@pytest.mark.parametrize("tau", [0.1, 10.0])
def test_springs_break_bonds_whose_adhesion_still_grows(asperities: Library, tau: float) -> None:
    """At the time at which k_t v t = k_n h (mu0 + dmu (1 - exp(-t/tau))), whatever the steps."""
    v = K_N * HEIGHT * (MU0 + 0.5) / K_T / tau
    values = {"age0": 0.0, "creep": 0.0, "dmu": 1.0, "tau": tau, "v": v} | FLAT | EQUAL

    def excess(t: float) -> float:
        return K_T * v * t - K_N * HEIGHT * (MU0 - math.expm1(-t / tau))

    breaks = brentq(excess, 1e-3 * tau, 10.0 * tau, xtol=1e-18, rtol=1e-14)
    for after in (1e-9, 1e-2):
        with Instance(asperities) as run:
            run.initialise(**values)
            run.step(0.0, breaks * (1.0 - 1e-9))
            assert run.get("F", "stuck") == pytest.approx([20 * K_T * v * breaks, 20.0], rel=1e-8)
        with Instance(asperities) as run:
            run.initialise(**values)
            run.step(0.0, breaks * (1.0 + after))
            assert run.get("F", "slipping") == pytest.approx([20 * MU0 * K_N * HEIGHT, 20.0], rel=1e-8)


# ---- (iii) speed


def test_friction_falls_with_speed_on_a_rough_profile(asperities: Library) -> None:
    means = [mean_force(asperities, v, 4e-4, N=100) for v in (1e-6, 1e-4, 1e-2, 0.1, 1.0)]
    assert all(b < 0.98 * a for a, b in itertools.pairwise(means)), means
    assert means[0] == pytest.approx(5.2, rel=0.1)


def test_without_aging_slow_sliding_does_not_depend_on_the_speed(asperities: Library) -> None:
    slow = {"N": 50, "m": 1e-15} | PLAIN
    one, other = (mean_force(asperities, v, 2e-4, **slow) for v in (1e-5, 1e-3))
    assert one == pytest.approx(other, rel=1e-3)


def test_friction_lags_behind_the_speed(asperities: Library) -> None:
    """After a step to a higher speed, friction comes down over a distance, as old contacts must wear off first."""
    n, slow, fast = 1000, 1e-5, 1e-2
    with Instance(asperities) as run:
        run.initialise(N=n, v=slow)
        run.step(0.0, 1e-4 / slow)
        early = run.get1("F")
        now = steps(run, [(fast, 1e-7 / fast)])
        assert run.get1("F") == pytest.approx(early, rel=0.02)
        later = []
        for _ in range(300):
            run.step(now, 1e-6 / fast)
            now = now + 1e-6 / fast
            later.append(run.get1("F"))
    assert np.mean(later[200:]) < 0.93 * early


# ---- (iv) equal asperities


@reproducibly
@given(trajectory=moves, n=st.integers(2, 40))
def test_equal_asperities_are_so_many_times_one(
    asperities: Library, trajectory: list[tuple[float, float]], n: int
) -> None:
    with Instance(asperities) as one, Instance(asperities) as many:
        one.initialise(N=1, **EQUAL)
        many.initialise(N=n, seed=5, **EQUAL)
        for run in (one, many):
            steps(run, trajectory)
        names = ("F", "F_N", "F_max", "stuck", "slipping", "loose")
        assert many.get(*names) == pytest.approx([n * x for x in one.get(*names)], rel=1e-12)
        assert many.get1("z") == pytest.approx(one.get1("z"), rel=1e-12)


# ---- one asperity, phase by phase


def profile(p: float) -> tuple[float, float]:
    return A * math.cos(KAPPA * p), -A * KAPPA * math.sin(KAPPA * p)


def base_in_balance(p: float) -> float:
    """Where the slider is while the tip slips forward at p."""
    w, incline = profile(p)
    return p + K_N * (HEIGHT + w) * (incline + MU0) / K_T


def test_a_single_asperity_lives_through_its_cycle(asperities: Library) -> None:
    """From a crest: break-away, snap into balance, slip, loss of contact, swing, landing; each against scipy."""
    v = 1e-3

    def bond(t: float) -> float:
        return (0.25 + 0.1 * (1.0 - math.exp(-t / 0.1))) * (1.0 + 0.02 * math.log1p(t / 1e-3))

    breaks = brentq(lambda t: K_T * v * t - K_N * (HEIGHT + A) * bond(t), 1e-6, 1.0, xtol=1e-16, rtol=1e-14)
    places = np.linspace(0.0, 2.0 * WAVELENGTH, 200001)
    balance = np.array([base_in_balance(p) for p in places])

    def first(base: float) -> float:
        k = int(np.argmax(balance >= base))
        return float(brentq(lambda p: base_in_balance(p) - base, places[k - 1], places[k], xtol=1e-20, rtol=1e-14))

    with Instance(asperities) as run:
        run.initialise(N=1, v=v, **EQUAL)
        assert run.get("stuck", "F_N") == [1.0, pytest.approx(K_N * (HEIGHT + A))]
        run.step(0.0, breaks * (1.0 - 1e-10))
        assert run.get("stuck", "z") == pytest.approx([1.0, v * breaks], rel=1e-9)
        t = steps(run, [(v, breaks * 2e-10)])
        landed = first(v * t)
        assert landed > 0.3 * WAVELENGTH, "no balance near the crest"
        assert run.get("slipping", "z") == pytest.approx([1.0, v * t - landed], rel=1e-8)

        k = int(np.argmax(places > landed))
        fold = k + int(np.argmax(np.diff(balance[k:]) < 0.0))
        lost = balance[fold] / v
        for fraction in (0.3, 0.8, 0.99):
            t = steps(run, [(v, breaks + fraction * (lost - breaks) - t)])
            p = first(v * t)
            w, incline = profile(p)
            expected = [1.0, v * t - p, K_N * (HEIGHT + w), K_N * (HEIGHT + w) * MU0]
            assert run.get("slipping", "z", "F_N", "F_max") == pytest.approx(expected, rel=1e-9)
            assert run.get1("F") == pytest.approx(K_N * (HEIGHT + w) * (incline + MU0), rel=1e-9)

        c = K_H * math.sqrt(M / K_T)
        swing = math.log(100.0) / (0.5 * K_H / K_T * math.sqrt(K_T / M))
        start = [balance[fold] - places[fold], 0.0]  # deflection, velocity of the tip
        solution = solve_ivp(
            lambda _, y: [v - y[1], (K_T * y[0] + c * (v - y[1])) / M],
            (0.0, swing),
            start,
            "DOP853",
            rtol=1e-11,
            atol=1e-18,
            dense_output=True,
        )
        for fraction in (0.01, 0.2, 0.6, 0.95):
            t = steps(run, [(v, lost + fraction * swing - t)])
            d, speed = solution.sol(t - lost)
            assert run.get("loose", "stuck", "F_N") == [1.0, 0.0, 0.0]
            assert run.get1("z") == pytest.approx(d, abs=1e-5 * start[0])
            assert run.get1("F") == pytest.approx(K_T * d + c * (v - speed), abs=1e-4 * K_T * start[0])
        t = steps(run, [(v, lost + 1.1 * swing - t)])
        landing = v * (lost + swing)
        expected = [1.0, v * (t - lost - swing), K_N * (HEIGHT + profile(landing)[0])]
        assert run.get("stuck", "z", "F_N") == pytest.approx(expected, rel=1e-6)


def test_tips_over_a_gap_touch_again_at_the_next_flank(asperities: Library) -> None:
    """height < A: contact where cos(2 pi b/wavelength) > -height/A."""
    v, height = 1e-3, 1e-7
    edge = math.acos(-height / A) / KAPPA
    with Instance(asperities) as run:
        run.initialise(N=1, v=v, height=height, m=1e-15, k_t=5e6, **EQUAL, **PLAIN)
        loose, n = 0.0, 20000
        steps(run, [(v, 10.0 * WAVELENGTH / v)])
        for _ in range(n):
            steps(run, [(v, 4.0 * WAVELENGTH / v / n)])
            loose += run.get1("loose") / n
    assert loose == pytest.approx(1.0 - 2.0 * edge / WAVELENGTH, abs=2e-3)


def test_a_released_tip_swings_on_while_the_slider_rests_and_lands(asperities: Library) -> None:
    with Instance(asperities) as run:
        run.initialise(N=1, v=1e-3, **EQUAL)
        t = 0.0
        while run.get1("loose") == 0.0:
            t = steps(run, [(1e-3, 1e-6)])
        omega = math.sqrt(K_T / M)
        seen = []
        for _ in range(10):
            t = steps(run, [(0.0, 0.25 / omega)])
            seen.append(run.get1("z"))
        assert min(seen) < 0.0 < max(seen)
        steps(run, [(0.0, 1.0)])
        assert run.get("loose", "stuck", "F", "z") == [0.0, 1.0, 0.0, 0.0]
    assert t < 1.0


@pytest.mark.parametrize("k_h", some([1e4 * (1.0 - 1e-9), 1e4, 3e4], [1e4]))
def test_overdamped_tips_return_without_a_swing(asperities: Library, k_h: float) -> None:
    with Instance(asperities) as run:
        run.initialise(N=1, v=1e-3, k_h=k_h, m=1e-5, **EQUAL)
        while run.get1("loose") == 0.0:
            steps(run, [(1e-3, 1e-6)])
        last = run.get1("z")
        for _ in range(50):
            steps(run, [(0.0, 1e-5)])
            assert 0.0 <= run.get1("z") <= last
            last = run.get1("z")


# ---- what holds for every friction model


@reproducibly
@given(trajectory=moves, pieces=st.integers(2, 20), seed=st.integers(0, 1000))
def test_how_a_span_is_cut_does_not_matter(
    asperities: Library, trajectory: list[tuple[float, float]], pieces: int, seed: int
) -> None:
    with Instance(asperities) as whole, Instance(asperities) as cut:
        for run in (whole, cut):
            run.initialise(seed=seed)
        for v, h in trajectory:
            steps(whole, [(v, h)])
            steps(cut, [(v, h / pieces)] * pieces)
            assert cut.get1("F") == pytest.approx(whole.get1("F"), rel=1e-9, abs=2e-9)


@reproducibly
@given(velocities=st.lists(st.floats(-2e-2, 2e-2), min_size=2, max_size=6), pieces=st.integers(2, 20))
def test_linear_velocities_may_be_cut_anyhow_through_their_reversals(
    asperities: Library, velocities: list[float], pieces: int
) -> None:
    h = 5e-3
    with Instance(asperities) as whole, Instance(asperities) as cut:
        for run, n in ((whole, 1), (cut, pieces)):
            run.initialise()
            t = 0.0
            for begin, end in itertools.pairwise(velocities):
                for k in range(n):
                    run.set({"v": begin + (end - begin) * k / n})
                    assert run.input_derivatives({"v": (end - begin) / h}) == OK
                    run.step(t, h / n)
                    t = t + h / n
        assert cut.get1("F") == pytest.approx(whole.get1("F"), rel=1e-9, abs=2e-8)


@reproducibly
@given(trajectory=moves, n=st.integers(1, 30), Fn=st.floats(-2.0, 50.0), Fn0=st.floats(0.1, 10.0))
def test_friction_is_odd_and_scales_with_the_load(
    asperities: Library, trajectory: list[tuple[float, float]], n: int, Fn: float, Fn0: float
) -> None:
    with Instance(asperities) as one, Instance(asperities) as other:
        one.initialise(N=n)
        other.initialise(N=n, Fn=Fn, Fn0=Fn0)
        assert one.get1("F") == other.get1("F") == 0.0
        for v, h in trajectory:
            steps(one, [(v, h)])
            steps(other, [(-v, h)])
            assert one.get1("z") == -other.get1("z")
            assert other.get1("F") == pytest.approx(-max(Fn, 0.0) / Fn0 * one.get1("F"), rel=1e-14, abs=1e-300)


@reproducibly
@given(trajectory=moves, seed=st.integers(0, 1000))
def test_contacts_bear_no_more_than_their_cone_of_friction(
    asperities: Library, trajectory: list[tuple[float, float]], seed: int
) -> None:
    """All tips in contact: F is at most their friction and the steepest slope times their normal force."""
    with Instance(asperities) as run:
        run.initialise(seed=seed, m=1e-15)
        for v, h in trajectory:
            steps(run, [(v, h)])
            F, F_N, F_max, stuck, slipping, loose = run.get("F", "F_N", "F_max", "stuck", "slipping", "loose")
            assert stuck + slipping + loose == 20
            if loose == 0.0:
                assert abs(F) <= (F_max + A * KAPPA / 0.7 * F_N) * (1.0 + 1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_work_of_friction_is_never_given_back(asperities: Library, seed: int) -> None:
    """From rest the work done on the asperities is positive at all times (the error of its sum is far below)."""
    draw, h, work, lowest = np.random.default_rng(seed), 5e-6, 0.0, 0.0
    with Instance(asperities) as run:
        run.initialise(N=10, seed=seed)
        for v in draw.choice([-1.0, 0.0, 1.0], 20) * 10.0 ** draw.uniform(-3.0, 0.0, 20):
            for _ in range(100):
                run.set({"v": float(v)})
                before = run.get1("F")
                steps(run, [(float(v), h)])
                work += 0.5 * (before + run.get1("F")) * v * h
                lowest = min(lowest, work)
    assert work > 1e-5 and lowest > -1e-9


def test_vibration_about_a_bias_leaves_no_trace_once_it_has_settled(asperities: Library) -> None:
    with Instance(asperities) as run:
        run.initialise(N=100)
        steps(run, [(1e-3, 4e-3)])
        steps(run, [(-1e-3, 1e-3), (1e-3, 1e-3)] * 2)
        settled = run.get1("F")
        for _ in range(50):
            steps(run, [(-1e-3, 1e-3), (1e-3, 1e-3)])
        assert run.get1("F") == pytest.approx(settled, rel=1e-9)


def test_the_rate_of_the_mean_deflection_is_its_derivative(asperities: Library) -> None:
    draw = np.random.default_rng(2)
    with Instance(asperities) as run:
        run.initialise(N=30)
        for v in draw.uniform(-5e-3, 5e-3, 60):
            steps(run, [(float(v), 1e-3)])
            before, counts = run.get("z", "der(z)"), run.get("stuck", "slipping", "loose")
            steps(run, [(float(v), 1e-9)])
            if run.get("stuck", "slipping", "loose") == counts and counts[2] == 0.0:
                assert (run.get1("z") - before[0]) / 1e-9 == pytest.approx(before[1], abs=1e-4 * abs(v) * 30)


def test_seeds_are_reproducible_and_differ(asperities: Library) -> None:
    def force(seed: int) -> float:
        with Instance(asperities) as run:
            run.initialise(seed=seed)
            steps(run, [(1e-2, 0.02)])
            return run.get1("F")

    assert force(5) == force(5)
    assert len({force(seed) for seed in range(20)}) == 20


def test_parameters_may_change_while_tips_slip(asperities: Library) -> None:
    """Stronger friction lets them stick, weaker friction lets them snap."""
    with Instance(asperities) as run:
        run.initialise(v=1e-2, **FLAT, **PLAIN, **EQUAL)
        run.step(0.0, 1e-2)
        assert run.get("F", "slipping") == [pytest.approx(1.0), 20.0]
        run.set({"mu0": 0.5})
        t = steps(run, [(1e-2, 5e-4)])
        assert run.get("F", "stuck") == [pytest.approx(1.5), 20.0]
        run.set({"mu0": 0.1})
        steps(run, [(0.0, 1e-6)])
        assert run.get1("F") == pytest.approx(0.4)
    assert t == pytest.approx(1.05e-2)
    with Instance(asperities) as run:
        run.initialise(v=1e-2, **FLAT, **PLAIN, **EQUAL)
        run.step(0.0, 1e-2)
        run.set({"mu0": 0.2525})  # a hundredth more, which the springs take up over 0.1 um
        for F, state in ((1.005, "stuck"), (1.01, "stuck"), (1.01, "slipping")):
            steps(run, [(1e-2, 5e-6)])
            assert run.get("F", state) == [pytest.approx(F), 20.0]


def test_more_wavelengths_than_can_be_followed_are_refused(asperities: Library) -> None:
    with Instance(asperities) as run:
        run.initialise(v=1.0)
        assert run.call("DoStep", 0.0, 10.0, 1) == DISCARD
    with Instance(asperities) as run:  # two million of all asperities, even if they never leave the surface
        run.initialise(v=1.0, height=1e-3, A=1e-9, dmu=0.0)
        run.step(0.0, 0.5)
        assert run.call("DoStep", 0.5, 2.0, 1) == DISCARD
    with Instance(asperities) as run:
        run.initialise(v=1.0, **FLAT)
        run.step(0.0, 1e6)
        assert run.get1("slipping") == 20


@pytest.mark.parametrize(
    "values",
    [
        {"mu0": 0.0, "dmu": 0.0},
        {"height": 0.0},
        {"height": 0.0, "A": 0.0},
        {"A": 1e-4},
        {"k_n": 1e-9},
        {"k_t": 1e-9},
        {"m": 1e-18},
        {"m": 1e3},
        {"k_h": 1e-9},
        {"k_h": 1e12},
        {"tau": 1e-9, "t0": 1e-9},
        {"wavelength": 1e-7},
        {"wavelength": 1e3},
        {"height_spread": 1.0},
    ],
)
def test_parameters_at_their_limits_give_finite_forces(asperities: Library, values: dict[str, float]) -> None:
    with Instance(asperities) as run:
        run.initialise(**values)
        for v in (1e-3, 0.0, -1e-2, 1e-6, 0.3, -0.3, 0.0):
            steps(run, [(v, 1e-3)])
            assert math.isfinite(run.get1("F"))
