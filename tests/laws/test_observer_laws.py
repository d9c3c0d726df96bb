"""StaticFeedback and LuGreObserver against closed forms, a matrix exponential, and in the loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from observer_loops import P95, follow, rms_error, run
from scipy.linalg import expm
from thorough import nightly

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
STATIC, LUGRE = LAWS["StaticFeedback"], LAWS["LuGreObserver"]
BuildFmu = Callable[..., Path]


def level(v: float, Fc: float = 1.0, Fs: float = 1.5, vs: float = 1e-3, delta: float = 2.0) -> float:
    return Fc + (Fs - Fc) * math.exp(-((abs(v) / vs) ** delta))


# ---- StaticFeedback


@given(st.floats(-0.1, 0.1), st.floats(0.0, 1.0), st.floats(0.0, 40.0))
def test_static_feedback_is_its_formula(v, gain, Fs):
    p = {"Fc": 20.4, "Fs": Fs, "vs": 2e-3, "delta": 0.7}
    found = STATIC.evaluate({**p, "v": v, "vt": 5e-3, "Fv": 203.5, "gain": gain})
    part = min(max(v / 5e-3, -1.0), 1.0)
    expected = part * level(v, **p) + 203.5 * v
    assert found["F_hat"] == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert found["u"] == pytest.approx(gain * expected, rel=1e-12, abs=1e-12)


def test_static_feedback_at_rest_and_disabled():
    assert STATIC.evaluate({"v": 0.0}) == {"u": 0.0, "F_hat": 0.0, "u_sat": 0.0}
    assert STATIC.evaluate({"v": 1.0, "enable": 0.0}) == {"u": 0.0, "F_hat": 0.0, "u_sat": 0.0}
    assert STATIC.evaluate({"v": 1e300, "u_max": 2.0})["u"] == 2.0


@nightly
@pytest.mark.parametrize(("damping", "grows"), [(1.05, False), (0.95, True)])
def test_without_friction_static_feedback_is_a_negative_damper(damping, grows):
    """Kd > gain (Fs/vt + Fv) is the limit of stability, found by simulating a free mass within vt."""
    gain, Fs, Fv, vt, Ts = 0.8, 1.5, 0.4, 1e-2, 1e-4
    Kd, Kp = damping * gain * (Fs / vt + Fv), 100.0
    x, v = 0.0, 1e-6
    for _ in range(20000):
        # Fs = Fc: the slope within vt is constant
        u = STATIC.evaluate({"v": v, "gain": gain, "Fc": Fs, "Fs": Fs, "Fv": Fv, "vt": vt})["u"] - Kd * v - Kp * x
        x, v = x + Ts * v + Ts**2 / 2.0 * u, v + Ts * u
    assert (math.hypot(v, 10.0 * x) > 1e-6) is grows


@nightly
def test_over_compensation_makes_a_limit_cycle_that_grows(build_fmu: BuildFmu):
    """Gain times model over real Coulomb friction: below 1 the axis comes to rest, above 1 it swings, ever wider."""
    plant = {"friction.Fs": 1.0, "mass.v0": 0.05}
    swing = []
    for excess in (0.5, 0.8, 1.2, 1.5, 2.0):
        model = {"Fc": excess, "Fs": excess, "Fv": 0.4, "vt": 5e-3}
        servo = {"Kp": 400.0, "Kd": 10.0, "Ki": 0.0}
        still = {"amplitude[1]": 0.0}
        result = follow(
            build_fmu, "PID", servo, addition=("StaticFeedback", model), reference=still, start=plant, stop=5.0
        )
        swing.append(float(np.ptp(result["mass.v"].to_numpy()[4000:])))
    assert max(swing[:2]) < 1e-6
    assert swing[2] > 1e-3
    assert swing[2] < swing[3] < swing[4]


def test_static_feedback_improves_tracking_in_sliding(build_fmu: BuildFmu):
    servo = {"Kp": 12e3, "Kd": 190.0, "Ki": 250e3, "m": 1.0}
    sine = {"amplitude[1]": 0.05}
    alone = rms_error(follow(build_fmu, "PID", servo, reference=sine), 1.0)
    helped = follow(build_fmu, "PID", servo, reference=sine, addition=("StaticFeedback", {"vt": 2e-3, "gain": 0.9}))
    assert rms_error(helped, 1.0) < 0.3 * alone


# ---- LuGreObserver


def bristle(v: float, e: float, k: float, z: float, Ts: float) -> tuple[float, float]:
    """Deflection after Ts and its rate now, by the matrix exponential of (z, 1)."""
    rate = P95["sigma0"] * abs(v) / level(v)
    flow = np.array([[-rate, v + k * e], [0.0, 0.0]])
    return float((expm(Ts * flow) @ [z, 1.0])[0]), v + k * e - rate * z


def test_the_observer_is_the_exact_step():
    random = np.random.default_rng(1)
    v = 0.02 * np.cumsum(random.normal(size=200)) * random.integers(0, 2, 200)
    e = 1e-4 * random.normal(size=200)
    found = run(LUGRE, [{"v": a, "r": b + 0.3, "x": 0.3} for a, b in zip(v, e, strict=True)], k=30.0, gain=0.7)
    z = 0.0
    for k in range(200):
        after, rate = bristle(v[k], e[k], 30.0, z, 1e-3)
        force = P95["sigma0"] * z + P95["sigma1"] * rate + P95["sigma2"] * v[k]
        # relative to the largest term: the sum cancels
        assert found[k]["F_hat"] == pytest.approx(force, abs=1e-11 * (1.0 + P95["sigma1"] * abs(v[k])))
        assert found[k]["u"] == pytest.approx(0.7 * found[k]["F_hat"], rel=1e-15)
        assert found[k]["z"] == pytest.approx(after, rel=1e-9, abs=1e-17)
        z = found[k]["z"]


@pytest.mark.parametrize("v", [1e-4, 1e-2, 1.0, 1e4])
def test_the_error_of_the_deflection_dies_as_in_the_closed_form(v):
    """Without injection and at any speed: the factor exp(-sigma0 |v|/g Ts) in each sample, and no overshoot."""
    steady = level(v) / P95["sigma0"]
    found = run(LUGRE, [{"v": v}] * 20, z=-steady)
    decay = math.exp(-P95["sigma0"] * v / level(v) * 1e-3)
    for n, result in enumerate(found, 1):
        assert result["z"] == pytest.approx(steady - 2.0 * steady * decay**n, rel=1e-10)
        assert abs(result["z"]) <= steady * (1.0 + 1e-12)


def test_at_rest_the_deflection_stays():
    found = run(LUGRE, [{}] * 5, z=3e-6)
    assert [result["z"] for result in found] == [3e-6] * 5
    assert found[0]["F_hat"] == pytest.approx(0.3, rel=1e-12)


@pytest.mark.parametrize("law", [LUGRE], ids=lambda law: law.name)
def test_reset_and_enable_of_the_observer(law: Law):
    busy: Iterable[Mapping[str, float]] = [{"v": 1e-3}] * 5
    found = run(law, [*busy, {"v": 1e-3, "reset": 1.0}, {"v": 1e-3}])
    fresh = run(law, [{"v": 1e-3}])[0]
    assert found[4]["z"] != 0.0
    assert found[5]["u"] == fresh["u"]
    assert found[6] == fresh
    off = run(law, [*busy, {"v": 1.0, "enable": 0.0}, {"v": 1e-3}])
    assert set(off[5].values()) == {0.0}
    assert off[6] == fresh


@pytest.mark.parametrize("Kd", [100.0, 300.0, 320.0, 500.0])
@pytest.mark.parametrize("Ki", [0.0, 1e4, 2.9e6, 3.4e6])
def test_the_condition_of_positive_realness(Kd, Ki):
    """The documented condition against the sign of Re G(jw) on a grid, Kp = 1e4 N/m."""
    m, Kp, s0, s1 = 1.0, 1e4, P95["sigma0"], P95["sigma1"]
    s = 1j * np.geomspace(1e-3, 1e7, 20001)
    G = s * (s1 * s + s0) / (m * s**3 + Kd * s**2 + Kp * s + Ki)
    stable = bool((np.roots([m, Kd, Kp, Ki] if Ki else [m, Kd, Kp]).real < 0.0).all())
    condition = s1 * Kd >= s0 * m and s0 * Kp >= s1 * Ki
    assert bool((G.real >= 0.0).all() and stable) is condition


SINE = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}


def servo(w: float) -> dict[str, float]:
    """PID with three poles at w rad/s, for 1 kg."""
    return {"Kp": 3.0 * w**2, "Kd": 3.0 * w, "Ki": w**3, "m": 1.0}


@nightly
def test_the_error_with_the_observer_is_small_and_proportional_to_the_sample_time(build_fmu: BuildFmu):
    ratios = []
    for Ts in (1e-3, 0.5e-3, 0.25e-3):
        alone = rms_error(follow(build_fmu, "PID", servo(63.0), reference=SINE, Ts=Ts), 1.0)
        helped = follow(build_fmu, "PID", servo(63.0), reference=SINE, Ts=Ts, addition=("LuGreObserver", {}))
        ratios.append(rms_error(helped, 1.0) / alone)
    assert ratios[0] < 0.03
    assert ratios[0] / ratios[1] == pytest.approx(2.0, rel=0.15)
    assert ratios[1] / ratios[2] == pytest.approx(2.0, rel=0.15)


@nightly
@pytest.mark.parametrize(("w", "positive_real"), [(110.0, True), (40.0, False)])
def test_injection_helps_without_limit_only_if_the_loop_is_positive_real(build_fmu: BuildFmu, w, positive_real):
    assert (P95["sigma1"] * servo(w)["Kd"] >= P95["sigma0"]) is positive_real
    errors = [
        rms_error(
            follow(
                build_fmu, "PID", servo(w), reference=SINE, Ts=0.25e-3, inner=4, addition=("LuGreObserver", {"k": k})
            ),
            1.0,
        )
        for k in (0.0, 100.0, 200.0, 800.0, 1600.0)
    ]
    assert errors[2] < errors[1] < errors[0]
    assert (errors[4] < errors[3] < errors[2]) is positive_real
    if not positive_real:
        assert errors[4] > errors[3] > 1.5 * errors[2]


def test_the_observer_removes_hunting_without_an_integrator(build_fmu: BuildFmu):
    """The gains of the 1995 paper: PID hunts for ever, PD with the observer comes to rest at the reference."""
    gains = {"Kp": 3.0, "Kd": 6.0, "m": 1.0}
    step = {"amplitude[1]": 0.0, "offset": 1.0}
    hunting = follow(build_fmu, "PID", gains | {"Ki": 4.0}, reference=step, stop=40.0)
    stuck = follow(build_fmu, "PID", gains | {"Ki": 0.0}, reference=step, stop=40.0)
    helped = follow(build_fmu, "PID", gains | {"Ki": 0.0}, reference=step, stop=40.0, addition=("LuGreObserver", {}))
    late = slice(30000, None)
    assert np.abs(hunting["mass.v"].to_numpy()[late]).max() > 1e-2
    assert abs(float(stuck["mass.x"][-1]) - 1.0) > 0.1
    assert np.abs(helped["mass.x"].to_numpy()[late] - 1.0).max() < 1e-6
