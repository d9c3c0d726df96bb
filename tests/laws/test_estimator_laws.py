"""KalmanFriction, PredictiveFilter and DisturbanceObserver against closed forms and independent recursions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import cont2discrete
from thorough import nightly, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.lawkit.law import Kind, Law, discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
KALMAN, PREDICTIVE, OBSERVER = LAWS["KalmanFriction"], LAWS["PredictiveFilter"], LAWS["DisturbanceObserver"]
ESTIMATORS = [KALMAN, PREDICTIVE, OBSERVER]


def run(law: Law, samples: Iterable[dict[str, float]], **parameters: float) -> list[dict[str, float]]:
    """Outputs and next states of consecutive samples."""
    states = {variable.name: variable.start for variable in law.select(Kind.STATE)}
    results = []
    for sample in samples:
        results.append(law.evaluate({**parameters, **states, **sample}))
        states = {name: results[-1][name] for name in states}
    return results


def estimates(law: Law, samples: Iterable[dict[str, float]], **parameters: float) -> np.ndarray:
    return np.array([result["F_hat"] for result in run(law, samples, **parameters)])


def ramp(n: int, c: float, m: float, Ts: float, u: float = 3.0) -> list[dict[str, float]]:
    """Samples of a mass under a constant force and a friction force c t, integrated exactly."""
    t = Ts * np.arange(n)
    v = (u * t - c * t**2 / 2.0) / m
    x = (u * t**2 / 2.0 - c * t**3 / 6.0) / m
    return [{"x": a, "v": b, "u_prev": u} for a, b in zip(x, v, strict=True)]


def of(law: Law, samples: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """The samples without what the law does not read."""
    names = {variable.name for variable in law.given}
    return [{name: value for name, value in sample.items() if name in names} for sample in samples]


# ---- Kalman filter ---------------------------------------------------------------------------------------------------


def model(m: float, Ts: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition and input matrix of position, velocity and force."""
    whole = expm(np.array([[0, 1, 0, 0], [0, 0, -1 / m, 1 / m], [0, 0, 0, 0], [0, 0, 0, 0]]) * Ts)
    return whole[:3, :3], whole[:3, 3]


def steady_gain(m: float, Ts: float, x_noise: float, F_step: float, v_noise: float | None = None) -> np.ndarray:
    """Of the algebraic Riccati equation, in units that make its matrices numbers near 1."""
    units = np.array([Ts**2 / m, Ts / m, 1.0]) * F_step
    A = model(m, Ts)[0] * units / units[:, None]
    C = np.eye(3)[: 1 if v_noise is None else 2]
    R = np.diag((np.array([x_noise, v_noise or 0.0])[: len(C)] / units[: len(C)]) ** 2)
    P = solve_discrete_are(A.T, C.T, np.diag([0.0, 0.0, 1.0]), R)
    return P @ C.T @ np.linalg.inv(C @ P @ C.T + R) * units[:, None] / units[: len(C)]


@pytest.mark.parametrize("v_noise", [None, 1e-4])
@pytest.mark.parametrize(("m", "F_step"), [(2.0, 0.1), (0.1, 0.001), (40.0, 0.1)])
def test_the_gain_tends_to_that_of_the_riccati_equation(m, F_step, v_noise):
    """The law's next states differ by K times the difference of two measurements."""
    Ts, x_noise = 1e-3, 1e-6
    parameters = {"m": m, "x_noise": x_noise, "F_step": F_step}
    if v_noise is not None:
        parameters |= {"v_noise": v_noise, "use_v": 1.0}
    last = run(KALMAN, [{"x": 0.0, "v": 0.0, "u_prev": 0.0}] * 400, **parameters)[-1]
    states = {variable.name: last[variable.name] for variable in KALMAN.select(Kind.STATE)}

    def after(**measured: float) -> np.ndarray:
        found = KALMAN.evaluate({**parameters, **states, **measured})
        return np.array([found["x_hat"], found["v_hat"], found["F_hat"]])

    names = ["x"] if v_noise is None else ["x", "v"]
    found = np.array([after(**{name: 1.0}) - after() for name in names]).T
    np.testing.assert_allclose(found, steady_gain(m, Ts, x_noise, F_step, v_noise), rtol=1e-6)


