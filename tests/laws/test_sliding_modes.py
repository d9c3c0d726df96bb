"""ImplicitSlidingMode and ImplicitSuperTwisting: implicit equations, reaching in finite time, order of the error."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from observer_loops import follow, rms_error, run
from thorough import nightly, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
FIRST, SECOND = LAWS["ImplicitSlidingMode"], LAWS["ImplicitSuperTwisting"]
BuildFmu = Callable[..., Path]
SINE = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}


def slide(law: Law, n: int, v: float, friction: Callable[[int], float], **values: float) -> list[dict[str, float]]:
    """A mass under the law with rd = 0 and lam = 0, where s = -v and a sample is exact; s is added to the results."""
    m, Ts, results = values["m"], values["Ts"], []
    states = {"w": 0.0} if law is SECOND else {}
    for k in range(n):
        found = law.evaluate({**values, **states, "v": v, "lam": 0.0})
        states = {name: found[name] for name in states}
        results.append(found | {"s": -v})
        v += Ts / m * (found["u"] - friction(k))
    return results


# ---- first order


@given(*[st.floats(-1.0, 1.0)] * 6, st.floats(0.0, 1.0))
def test_first_order_is_one_saturation(r, rd, rdd, x, v, f, gain):
    found = FIRST.evaluate({"r": r, "rd": rd, "rdd": rdd, "x": x, "v": v, "f": f, "gain": gain, "m": 2.0, "K": 9.0})
    s = rd - v + 63.0 * (r - x)
    part = min(max(2.0 * s / 1e-3, -9.0), 9.0)
    assert found["F_hat"] == pytest.approx(part, rel=1e-9, abs=1e-9)
    assert found["u"] == pytest.approx(2.0 * (rdd + 63.0 * (rd - v)) + gain * part + f, rel=1e-9, abs=1e-9)


def test_the_saturation_solves_the_implicit_equation():
    """s_next of the nominal mass and the force are of one sign; between the bounds s_next is 0."""
    for v in np.linspace(-0.05, 0.05, 41):
        found = FIRST.evaluate({"v": v, "lam": 0.0, "K": 20.0})
        after = -v - 1e-3 * found["F_hat"]
        if abs(after) > 1e-15:
            assert found["F_hat"] == 20.0 * np.sign(after)
        else:
            assert abs(found["F_hat"]) <= 20.0


@pytest.mark.parametrize("start", [0.4, 0.123, -0.0501])
def test_it_reaches_zero_in_the_computed_number_of_samples_and_stays(start):
    m, K, Ts = 2.0, 30.0, 1e-3
    found = slide(FIRST, 60, start, lambda k: 0.0, m=m, K=K, Ts=Ts)
    n = math.ceil(m * abs(start) / (K * Ts))
    sizes = [abs(result["s"]) for result in found]
    assert sizes[n - 1] > 1e-6
    assert max(sizes[n:]) < 1e-15
    assert np.diff(sizes[:n]) == pytest.approx([-K * Ts / m] * (n - 1), rel=1e-9)
    assert max(abs(result["u"]) for result in found[n + 1 :]) < 1e-12


@pytest.mark.parametrize("K", [5.0, 500.0])
def test_in_constant_friction_s_is_friction_times_sample_time_over_mass(K):
    found = slide(FIRST, 400, 0.1, lambda k: 3.0, m=2.0, K=K, Ts=1e-3)
    assert found[-1]["s"] == pytest.approx(3.0 * 1e-3 / 2.0, rel=1e-9)
    assert found[-1]["F_hat"] == pytest.approx(3.0, rel=1e-9)


def test_the_explicit_sign_chatters_and_is_no_more_accurate():
    """The same loop with K sgn(s) of this sample: the input varies a hundred times as much and more."""
    m, Ts, lam, K, w, A = 1.0, 1e-3, 63.0, 5.0, 2.0 * math.pi, 1e-2

    def loop(implicit: bool) -> tuple[float, float]:
        x, v, errors, forces = 0.0, A * w, [], []
        for k in range(2000):
            t = k * Ts
            given = {"r": A * math.sin(w * t), "rd": A * w * math.cos(w * t), "rdd": -A * w**2 * math.sin(w * t)}
            ed = given["rd"] - v
            s = ed + lam * (given["r"] - x)
            u = m * (given["rdd"] + lam * ed) + K * float(np.sign(s))
            if implicit:
                u = FIRST.evaluate({**given, "x": x, "v": v, "K": K, "lam": lam})["u"]
            errors.append(given["r"] - x)
            forces.append(u)
            a = (u - math.tanh(v / 1e-3) - 2.0 * v) / m
            x, v = x + Ts * v + Ts**2 / 2.0 * a, v + Ts * a
        return float(np.sqrt(np.mean(np.square(errors[1000:])))), float(np.abs(np.diff(forces[1000:])).sum())

    (error, variation), (other_error, other_variation) = loop(True), loop(False)
    assert other_variation > 100.0 * variation
    assert error < 1.5 * other_error


def test_first_order_error_is_proportional_to_the_sample_time(build_fmu: BuildFmu):
    errors = [
        rms_error(follow(build_fmu, "ImplicitSlidingMode", {}, reference=SINE, Ts=Ts), 1.0) for Ts in (1e-3, 0.5e-3)
    ]
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


def test_a_bound_that_is_too_high_does_no_harm(build_fmu: BuildFmu):
    forces = []
    for K in (5.0, 500.0):
        result = follow(build_fmu, "ImplicitSlidingMode", {"K": K}, reference=SINE)
        forces.append(result["servo.u"].to_numpy()[1000:])
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-9)
    # there is no chattering on LuGre either: in one period u varies by little more than its four rises and falls
    assert np.abs(np.diff(forces[0])).sum() < 3.0 * 2.0 * np.ptp(forces[0])


# ---- super-twisting


@given(st.floats(-0.1, 0.1), st.floats(-5.0, 5.0), st.floats(0.0, 1e4))
def test_super_twisting_solves_its_two_implicit_steps(v, w, L):
    m, Ts = 2.0, 1e-3
    found = SECOND.evaluate({"v": v, "w": w, "L": L, "lam": 0.0, "m": m, "u_min": -1e6, "u_max": 1e6})
    s, most = -v, 1.1 * L * Ts
    # the first inclusion: w_next - w is the bound times the sign of what is left of s
    rest = s - Ts / m * (found["w"] - w)
    if abs(rest) > 1e-14 + 1e-12 * abs(s):
        assert found["w"] - w == pytest.approx(most * np.sign(rest), rel=1e-6, abs=1e-9)
    else:
        assert abs(found["w"] - w) <= most * (1.0 + 1e-9) + 1e-9
    # the second: the root term is that of the s it leads to
    root = found["u"] - found["w"]
    after = s - Ts / m * root
    assert root == pytest.approx(1.5 * math.sqrt(m * L * abs(after)) * np.sign(after), rel=1e-5, abs=1e-4)


def test_super_twisting_follows_a_ramp_with_the_closed_form_of_its_error():
    m, Ts, c = 2.0, 1e-3, 40.0
    found = slide(SECOND, 400, 0.02, lambda k: 3.0 + c * k * Ts, m=m, Ts=Ts, L=100.0)
    assert found[-1]["s"] == pytest.approx(c * Ts**2 / m, rel=1e-6)
    constant = slide(SECOND, 400, 0.02, lambda k: 3.0, m=m, Ts=Ts, L=100.0)
    assert abs(constant[-1]["s"]) < 1e-12
    assert constant[-1]["F_hat"] == pytest.approx(3.0, rel=1e-9)


@nightly
@pytest.mark.parametrize("start", some([2.0, -0.3], [2.0]))
@pytest.mark.parametrize("L", some([10.0, 1000.0], [1000.0]))
def test_super_twisting_reaches_zero_without_chattering(start, L):
    found = slide(SECOND, 8000, start, lambda k: 0.0, m=1.0, Ts=1e-3, L=L)
    assert max(abs(result["s"]) for result in found[-100:]) < 1e-12
    assert max(abs(result["u"]) for result in found[-100:]) < 1e-9


def test_the_step_that_is_implicit_at_once_is_only_of_first_order():
    """What the documentation says of the published form: it ends at s = F Ts/m."""
    m, Ts, L, F, s, w = 2.0, 1e-3, 100.0, 3.0, -0.02, 0.0
    k1, k2 = 1.5 * math.sqrt(L / m), 1.1 * L / m
    for _ in range(4000):
        b = s - Ts * w / m
        if abs(b) <= Ts**2 * k2:
            y, sign = 0.0, b / (Ts**2 * k2)
        else:
            sign = math.copysign(1.0, b)
            y = (-Ts * k1 + math.sqrt((Ts * k1) ** 2 + 4.0 * (abs(b) - Ts**2 * k2))) / 2.0
        w += Ts * m * k2 * sign
        s += Ts / m * (F - m * k1 * y * sign - w)
    assert s == pytest.approx(F * Ts / m, rel=1e-3)


@nightly
def test_super_twisting_error_falls_with_the_square_of_the_sample_time(build_fmu: BuildFmu):
    errors, variations = [], []
    for Ts in (1e-3, 0.5e-3, 0.25e-3):
        result = follow(build_fmu, "ImplicitSuperTwisting", {}, reference=SINE, Ts=Ts)
        errors.append(rms_error(result, 1.0))
        u = result["servo.u"].to_numpy()
        variations.append(np.abs(np.diff(u[len(u) // 2 :])).sum())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)
    # the force is smooth: its variation is that of the friction and does not depend on the sample time
    assert variations[2] == pytest.approx(variations[0], rel=0.1)


def test_super_twisting_does_not_wind_up():
    held = run(SECOND, [{"r": 1.0}] * 500, u_min=-5.0, u_max=5.0, L=1000.0)
    assert all(result["u"] == 5.0 and result["w"] == 0.0 for result in held)


def test_reset_and_enable():
    on, off = {"v": -0.01}, {"v": -0.01, "enable": 0.0}
    fresh = run(SECOND, [on])[0]
    found = run(SECOND, [on] * 5 + [off, on, {**on, "reset": 1.0}])
    assert found[4]["w"] != fresh["w"]
    assert set(found[5].values()) == {0.0}
    assert found[6] == fresh
    assert found[7]["u"] == fresh["u"]
    assert set(FIRST.evaluate(off).values()) == {0.0}
