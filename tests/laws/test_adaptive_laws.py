"""AdaptiveLuGre and ANDFC against recursions, matrices and Lyapunov functions, and in the loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from observer_loops import P95, follow, rms_error, run

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws
from harness import Result, SeriesPart

LAWS = {law.name: law for law in discover_laws(laws_folder())}
ADAPTIVE, DUAL = LAWS["AdaptiveLuGre"], LAWS["ANDFC"]
BuildFmu = Callable[..., Path]
s0, s1, s2 = P95["sigma0"], P95["sigma1"], P95["sigma2"]
SINE = {"amplitude[1]": 1e-2, "frequency[1]": 1.0}


def level(v: float) -> float:
    return 1.0 + 0.5 * math.exp(-((v / 1e-3) ** 2))


def bristle(z: float, drive: float, rate: float, Ts: float) -> float:
    """z' = drive - rate z after Ts."""
    return z + Ts * drive if rate == 0.0 else drive / rate + (z - drive / rate) * math.exp(-rate * Ts)


def signals(n: int, seed: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    names = {"r": 1e-2, "rd": 0.05, "rdd": 1.0, "x": 1e-2, "v": 0.05, "u_prev": 2.0}
    return {name: size * random.normal(size=n) for name, size in names.items()}


# ---- AdaptiveLuGre


def test_adaptive_lugre_is_its_recursion():
    n, Ts, limit = 200, 2e-3, 30.0
    given = signals(n, 1)
    given["v"][::7] = 0.0
    del given["u_prev"]
    settings = {"Gamma": 3000.0, "theta0": 1.2, "theta_max": 2.0, "theta_min": 0.5, "gain": 0.9, "m": 2.0}
    samples = [{name: values[k] for name, values in given.items()} for k in range(n)]
    found = run(ADAPTIVE, samples, Ts=Ts, u_min=-limit, u_max=limit, **settings)
    z, theta, limits_met, stops = 0.0, 1.2, set(), 0
    for sample, result in zip(samples, found, strict=True):
        e, ed, v = sample["r"] - sample["x"], sample["rd"] - sample["v"], sample["v"]
        s = ed + 63.0 * e
        rate = s0 * abs(v) / level(v)
        contact = s0 * z + s1 * (v - rate * z)
        friction = theta * contact + s2 * v
        wanted = 2.0 * (sample["rdd"] + 63.0 * ed) + 127.0 * s + 0.9 * friction
        assert result["theta"] == pytest.approx(theta, rel=1e-9)
        assert result["F_hat"] == pytest.approx(friction, abs=1e-9)
        assert result["u"] == pytest.approx(min(max(wanted, -limit), limit), abs=1e-9)
        pushes = abs(wanted) > limit and wanted * s > 0.0
        stops += pushes
        if not pushes:
            theta = min(max(theta + Ts * 3000.0 * s * contact, 0.5), 2.0)
            limits_met |= {theta} & {0.5, 2.0}
        z = bristle(z, v, rate, Ts)
        assert result["z"] == pytest.approx(z, rel=1e-9, abs=1e-17)
    assert limits_met == {0.5, 2.0}
    assert 0 < stops < n


def sliding_modes(Gamma: float, Ks: float, m: float, Ts: float, lam: float) -> np.ndarray:
    """Moduli of the modes (e, ed, theta) of the law on a mass that slides against F_n = 1 N, exact between samples."""
    # a = v' - rdd of the mass under the law, theta counted from its true value
    a = np.array([Ks * lam / m, lam + Ks / m, 1.0 / m])
    e = np.array([1.0, Ts, 0.0]) - 0.5 * Ts**2 * a
    ed = np.array([0.0, 1.0, 0.0]) - Ts * a
    theta = np.array([Ts * Gamma * lam, Ts * Gamma, 1.0])
    return np.sort(np.abs(np.linalg.eigvals(np.array([e, ed, theta]))))


@pytest.mark.parametrize("Gamma", [500.0, 2000.0])
def test_theta_converges_at_the_rate_of_the_sampled_loop(Gamma):
    """On the exact model in steady sliding: to the true value, with the slowest eigenvalue of the loop."""
    v0, Ts, m, true = 0.05, 1e-3, 1.0, 1.5
    steady = level(v0) / s0
    x, v, states = 0.0, v0, {"z": steady, "learned": 0.0}
    errors = []
    for k in range(600):
        found = ADAPTIVE.evaluate({**states, "r": v0 * k * Ts, "rd": v0, "x": x, "v": v, "Gamma": Gamma, "Ts": Ts})
        states = {name: found[name] for name in states}
        errors.append(found["theta"] - true)
        # Coulomb level and viscous friction of the sliding contact, constant over the sample
        force = found["u"] - true * 1.0 - s2 * v
        x, v = x + Ts * v + Ts**2 * force / (2.0 * m), v + Ts * force / m
    slowest = sliding_modes(Gamma, 127.0, m, Ts, 63.0)[-1]
    measured = (errors[400] / errors[200]) ** (1.0 / 200.0)
    assert measured == pytest.approx(slowest, abs=2e-3 * (1.0 - slowest) + 2e-5)
    assert abs(errors[-1]) < 1e-3 * abs(errors[0]) or Gamma == 500.0


@pytest.mark.parametrize("Ks", [50.0, 127.0, 400.0])
@pytest.mark.parametrize("share", [0.9, 1.1])
def test_the_documented_limit_of_adaptation_is_the_limit_of_stability(Ks, share):
    """Gamma F_n^2 Ts < Ks, for lam Ts much below 1."""
    assert bool(sliding_modes(share * Ks / 1e-3, Ks, 1.0, 1e-3, 0.5)[-1] < 1.0) is (share < 1.0)


def loaded(build_fmu: BuildFmu, law: str, settings: dict[str, float]) -> tuple[Result, float, float]:
    """A 50 % step of the normal force at 4 s; the error in the two seconds before, and from 1 s after it on."""
    times = 1e-3 * np.arange(7001)
    load = SeriesPart("load", times, {"Fn": np.where(times < 3.9999, 1.0, 1.5)}, {"Fn": "N"}, interpolation="previous")
    wires = ["load.Fn -> friction.Fn"]
    result = follow(build_fmu, law, settings, reference=SINE, stop=7.0, others=[load], wires=wires)
    return result, rms_error(result.isel(time=slice(2000, 4000))), rms_error(result, 5.0)


def test_after_a_load_step_the_adaptive_law_is_back_within_a_second(build_fmu: BuildFmu):
    result, before, after = loaded(build_fmu, "AdaptiveLuGre", {})
    assert after < 2.0 * before
    assert float(result["servo.theta"][3999]) == pytest.approx(1.0, abs=0.01)
    assert float(result["servo.theta"][-1]) == pytest.approx(1.5, abs=0.01)
    _, before, after = loaded(build_fmu, "AdaptiveLuGre", {"Gamma": 0.0})
    assert after > 30.0 * before


def test_saturation_stops_theta():
    pushed = run(ADAPTIVE, [{"r": 1.0, "v": 1e-3}] * 50, z=1e-5, u_min=-1.0, u_max=1.0)
    assert all(result["theta"] == 1.0 and result["u_sat"] == 1.0 for result in pushed)


# ---- ANDFC


def test_the_velocity_observer_has_two_equal_poles():
    p, columns = math.exp(-300.0 * 1e-3), []
    for unit in ({"x_hat": 1.0, "v_hat": 0.0}, {"x_hat": 0.0, "v_hat": 1.0}):
        found = DUAL.evaluate({**unit, "running": 1.0, "wo": 300.0})
        columns.append([found["x_hat"], found["v_hat"]])
    matrix = np.array(columns).T
    assert np.trace(matrix) == pytest.approx(2.0 * p, rel=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(p**2, rel=1e-12)


def test_the_dual_observer_is_its_recursion():
    n, Ts, m, wo, lam, Ks, k0, k1, top = 200, 1e-3, 2.0, 200.0, 20.0, 30.0, 0.1, 2.0, 2.0
    speeds = np.array([300.0, 3.0, 5.0])
    given = {name: 0.1 * values for name, values in signals(n, 3).items() if name != "v"}
    samples = [{name: values[k] for name, values in given.items()} for k in range(n)]
    settings = {"m": m, "wo": wo, "lam": lam, "Ks": Ks, "k0": k0, "k1": k1, "theta_max": top, "gain": 0.8}
    settings |= {f"Gamma{i}": speeds[i] for i in range(3)}
    found = run(DUAL, samples, Ts=Ts, u_min=-2.0, u_max=2.0, **settings)
    x = v = F = z0 = z1 = 0.0
    thetas, p, stops = np.ones(3), math.exp(-wo * Ts), 0
    for k, (sample, result) in enumerate(zip(samples, found, strict=True)):
        force = (sample["u_prev"] - F) / m
        xp, vp = x + Ts * v + Ts**2 / 2.0 * force, v + Ts * force
        residual = sample["x"] - xp
        x, v = (sample["x"], 0.0) if k == 0 else (xp + (1 - p**2) * residual, vp + (1 - p) ** 2 / Ts * residual)
        a = abs(v) / level(v)
        f = np.array([s0 * z0, -s0 * s1 * a * z1, (s1 + s2) * v])
        bound = top * 1.5 + s2 * abs(v)
        F = min(max(float(thetas @ f), -bound), bound)
        ed = sample["rd"] - v
        s = ed + lam * (sample["r"] - sample["x"])
        wanted = m * (sample["rdd"] + lam * ed) + Ks * s + 0.8 * F
        assert result["v_est"] == pytest.approx(v, rel=1e-9, abs=1e-12)
        assert result["F_hat"] == pytest.approx(F, rel=1e-8, abs=1e-9)
        assert result["u"] == pytest.approx(min(max(wanted, -2.0), 2.0), abs=1e-8)
        assert [result[f"theta_{i}"] for i in range(3)] == pytest.approx(list(thetas), rel=1e-9)
        heard = 0.0 if abs(wanted) > 2.0 and wanted * s > 0.0 else s
        stops += heard == 0.0
        thetas = np.clip(thetas + Ts * speeds * heard * f, 0.0, top)
        z0, z1 = bristle(z0, v + k0 * heard, s0 * a, Ts), bristle(z1, v - k1 * a * heard, s0 * a, Ts)
        assert result["z0"] == pytest.approx(z0, rel=1e-8, abs=1e-15)
        assert result["z1"] == pytest.approx(z1, rel=1e-8, abs=1e-15)
    assert 0 < stops < n


def test_the_lyapunov_function_falls(build_fmu: BuildFmu):
    """At 50 kHz and with a fast velocity observer the law is its continuous form: V never grows, as derived."""
    load, m, lam, k0, k1, speeds = 1.5, 1.0, 63.0, 0.02, 0.5, (2e4, 200.0, 200.0)
    states = [f"servo.{name}" for name in ("z0", "z1", "learned0", "learned1", "learned2")]
    result = follow(
        build_fmu,
        "ANDFC",
        {"wo": 2e5, "theta_max": 1e3} | {f"Gamma{i}": speeds[i] for i in range(3)},
        reference={"amplitude[1]": 1e-2, "frequency[1]": 2.0},
        start={"friction.Fn": load},
        stop=1.0,
        Ts=2e-5,
        inner=1,
        record=[*states, "friction.z"],
    )
    get = {name: result[name].to_numpy() for name in result.data_vars}
    e, ed = get["reference.r"] - get["mass.x"], get["reference.rd"] - get["mass.v"]
    s = ed + lam * e
    true = (load, load, (load * s1 + s2) / (s1 + s2))
    z = get["friction.z"]
    V = m * s**2 / 2.0 + load * s0 * (z - get["servo.z0"]) ** 2 / (2.0 * k0)
    V += load * s0 * s1 * (z - get["servo.z1"]) ** 2 / (2.0 * k1)
    V += sum((true[i] - 1.0 - get[f"servo.learned{i}"]) ** 2 / (2.0 * speeds[i]) for i in range(3))
    growth = np.diff(V)
    assert growth[growth > 0.0].sum() < 0.03 * V[0]
    assert V[-1] < 0.12 * V[0]


def test_the_dual_observer_needs_no_velocity_to_follow_a_load_step(build_fmu: BuildFmu):
    result, before, after = loaded(build_fmu, "ANDFC", {})
    assert after < 4.0 * before
    assert float(result["servo.theta_0"][-1]) == pytest.approx(1.5, abs=0.1)
    _, before, fixed = loaded(build_fmu, "ANDFC", {"Gamma0": 0.0, "Gamma1": 0.0, "Gamma2": 0.0, "k0": 0.0, "k1": 0.0})
    assert fixed > 30.0 * before
    assert fixed > 10.0 * after


@pytest.mark.parametrize("law", [ADAPTIVE, DUAL], ids=lambda law: law.name)
def test_reset_and_enable(law):
    on, off = {"r": 1e-3, "rd": 0.01, "x": 2e-3}, {"r": 1e-3, "rd": 0.01, "x": 2e-3, "enable": 0.0}
    fresh = run(law, [on])[0]
    found = run(law, [on] * 10 + [off] * 2 + [on] + [{**on, "reset": 1.0}])
    thetas = {name for name in found[0] if name.startswith("theta")}
    assert all(value == (1.0 if name in thetas else 0.0) for name, value in found[11].items())
    assert found[12] == fresh
    assert found[13]["u"] == fresh["u"]
    assert all(found[13][name] == 1.0 for name in thetas)