@pytest.mark.parametrize("use_v", [0.0, 1.0])
def test_the_law_is_the_filter_in_matrices(use_v):
    """The information form of the filter, from the same start."""
    m, Ts, x_noise, v_noise, F_step = 2.0, 1e-3, 1e-6, 1e-4, 0.1
    A, B = model(m, Ts)
    C = np.eye(3)[: 2 if use_v else 1]
    R = np.diag([x_noise**2, v_noise**2][: len(C)])
    random = np.random.default_rng(1)
    x, v, u = random.normal(size=(3, 200)) * [[1e-6], [1e-4], [5.0]]
    samples = [{"x": a, "v": b, "u_prev": c} for a, b, c in zip(x, v, u, strict=True)]
    found = run(KALMAN, samples, m=m, x_noise=x_noise, v_noise=v_noise, F_step=F_step, use_v=use_v)
    state = np.array([x[0], v[0], 0.0])
    P = np.diag([x_noise**2, 2.0 * (x_noise / Ts) ** 2, F_step**2])
    for k in range(200):
        if k:
            state = A @ state + B * u[k]
            P = A @ P @ A.T + np.diag([0.0, 0.0, F_step**2])
        P = np.linalg.inv(np.linalg.inv(P) + C.T @ np.linalg.inv(R) @ C)
        state = state + P @ C.T @ np.linalg.inv(R) @ (np.array([x[k], v[k]])[: len(C)] - C @ state)
        assert found[k]["F_hat"] == pytest.approx(state[2], rel=1e-6, abs=1e-6)
        assert (found[k]["x_hat"], found[k]["v_hat"]) == pytest.approx(state[:2], rel=1e-6, abs=1e-10)


@pytest.mark.parametrize("m", [1.0, 4.0])
def test_kalman_lags_on_a_ramp_by_the_closed_form(m):
    Ts, c = 1e-3, 20.0
    F_hat = estimates(KALMAN, ramp(600, c, m, Ts), m=m, x_noise=1e-6, F_step=0.05)
    _, K2, K3 = steady_gain(m, Ts, 1e-6, 0.05)[:, 0]
    lag = c * Ts * np.arange(600) - F_hat
    assert lag[-1] == pytest.approx(c * (m * abs(K2 / K3) - Ts / 2.0), rel=1e-6)


@nightly
@pytest.mark.parametrize("x_noise", some([1e-15, 1e-9, 1e-3], [1e-9]))
@pytest.mark.parametrize("F_step", [1e-6, 1e3])
def test_extreme_noise_leaves_the_filter_stable(x_noise, F_step):
    """A disturbed start is forgotten; the slowest filter would take longer than is run, and does not grow."""
    samples = [{"x": 1e-3, "u_prev": 0.0}] * 5 + [{"x": 0.0, "u_prev": 0.0}] * 5000
    found = run(KALMAN, samples, x_noise=x_noise, F_step=F_step)
    position = np.abs([result["x_hat"] for result in found])
    assert position.max() < 5e-3
    for name in ("P11", "P22", "P33"):
        assert min(result[name] for result in found) >= 0.0


def test_the_estimate_of_a_constant_force_is_unbiased():
    t = 1e-3 * np.arange(400)
    samples = [{"x": 0.1 - 0.5 * 2.0 * s**2, "v": -2.0 * s, "u_prev": 3.0} for s in t]  # friction 5 N on 1 kg
    assert estimates(KALMAN, samples)[-1] == pytest.approx(5.0, rel=1e-6)
    assert estimates(PREDICTIVE, of(PREDICTIVE, samples))[-1] == pytest.approx(5.0, rel=1e-9)
    assert estimates(OBSERVER, of(OBSERVER, samples))[-1] == pytest.approx(5.0, rel=1e-9)


# ---- predictive filter and disturbance observer ------------------------------------------------------------------


