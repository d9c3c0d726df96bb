"""PID, CascadePPI and StaticFeedforward against closed forms."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from thorough import few, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import VECTORS, Kind, Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
PID, CASCADE, STATIC = LAWS["PID"], LAWS["CascadePPI"], LAWS["StaticFeedforward"]
SERVOS = [PID, CASCADE]
WIDE = {"u_min": -1e30, "u_max": 1e30}
finite = st.floats(-1e3, 1e3)
LIMITED = [law for law in LAWS.values() if any(variable.name == "u_min" for variable in law.variables)]


def run(law: Law, samples: Iterable[dict[str, float]], **parameters: float) -> list[dict[str, float]]:
    """Outputs and next states of consecutive samples."""
    known = law.select(Kind.STATE, Kind.STATES)
    states = {v.name: parameters.pop(v.name, v.starts if v.kind in VECTORS else v.start) for v in known}
    results = []
    for sample in samples:
        results.append(law.evaluate({**parameters, **states, **sample}))
        states = {name: results[-1][name] for name in states}
    return results


@given(*[finite] * 6)
def test_pd_is_pid_without_integral(r, rd, rdd, x, v, f):
    found = PID.evaluate(WIDE | dict(r=r, rd=rd, rdd=rdd, x=x, v=v, f=f, Kp=3.0, Kd=6.0, Ki=0.0, m=2.0, integral=1e9))
    assert found["u"] == pytest.approx(3.0 * (r - x) + 6.0 * (rd - v) + 2.0 * rdd + f, rel=1e-12, abs=1e-9)
    assert found["u_sat"] == 0.0


def test_the_integral_is_the_sum_of_the_errors_before():
    errors = np.random.default_rng(1).normal(size=50)
    found = run(PID, [{"r": e} for e in errors], Kp=0.0, Kd=0.0, Ki=2.0, Ts=0.1, **WIDE)
    sums = np.concatenate([[0.0], np.cumsum(errors)[:-1]])
    assert [result["u"] for result in found] == pytest.approx(2.0 * 0.1 * sums, rel=1e-12, abs=1e-12)


@settings(max_examples=few(30), deadline=20_000)
@given(st.integers(0, 10**6), st.floats(1.0, 100.0), st.floats(1.0, 500.0), st.floats(0.0, 1e4), st.floats(1e-4, 1e-2))
def test_cascade_is_pid_with_other_gains(seed, kp, kv, ki, Ts):
    random = np.random.default_rng(seed)
    x, r, rdd, f = random.normal(size=(4, 60))
    e = r - x
    slope = np.append(np.diff(e), 0.0) / Ts
    v = random.normal(size=60)
    samples = [{"r": r[k], "x": x[k], "rd": v[k] + slope[k], "v": v[k], "rdd": rdd[k], "f": f[k]} for k in range(60)]
    gains = {"Kp": kv * kp + ki, "Kd": kv, "Ki": ki * kp}
    cascade = run(CASCADE, samples, kp=kp, kv=kv, ki=ki, m=2.0, Ts=Ts, integral=e[0], **WIDE)
    pid = run(PID, samples, **gains, m=2.0, Ts=Ts, **WIDE)
    # relative to the terms of the sum, which cancel
    scale = np.array(
        [gains["Kp"] * np.abs(e).max(), kv * np.abs(slope).max(), gains["Ki"] * Ts * np.abs(e).sum()]
    ).sum()
    difference = np.array([a["u"] - b["u"] for a, b in zip(cascade, pid, strict=True)])
    assert np.abs(difference).max() < 1e-12 * scale


@pytest.mark.parametrize("law", SERVOS, ids=lambda law: law.name)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_saturation_stops_the_integral_and_lets_it_go_at_once(law, side):
    limits = {"u_min": -5.0, "u_max": 5.0}
    gains = {"Kp": 100.0, "Ki": 1000.0, "Kd": 0.0} if law is PID else {"kp": 10.0, "kv": 10.0, "ki": 100.0}
    held = run(law, [{"r": side}] * 1000, **gains, **limits)
    assert all(result["u"] == 5.0 * side and result["u_sat"] == side for result in held)
    assert all(result["integral"] == 0.0 for result in held)
    # the error changes sign: the output leaves the limit in that sample, and the integral moves the other way
    after = run(law, [{"r": -0.01 * side}], **gains, **limits)
    assert abs(after[0]["u"]) < 5.0
    assert after[0]["integral"] * side < 0.0
    # a limit that is active against the error does not stop it
    against = run(law, [{"r": side, "f": -1e6 * side}], **gains, **limits)
    assert against[0]["u_sat"] == -side
    assert against[0]["integral"] * side > 0.0


def test_a_saturated_step_does_not_overshoot_like_one_that_winds_up():
    """A mass under PID with a weak actuator: with anti-windup the overshoot is a fraction."""

    def overshoot(stops: bool) -> float:
        x = v = integral = highest = 0.0
        for _ in range(4000):
            values = {"r": 0.1, "x": x, "v": v, "integral": integral, "u_min": -2.0, "u_max": 2.0}
            found = PID.evaluate(values | {"Kp": 400.0, "Kd": 40.0, "Ki": 800.0})
            integral = found["integral"] if stops else integral + 1e-3 * (0.1 - x)
            x, v = x + 1e-3 * v + 0.5e-6 * found["u"], v + 1e-3 * found["u"]
            highest = max(highest, x)
        assert abs(x - 0.1) < 1e-2 or not stops
        return highest - 0.1

    assert overshoot(stops=True) < 0.6 * overshoot(stops=False)


@pytest.mark.parametrize("law", SERVOS, ids=lambda law: law.name)
def test_reset_acts_in_its_own_sample(law):
    busy = [{"r": 1e-3}] * 10
    found = run(law, [*busy, {"r": 1e-3, "reset": 1.0}, {"r": 1e-3}])
    fresh = run(law, [{"r": 1e-3}])[0]
    assert found[9]["integral"] != 0.0
    assert found[10]["u"] == fresh["u"]
    assert found[10]["integral"] == 0.0
    assert found[11] == fresh


@pytest.mark.parametrize("law", SERVOS, ids=lambda law: law.name)
def test_disabled_it_is_silent_and_comes_back_fresh(law):
    on, off = {"r": 1e-3, "f": 3.0}, {"r": 0.5, "f": 3.0, "enable": 0.0}
    found = run(law, [on] * 10 + [off] * 1000 + [on])
    for result in found[10:-1]:
        assert {"u", "u_sat", "integral"} <= result.keys()
        assert not any(result.values())
    assert found[-1] == run(law, [on])[0]
    # without a jump, when the reference starts where the axis stands
    standing = {"r": 0.2, "x": 0.2}
    assert run(law, [on] * 10 + [standing | {"enable": 0.0}, standing])[-1]["u"] == 0.0


@pytest.mark.parametrize("law", some(LIMITED, LIMITED[::5]), ids=lambda law: law.name)
@given(st.data())
@settings(max_examples=few(50), deadline=20_000)
def test_outputs_stay_within_the_limits(law, data):
    values = {
        variable.name: data.draw(st.floats(max(-1e6, variable.min), min(1e6, variable.max)), variable.name)
        for variable in law.select(Kind.INPUT, Kind.OPTIONAL, Kind.STATE)
    }
    found = law.evaluate(values | {"u_min": -7.0, "u_max": 3.0})
    assert -7.0 <= found["u"] <= 3.0
    assert found["u_sat"] in (-1.0, 0.0, 1.0)
    assert found["u_sat"] != 1.0 or found["u"] == 3.0
    assert found["u_sat"] != -1.0 or found["u"] == -7.0


@pytest.mark.parametrize("law", LIMITED, ids=lambda law: law.name)
def test_nan_is_never_made_a_force(law):
    """clip by fmin and fmax would turn a NaN measurement into the full force, in this sample or through the states."""
    name = law.select(Kind.INPUT, Kind.OPTIONAL)[0].name
    first, second = run(law, [{name: math.nan}, {}])
    assert math.isnan(first["u"]) or (first["u"] == law.evaluate({})["u"] and math.isnan(second["u"]))


def stribeck(rd, p):
    side = "_neg" if p["asymmetric"] and rd < 0.0 else ""
    Fc, Fs, Fv, vs, delta = (p[name + side] for name in ("Fc", "Fs", "Fv", "vs", "delta"))
    level = Fc + (Fs - Fc) * math.exp(-((abs(rd) / vs) ** delta)) if rd else 0.0
    return math.copysign(level, rd) + Fv * rd + p["offset"]


@given(st.floats(-0.1, 0.1), st.floats(-50.0, 50.0), st.booleans(), st.floats(0.0, 1.0), st.floats(0.0, 40.0))
def test_static_feedforward_is_its_formula(rd, rdd, asymmetric, gain, Fs):
    p = {
        "asymmetric": float(asymmetric),
        "gain": gain,
        "m": 95.0,
        "Fc": 20.4,
        "Fs": Fs,
        "Fv": 203.5,
        "vs": 2e-3,
        "delta": 0.7,
    }
    p |= {"offset": -3.2, "Fc_neg": 15.0, "Fs_neg": 10.0, "Fv_neg": 150.0, "vs_neg": 5e-3, "delta_neg": 2.0}
    found = STATIC.evaluate({**p, "rd": rd, "rdd": rdd, **WIDE})
    assert found["F_hat"] == pytest.approx(stribeck(rd, p), rel=1e-12, abs=1e-12)
    assert found["u"] == pytest.approx(95.0 * rdd + gain * stribeck(rd, p), rel=1e-12, abs=1e-9)


@given(st.floats(-10.0, 10.0), st.floats(-100.0, 100.0))
def test_static_feedforward_is_odd_without_offset(rd, rdd):
    forward, backward = (STATIC.evaluate({"rd": s * rd, "rdd": s * rdd}) for s in (1.0, -1.0))
    assert {name: -value for name, value in backward.items()} == forward


def test_at_rest_only_the_offset_is_compensated():
    assert STATIC.evaluate({"rd": 0.0, "offset": -3.0})["F_hat"] == -3.0
    assert STATIC.evaluate({"rd": 1e-300})["F_hat"] == 1.5


@pytest.mark.parametrize("rd", [1e-300, 1e-12, 1.0, 1e300])
@pytest.mark.parametrize("delta", [1e-3, 2.0, 100.0])
@pytest.mark.parametrize("vs", [1e-12, 1e3])
def test_static_feedforward_is_finite_for_extreme_parameters(rd, delta, vs):
    found = STATIC.evaluate({"rd": -rd, "delta": delta, "vs": vs, "delta_neg": 2.0, "vs_neg": 1e-3, "asymmetric": 1.0})
    assert all(map(math.isfinite, found.values()))


@pytest.mark.parametrize("name", ["StaticFeedforward", "CoulombFeedforward"])
def test_the_rounding_of_a_resting_reference_is_no_motion(name):
    """Motion profiles rest with velocities such as 8e-17 m/s: the sign alone would give the whole friction force."""
    for rd, v_rest, moves in ((8e-17, 0.0, True), (8e-17, 1e-9, False), (-1e-9, 1e-9, False), (-2e-9, 1e-9, True)):
        own = {"Fs": 3.0} if name == "StaticFeedforward" else {}
        (found,) = run(LAWS[name], [{"rd": rd}], Fc=3.0, v_rest=v_rest, m=0.0, **own)
        assert found["F_hat"] == pytest.approx(math.copysign(3.0, rd) if moves else 0.0, abs=1e-6)


def test_static_feedforward_disabled_is_silent():
    assert STATIC.evaluate({"rd": 1.0, "rdd": 5.0, "enable": 0.0}) == {"u": 0.0, "F_hat": 0.0, "u_sat": 0.0}
