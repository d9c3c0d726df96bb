"""RateAndState against its closed forms, scipy, and the stability of a slider on a spring."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from shell.instance import OK, Instance, Library, load
from thorough import few, some

reproducibly = settings(max_examples=few(150), deadline=20_000, derandomize=True, database=None)
SET = {"mu0": 0.6, "a": 0.01, "b": 0.015, "Dc": 1e-5, "V0": 1e-6, "sigma_n": 1.0}
speeds = st.floats(-9.0, 1.0).map(lambda exponent: 10.0**exponent)
velocities = st.one_of(speeds, speeds.map(lambda v: -v), st.just(0.0))
ages = st.floats(-7.0, 6.0).map(lambda exponent: 10.0**exponent)
AGING, SLIP = 0.0, 1.0


@pytest.fixture(scope="module")
def rate_and_state(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("RateAndState"))


def coefficient(v: float, theta: float, p: dict[str, float] = SET) -> float:
    """The logarithmic law, with the sign of v."""
    mu = p["mu0"] + p["a"] * math.log(abs(v) / p["V0"]) + p["b"] * math.log(p["V0"] * theta / p["Dc"])
    return math.copysign(mu, v)


def aged(theta: float, v: float, t: float, law: float, Dc: float = 1e-5) -> float:
    """theta after t at constant v, in extended precision."""
    extended = np.longdouble
    if v == 0.0:
        return theta + t if law == AGING else theta
    steady, decay = extended(Dc) / extended(abs(v)), np.exp(-extended(abs(v)) * extended(t) / extended(Dc))
    if law == AGING:
        return float(extended(theta) * decay - steady * np.expm1(-extended(abs(v)) * extended(t) / extended(Dc)))
    return float(steady * np.exp(np.log(extended(theta) / steady) * decay))


# ---- published cases


@pytest.mark.parametrize("law", [AGING, SLIP])
@pytest.mark.parametrize("t", [1e-3, 0.1, 0.5, 1.0, 3.0, 30.0])
def test_b24_a_step_of_the_velocity(rate_and_state: Library, law: float, t: float) -> None:
    """From 1 to 10 um/s: mu jumps by a ln 10, then evolves over Dc."""
    with Instance(rate_and_state) as run:
        run.initialise(v=1e-6, law=law)
        run.step(0.0, 100.0)
        assert run.get("F", "mu", "theta") == pytest.approx([0.6, 0.6, 10.0], rel=1e-13)
        run.set({"v": 1e-5})
        run.step(100.0, t)
        u = t * 1e-5 / 1e-5
        if law == AGING:
            expected = 0.6 + 0.01 * math.log(10.0) + 0.015 * math.log(0.1 * (1.0 + 9.0 * math.exp(-u)))
        else:
            expected = 0.6 + 0.01 * math.log(10.0) + 0.015 * math.log(10.0) * (math.exp(-u) - 1.0)
        assert run.get1("F") == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("t", "rise"), [(1.0, 0.00142965), (10.0, 0.01039721), (100.0, 0.03596843), (1000.0, 0.06922681)]
)
def test_b27_slide_hold_slide(rate_and_state: Library, t: float, rise: float) -> None:
    """A rigid slider held for t: friction rises by b ln(1 + V0 t/Dc) by the aging law, not at all by the slip law."""
    for law in (AGING, SLIP):
        with Instance(rate_and_state) as run:
            run.initialise(v=0.0, law=law)
            run.step(0.0, t)
            assert run.get1("F") == 0.0
            run.set({"v": 1e-6})
            healed = run.get1("F") - 0.6
            assert healed == pytest.approx(0.015 * math.log(1.0 + t / 10.0) if law == AGING else 0.0, abs=1e-12)
            assert law == SLIP or healed == pytest.approx(rise, abs=1e-8)


def slider(run: Instance, k: float, law: float, span: float, h: float) -> np.ndarray:
    """ln(v/V0) of a massless slider, pulled at V0 by a spring of stiffness k, from a small push out of balance.

    Trapezoidal rule for the position; the velocity at the end of each step is the one that balances the spring.
    """
    v, x, history, t = 1.001e-6, 0.0, [], 0.0
    run.initialise(v=v, law=law)
    preload = run.get1("F")

    def missing(guess: float) -> float:
        run.must("SetFMUstate", state)
        run.set({"v": v})
        assert run.input_derivatives({"v": (guess - v) / h}) == OK
        run.step(t, h)
        return run.get1("F") - (preload + k * (1e-6 * (t + h) - x - 0.5 * h * (v + guess)))

    while t < span:
        with run.saved() as state:
            one, two = v, v * (1.0 + 1e-7)
            f_one, f_two = missing(one), missing(two)
            for _ in range(20):
                one, two, f_one = two, two - f_two * (two - one) / (f_two - f_one), f_two
                f_two = missing(two)
                if abs(two - one) <= 1e-13 * abs(two) or f_two == f_one:
                    break
            x += 0.5 * h * (v + two)
        v, t = two, t + h
        history.append(math.log(v / 1e-6))
    return np.array(history)


@pytest.mark.parametrize("law", some([AGING, SLIP], [AGING]))
def test_b25_a_slider_on_the_critical_spring_is_neutral(rate_and_state: Library, law: float) -> None:
    """k_c = (b - a)/Dc and the period 2 pi (Dc/V) sqrt(a/(b - a)) of Ruina; decay above it, growth below."""
    h, k_c = 0.25, 500.0
    period = 2.0 * math.pi * 10.0 * math.sqrt(0.01 / 0.005)
    assert period == pytest.approx(88.857659, abs=1e-6)
    growth = {}
    for factor in (0.99, 1.0, 1.01):
        with Instance(rate_and_state) as run:
            w = slider(run, factor * k_c, law, 5.0 * period, h)
            assert run.get1("k_c") == pytest.approx(k_c, rel=1e-12)
        up = np.nonzero((w[:-1] < 0.0) & (w[1:] >= 0.0))[0]
        crossings = up + w[up] / (w[up] - w[up + 1])
        peaks = [w[a:b].max() for a, b in itertools.pairwise(up)]
        growth[factor] = peaks[-1] / peaks[0]
        if factor == 1.0:
            assert np.diff(crossings).mean() * h == pytest.approx(period, rel=1e-4)
    assert growth[1.0] == pytest.approx(1.0, abs=2e-3)
    assert growth[0.99] > 1.05 and growth[1.01] < 0.95


# ---- constant velocity


@reproducibly
@given(v=velocities, theta=ages, h=st.floats(1e-6, 0.02), law=st.sampled_from([AGING, SLIP]), Dc=st.floats(1e-7, 1e-3))
def test_a_step_at_constant_velocity_is_exact(
    rate_and_state: Library, v: float, theta: float, h: float, law: float, Dc: float
) -> None:
    with Instance(rate_and_state) as run:
        run.initialise(v=v, theta=theta, law=law, Dc=Dc)
        t = 0.0
        for _ in range(3):
            run.step(t, h)
            theta, t = aged(theta, v, h, law, Dc), t + h
            assert run.get1("theta") == pytest.approx(theta, rel=1e-12)
            if v != 0.0 and coefficient(abs(v), theta, SET | {"Dc": Dc}) > 0.25:
                assert run.get1("F") == pytest.approx(coefficient(v, theta, SET | {"Dc": Dc}), rel=1e-12)


@reproducibly
@given(
    trajectory=st.lists(st.tuples(velocities, st.floats(1e-5, 0.02)), min_size=1, max_size=5),
    law=st.sampled_from([AGING, SLIP]),
    pieces=st.integers(2, 30),
)
def test_how_a_span_is_cut_does_not_matter(
    rate_and_state: Library, trajectory: list[tuple[float, float]], law: float, pieces: int
) -> None:
    with Instance(rate_and_state) as whole, Instance(rate_and_state) as cut:
        for run, n in ((whole, 1), (cut, pieces)):
            run.initialise(law=law)
            t = 0.0
            for v, h in trajectory:
                run.set({"v": v})
                for _ in range(n):
                    run.step(t, h / n)
                    t = t + h / n
        assert cut.get1("theta") == pytest.approx(whole.get1("theta"), rel=1e-11)
        assert cut.get1("F") == pytest.approx(whole.get1("F"), rel=1e-12, abs=1e-15)


def test_a_hold_of_any_length_heals_or_does_not(rate_and_state: Library) -> None:
    for law, expected in ((AGING, 10.0 + 1e9), (SLIP, 10.0)):
        with Instance(rate_and_state) as run:
            run.initialise(law=law)
            run.step(0.0, 1e9)
            assert run.get("theta", "F") == [expected, 0.0]


@pytest.mark.parametrize("law", [AGING, SLIP])
@pytest.mark.parametrize("v", [1e-9, -1e-3, 30.0])
def test_long_sliding_ends_on_the_steady_line(rate_and_state: Library, law: float, v: float) -> None:
    with Instance(rate_and_state) as run:
        run.initialise(v=v, law=law)
        run.step(0.0, 1e-3 / abs(v))
        steady = math.copysign(0.6 - 0.005 * math.log(abs(v) / 1e-6), v)
        assert run.get1("F") == pytest.approx(steady, rel=1e-12)
        assert run.get1("der(theta)") == pytest.approx(0.0, abs=1e-11)


# ---- linear velocity


def integrated(theta: float, v: float, slope: float, h: float, law: float) -> float:
    """ln(theta) by scipy, in pieces that do not cross v = 0."""
    turn = -v / slope
    y = math.log(theta)
    for begin, end in itertools.pairwise([0.0, *([turn] if 0.0 < turn < h else []), h]):

        def rate(s: float, y: np.ndarray) -> np.ndarray:
            x = abs(v + slope * s) * np.exp(y) / 1e-5
            return np.exp(-y) - x * np.exp(-y) if law == AGING else -x * np.exp(-y) * np.log(np.maximum(x, 1e-300))

        solution = solve_ivp(rate, (begin, end), [y], "LSODA", rtol=1e-12, atol=1e-13)
        assert solution.success
        y = float(solution.y[0, -1])
    return y


RAMPS = [  # v at the start, slope, duration
    (1e-6, 1e-5, 1.0),
    (1e-4, 0.05, 0.02),
    (-2e-3, 1.0, 5e-3),
    (3e-3, -0.6, 0.01),
    (0.0, 0.1, 0.02),
    (0.0, -20.0, 0.01),
    (0.1, -10.0, 0.02),
    (0.01, -0.5, 0.02),
    (-1e-9, 1e-3, 0.02),
    (1.0, -1e-3, 0.02),
]


@pytest.mark.parametrize(("v", "slope", "h"), some(RAMPS, RAMPS[::6]))
@pytest.mark.parametrize("law", [AGING, SLIP])
@pytest.mark.parametrize("theta", [10.0, 1e-4])
def test_a_linear_velocity_is_integrated_through_its_reversal(
    rate_and_state: Library, v: float, slope: float, h: float, law: float, theta: float
) -> None:
    expected = integrated(theta, v, slope, h, law)
    with Instance(rate_and_state) as run:
        run.initialise(v=v, theta=theta, law=law)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        assert math.log(run.get1("theta")) == pytest.approx(expected, abs=2e-8)
        end = v + slope * h
        if abs(end) > 1e-12:
            assert run.get1("F") == pytest.approx(coefficient(end, math.exp(expected)), abs=1e-9)


@pytest.mark.parametrize(("v", "slope", "h"), RAMPS)
@pytest.mark.parametrize("law", [AGING, SLIP])
def test_a_linear_velocity_may_be_cut_anyhow(
    rate_and_state: Library, v: float, slope: float, h: float, law: float
) -> None:
    ages = []
    for pieces in (1, 3, 32):
        with Instance(rate_and_state) as run:
            run.initialise(law=law)
            t = 0.0
            for k in range(pieces):
                run.set({"v": v + slope * h * k / pieces})
                assert run.input_derivatives({"v": slope}) == OK
                run.step(t, h / pieces)
                t = t + h / pieces
            ages.append(run.get1("theta"))
    assert ages[1:] == pytest.approx([ages[0]] * 2, rel=2e-12)


# ---- the regular form


@reproducibly
@given(v=velocities.filter(bool), theta=ages, a=st.floats(2e-3, 0.05), mu0=st.floats(0.0, 1.0), b=st.floats(0.0, 0.05))
def test_the_force_is_the_inverse_hyperbolic_sine(
    rate_and_state: Library, v: float, theta: float, a: float, mu0: float, b: float
) -> None:
    x = v / 2e-6 * math.exp(min((mu0 + b * math.log(0.1 * theta)) / a, 600.0))
    with Instance(rate_and_state) as run:
        run.initialise(v=v, theta=theta, a=a, mu0=mu0, b=b)
        assert run.get1("F") == pytest.approx(a * math.asinh(x), rel=1e-11, abs=1e-300)


@reproducibly
@given(v=velocities, theta=ages, law=st.sampled_from([AGING, SLIP]), h=st.floats(1e-6, 0.02))
def test_friction_is_odd_and_takes_power_out(
    rate_and_state: Library, v: float, theta: float, law: float, h: float
) -> None:
    found = []
    for sign in (1.0, -1.0):
        with Instance(rate_and_state) as run:
            run.initialise(v=sign * v, theta=theta, law=law)
            run.step(0.0, h)
            F, age = run.get("F", "theta")
            found.append((sign * F, age))
            assert F * sign * v >= 0.0 and (v != 0.0 or F == 0.0)
    assert found[0] == found[1]


def test_without_a_direct_effect_the_force_jumps_at_rest(rate_and_state: Library) -> None:
    with Instance(rate_and_state) as run:
        run.initialise(a=0.0, theta=10.0)
        for v, F in ((0.0, 0.0), (1e-12, 0.6), (-3.0, -0.6)):
            run.set({"v": v})
            assert run.get1("F") == pytest.approx(F, rel=1e-14)
        run.set({"mu0": 0.0, "v": 1.0})
        assert run.get1("F") == pytest.approx(0.0, abs=1e-15)
        run.set({"V0": 1e-9})
        assert run.get1("F") == 0.0, "never negative"


@pytest.mark.parametrize("theta", [0.0, -5.0, 1e-300])
@pytest.mark.parametrize("law", [AGING, SLIP])
def test_contacts_without_an_age_are_born_in_the_first_step(rate_and_state: Library, theta: float, law: float) -> None:
    with Instance(rate_and_state) as run:
        run.initialise(theta=theta, law=law, v=1e-3)
        assert 0.0 <= run.get1("F") < 0.7
        run.step(0.0, 1.0)
        assert run.get("theta", "F") == pytest.approx([1e-2, 0.6 - 0.005 * math.log(1e3)], rel=1e-9)


@reproducibly
@given(v=velocities, Fn=st.floats(-2.0, 50.0), Fn0=st.floats(0.1, 10.0), sigma_n=st.floats(0.0, 100.0))
def test_the_force_scales_with_the_load(
    rate_and_state: Library, v: float, Fn: float, Fn0: float, sigma_n: float
) -> None:
    with Instance(rate_and_state) as plain, Instance(rate_and_state) as loaded:
        plain.initialise(v=v)
        loaded.initialise(v=v, Fn=Fn, Fn0=Fn0, sigma_n=sigma_n)
        for run in (plain, loaded):
            run.step(0.0, 0.01)
        assert loaded.get1("theta") == plain.get1("theta")
        scale = max(Fn, 0.0) / Fn0 * sigma_n
        assert loaded.get("F", "k_c") == pytest.approx([scale * x for x in plain.get("F", "k_c")], rel=1e-13)