def share(v_noise: float, F_size: float, m: float, Ts: float) -> float:
    R, W = v_noise**2, F_size**-2
    return (Ts / m) ** 2 / ((Ts / m) ** 2 + W * R)


def test_predictive_filter_minimises_its_cost():
    """One sample, on a grid of forces: no other force costs less."""
    m, Ts, v_noise, F_size = 2.0, 1e-3, 2e-3, 3.0
    v_hat, v, u = 0.010, 0.013, 4.0
    parameters = {"m": m, "Ts": Ts, "v_noise": v_noise, "F_size": F_size}
    found = PREDICTIVE.evaluate({**parameters, "v_hat": v_hat, "v": v, "u_prev": u, "running": 1.0})
    forces = found["F_hat"] + np.linspace(-1.0, 1.0, 2001)
    cost = ((v - v_hat - Ts / m * (u - forces)) / v_noise) ** 2 + (forces / F_size) ** 2
    assert np.argmin(cost) == 1000
    assert found["v_hat"] == pytest.approx(v_hat + Ts / m * (u - found["F_hat"]), rel=1e-12)


def test_predictive_filter_lags_on_a_ramp_by_the_closed_form():
    m, Ts, c = 2.0, 1e-3, 20.0
    a = share(1e-3, 2.0, m, Ts)
    samples = of(PREDICTIVE, ramp(300, c, m, Ts))
    F_hat = estimates(PREDICTIVE, samples, m=m, Ts=Ts, v_noise=1e-3, F_size=2.0)
    assert 0.1 < a < 0.9
    assert c * Ts * 299 - F_hat[-1] == pytest.approx(c * Ts * (1.0 / a - 0.5), rel=1e-9)


def test_first_order_observer_is_the_predictive_filter():
    m, Ts = 2.0, 1e-3
    a = share(1e-3, 2.0, m, Ts)
    fq = -math.log(1.0 - a) / (2.0 * math.pi * Ts)
    random = np.random.default_rng(2)
    samples = [{"v": b, "u_prev": c} for b, c in random.normal(size=(500, 2)) * [1e-2, 5.0]]
    by_filter = estimates(PREDICTIVE, samples, m=m, Ts=Ts, v_noise=1e-3, F_size=2.0)
    by_observer = estimates(OBSERVER, samples, m=m, Ts=Ts, fq=fq)
    assert np.abs(by_filter - by_observer).max() < 1e-12 * np.abs(by_observer).max()
    assert np.abs(by_observer).max() > 1.0


@pytest.mark.parametrize("second_order", [0.0, 1.0])
@pytest.mark.parametrize("fq", [3.0, 40.0, 400.0])
def test_observer_is_the_zero_order_hold_of_its_low_pass(second_order, fq):
    m, Ts, w = 3.0, 1e-3, 2.0 * math.pi * fq
    if second_order:
        A, B = np.array([[0.0, 1.0], [-(w**2), -math.sqrt(2.0) * w]]), np.array([[0.0], [w**2]])
    else:
        A, B = np.array([[-w]]), np.array([[w]])
    Ad, Bd, *_ = cont2discrete((A, B, np.eye(len(A)), np.zeros_like(B)), Ts)
    random = np.random.default_rng(3)
    v, u, f = random.normal(size=(3, 300)) * [[1e-2], [5.0], [2.0]]
    samples = [{"v": a, "u_prev": b, "f_prev": c} for a, b, c in zip(v, u, f, strict=True)]
    found = estimates(OBSERVER, samples, m=m, Ts=Ts, fq=fq, second_order=second_order)
    state = np.zeros(len(A))
    expected = [0.0]
    for k in range(1, 300):
        state = Ad @ state + Bd[:, 0] * (u[k] - f[k] - m * (v[k] - v[k - 1]) / Ts)
        expected.append(state[0])
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


def test_observer_estimates_what_the_feedforward_leaves():
    samples = [{"v": 0.02, "u_prev": 5.0, "f_prev": 4.0}] * 300
    assert estimates(OBSERVER, samples)[-1] == pytest.approx(1.0, rel=1e-9)
    assert estimates(OBSERVER, samples, second_order=1.0)[-1] == pytest.approx(1.0, rel=1e-9)


