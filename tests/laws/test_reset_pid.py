"""ResetPID: the proof of its page, step by step, the law as a recursion, and hunting."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from observer_loops import follow, run
from scipy.linalg import expm

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
LAW, PID = LAWS["ResetPID"], LAWS["PID"]
BuildFmu = Callable[..., Path]
positive = st.floats(0.01, 100.0)


def weights(a: float, b: float, c: float) -> np.ndarray:
    """V = (I, e, e') P (I, e, e')^T / 2, from the first line of the page."""
    return np.array([[a * c, c, 0.0], [c, a**2 + b, a], [0.0, a, 1.0]])


def flow(a: float, b: float, c: float) -> np.ndarray:
    """I' = e, e' = e', e'' = -a e' - b e - c I."""
    return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-c, -b, -a]])


@given(positive, positive, positive)
def test_between_jumps_v_falls_with_the_square_of_the_error(a, b, c):
    A, P = flow(a, b, c), weights(a, b, c)
    expected = np.diag([0.0, -2.0 * (a * b - c), 0.0])
    np.testing.assert_allclose(A.T @ P + P @ A, expected, atol=1e-9 * (1.0 + np.abs(A).max() * np.abs(P).max()))


@given(positive, positive, positive)
def test_v_is_positive_exactly_where_the_loop_is_stable(a, b, c):
    assume(abs(a * b - c) >= 1e-6 * c)
    minors = [np.linalg.det(weights(a, b, c)[:n, :n]) for n in (1, 2, 3)]
    assert minors[2] == pytest.approx(c * (a * b - c), rel=1e-6, abs=1e-9 * a * c * (a**2 + b))
    stable = bool((np.roots([1.0, a, b, c]).real < 0.0).all())
    assert stable is (a * b > c)
    assert (a * c * (a**2 + b) - c**2 > 0.0 and c * (a * b - c) > 0.0) is stable


@given(positive, positive, positive, *[st.floats(-1.0, 1.0)] * 3, st.floats(0.0, 1.0))
def test_a_jump_never_raises_v(mass, Kd, Ki, e, speed, integral, rho):
    a, c = Kd / mass, Ki / mass
    # the law itself jumps: the last error had the other sign
    values = {"r": e, "v": -speed, "integral": integral, "side": -np.sign(e), "Kd": Kd, "Ki": Ki, "Kp": 1.0}
    wide = {"u_min": -1e9, "u_max": 1e9}
    found = LAW.evaluate(values | wide | {"mass": mass, "rho": rho, "Ts": 1e-3})
    after = found["integral"] - 1e-3 * e
    assert found["jumped"] == float(e != 0.0)
    if e != 0.0:
        P = weights(a, 1.0 / mass, c)
        V = [0.5 * y @ P @ y for y in (np.array([i, e, speed]) for i in (integral, after))]
        expected = -(1.0 - rho**2) * a * c * (integral + e / a) ** 2 / 2.0
        size = V[0] + a * c * (integral + e / a) ** 2 + c * e**2 / a
        assert V[1] - V[0] == pytest.approx(expected, abs=1e-9 * (1.0 + abs(size)))


@pytest.mark.parametrize("rho", [0.0, 0.8, 1.0])
def test_the_linear_loop_stays_stable_with_jumps_at_any_time(rho):
    """In continuous time, with jumps at random instants, by the matrix exponential: V never grows."""
    random = np.random.default_rng(5)
    a, b, c = 6.0, 3.0, 12.0
    y, P, A = np.array([0.3, -1.0, 2.0]), weights(a, b, c), flow(a, b, c)
    first = y @ P @ y
    for _ in range(5000):
        before = y @ P @ y
        if before < 1e-9 * first:
            break
        y = expm(A * random.exponential(0.2)) @ y
        if random.random() < 0.7:
            y[0] = -y[1] / a - rho * (y[0] + y[1] / a)
        assert y @ P @ y <= before * (1.0 + 1e-12)
    assert y @ P @ y < 1e-9 * first


def test_the_sampled_loop_on_the_linear_plant_converges():
    """The law on a mass at 1 kHz: V falls but for terms of the order of Ts, and the error dies."""
    g = {"Kp": 400.0, "Kd": 30.0, "Ki": 6000.0, "mass": 2.0, "rho": 0.9, "r": 1.0, "Ts": 1e-3}
    P = weights(15.0, 200.0, 3000.0)
    x = v = 0.0
    states, V, jumps = {"integral": 0.0, "side": 0.0}, [], 0.0
    for _ in range(6000):
        y = np.array([states["integral"], 1.0 - x, -v])
        V.append(y @ P @ y)
        found = LAW.evaluate({**g, **states, "x": x, "v": v})
        states = {name: found[name] for name in states}
        jumps += found["jumped"]
        x, v = x + 1e-3 * v + 0.5e-6 * found["u"] / 2.0, v + 1e-3 * found["u"] / 2.0
    assert jumps > 3
    assert abs(x - 1.0) < 1e-6
    growth = np.diff(V)
    assert growth[growth > 0.0].sum() < 0.05 * V[0]


def test_without_change_of_sign_it_is_pid():
    random = np.random.default_rng(6)
    samples = [
        {"r": 1.0 + random.random(), "x": random.random(), "rd": random.normal(), "v": random.normal(), "f": 0.5}
        for _ in range(50)
    ]
    gains = {"Kp": 10.0, "Ki": 300.0, "Kd": 3.0, "m": 1.0, "u_max": 60.0}
    for mine, other in zip(run(LAW, samples, **gains), run(PID, samples, **gains), strict=True):
        assert mine["jumped"] == 0.0
        assert all(mine[name] == other[name] for name in ("u", "u_sat", "integral"))


def test_the_sign_is_remembered_through_zero():
    found = run(LAW, [{"r": 1e-3}, {"r": 0.0}, {"r": 0.0}, {"r": -1e-3}, {"r": -1e-3}], Ki=1.0)
    assert [result["jumped"] for result in found] == [0.0, 0.0, 0.0, 1.0, 0.0]
    # 1e-6 m s before; h = 1/190 s e
    h = -1e-3 / 190.0
    assert found[3]["integral"] == pytest.approx(-h - 0.8 * (1e-6 + h) - 1e-6, rel=1e-9)


def test_saturation_reset_and_enable():
    held = run(LAW, [{"r": 1.0}] * 100, u_min=-5.0, u_max=5.0)
    assert all(result["u_sat"] == 1.0 and result["integral"] == 0.0 for result in held)
    on, off = {"r": 1e-3}, {"r": -1e-3, "enable": 0.0}
    fresh = run(LAW, [on])[0]
    found = run(LAW, [on] * 5 + [off, on, on, {"r": -1e-3, "reset": 1.0}, on])
    assert set(found[5].values()) == {0.0}
    assert found[6] == found[9] == fresh
    assert found[8]["jumped"] == found[8]["integral"] == 0.0


PAPER = {"Kp": 3.0, "Kd": 6.0, "Ki": 4.0}


def test_hunting_of_the_1995_gains_disappears(build_fmu: BuildFmu):
    step = {"amplitude[1]": 0.0, "offset": 1.0}
    hunting = follow(build_fmu, "PID", PAPER, reference=step, stop=60.0)
    settled = follow(build_fmu, "ResetPID", PAPER, reference=step, stop=60.0)
    late = slice(40000, None)
    assert np.abs(hunting["mass.x"].to_numpy()[late] - 1.0).max() > 0.05
    assert np.abs(settled["mass.x"].to_numpy()[late] - 1.0).max() < 1e-6
    assert np.abs(settled["mass.v"].to_numpy()[late]).max() < 1e-9
    assert float(settled["servo.jumped"].to_numpy()[late].sum()) == 0.0


def test_coulomb_friction_settles_without_the_creep_of_pid(build_fmu: BuildFmu):
    step = {"amplitude[1]": 0.0, "offset": 1.0}
    plant = {"friction.Fs": 1.0}
    errors = []
    for law in ("PID", "ResetPID"):
        result = follow(build_fmu, law, PAPER, reference=step, start=plant, stop=60.0)
        errors.append(float(np.abs(result["mass.x"].to_numpy()[40000:] - 1.0).max()))
    assert errors[1] < 1e-3 * errors[0]