def poles(Kt: float, mass: float, Kp: float, Kd: float, **observer: float) -> np.ndarray:
    """Of a mass on a contact of stiffness Kt under PD control and the observer, whose own samples tell its matrix."""
    A = np.array([[0.0, 1.0], [-Kt / mass, 0.0]])
    plant, force, *_ = cont2discrete((A, np.array([[0.0], [1.0 / mass]]), np.eye(2), np.zeros((2, 1))), 1e-3)
    parameters = {"Ts": 1e-3, "running": 1.0, "u_min": -1e30, "u_max": 1e30, **observer}

    def step(z: np.ndarray) -> np.ndarray:
        x, v, d, rate, v_last, u_prev = z
        states = {"d": d, "d_rate": rate, "v_last": v_last}
        found = OBSERVER.evaluate({**parameters, **states, "v": v, "u_prev": u_prev})
        u = found["u"] - Kp * x - Kd * v
        return np.array([*(plant @ [x, v] + force[:, 0] * u), found["d"], found["d_rate"], found["v_last"], u])

    return np.linalg.eigvals(np.array([step(unit) for unit in np.eye(6)]).T)


@pytest.mark.parametrize("second_order", [0.0, 1.0])
@pytest.mark.parametrize("Kt", [0.0, 1e5, 5e6])
def test_the_loop_is_stable_with_the_stiffness_of_the_contact(Kt, second_order):
    found = poles(Kt, 1.0, 12e3, 190.0, m=1.0, fq=100.0, second_order=second_order)
    assert np.abs(found).max() < 1.0
    # presliding makes it slow, not unstable
    assert np.abs(found).max() > 0.96 or Kt == 0.0


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.5, 4.0])
def test_the_pole_of_a_wrong_mass(ratio):
    a = 0.6
    fq = -math.log(1.0 - a) / (2.0 * math.pi * 1e-3)
    found = poles(0.0, 2.0, 0.0, 0.0, m=2.0 * ratio, fq=fq)
    assert np.abs(found - (1.0 - a * ratio)).min() < 1e-6
    assert (np.abs(found).max() > 1.0 + 1e-6) == (a * ratio > 2.0)


# ---- all of them -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ESTIMATORS, ids=lambda law: law.name)
def test_the_first_sample_takes_the_measurement_over(law):
    busy = of(law, [{"x": 0.3, "v": 0.2, "u_prev": 7.0}])[0]
    first, second = run(law, [busy, busy])
    assert first["F_hat"] == first["u"] == 0.0
    assert second["F_hat"] != 0.0


@pytest.mark.parametrize("law", ESTIMATORS, ids=lambda law: law.name)
def test_reset_and_disable_start_anew(law):
    random = np.random.default_rng(4)
    rows = random.normal(size=(40, 3)) * [1e-4, 1e-2, 1.0]
    samples = of(law, [dict(zip(("x", "v", "u_prev"), row, strict=True)) for row in rows])
    fresh = run(law, samples[20:])
    again = run(law, [*samples[:20], samples[20] | {"reset": 1.0}, *samples[21:]])
    assert again[20:] == fresh
    off = run(law, [*samples[:20], *[sample | {"enable": 0.0} for sample in samples[:5]], *samples[20:]])
    for result in off[20:25]:
        assert not any(result.values())
    assert off[25:] == fresh


@pytest.mark.parametrize("law", ESTIMATORS, ids=lambda law: law.name)
def test_gain_and_limits_do_not_touch_the_estimate(law):
    samples = of(law, ramp(100, 50.0, 1.0, 1e-3))
    full = run(law, samples)
    half = run(law, samples, gain=0.5)
    tight = run(law, samples, u_min=-0.1, u_max=0.1)
    for a, b, c in zip(full, half, tight, strict=True):
        assert a["F_hat"] == b["F_hat"] == c["F_hat"]
        assert b["u"] == 0.5 * a["u"]
        assert c["u"] == min(max(a["u"], -0.1), 0.1)
    assert tight[-1]["u_sat"] == 1.0
