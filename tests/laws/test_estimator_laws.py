"""KalmanFriction, PredictiveFilter and DisturbanceObserver against closed forms and independent recursions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import cont2discrete

from friction_fmus.catalogue import laws_folder
from friction_fmus.design import kalman_friction_gains
from friction_fmus.errors import FrictionError
from friction_fmus.law import Kind, Law
from friction_fmus.law_files import discover_laws

LAWS = {law.name: law for law in discover_laws(laws_folder())}
KALMAN, PREDICTIVE, OBSERVER = LAWS["KalmanFriction"], LAWS["PredictiveFilter"], LAWS["DisturbanceObserver"]
ESTIMATORS = [KALMAN, PREDICTIVE, OBSERVER]
GAINS = ("K_x", "K_v", "K_F"), ("L_x", "L_v", "L_F")


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


def covariances(m, Ts, position_noise, force_step, velocity_noise=None, n=4000):
    """Filter gain by iterating the covariance recursion, not by the algebraic equation."""
    A = expm(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0 / m], [0.0, 0.0, 0.0]]) * Ts)
    C = np.eye(3)[: 1 if velocity_noise is None else 2]
    R = np.diag([position_noise**2] + ([] if velocity_noise is None else [velocity_noise**2]))
    Q = np.diag([0.0, 0.0, force_step**2])
    P = np.diag([position_noise**2, 1e-4, 1.0])
    for _ in range(n):
        P = A @ P @ A.T + Q
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        I_KC = np.eye(3) - K @ C
        P = I_KC @ P @ I_KC.T + K @ R @ K.T
    return A, K


@pytest.mark.parametrize("velocity_noise", [None, 1e-3])
@pytest.mark.parametrize("m", [0.2, 1.0, 40.0])
def test_gains_are_the_limit_of_the_covariance_recursion(m, velocity_noise):
    noise = (m, 5e-4, 1e-6 / math.sqrt(12.0), 0.05 * m, velocity_noise)
    found = kalman_friction_gains(*noise)
    _, K = covariances(*noise)
    for column, expected in zip(GAINS, K.T, strict=False):
        assert [found[name] for name in column] == pytest.approx(expected, rel=1e-6)
    if velocity_noise is None:
        assert [found[name] for name in GAINS[1]] == [0.0, 0.0, 0.0]


def test_the_start_values_are_the_helpers():
    found = kalman_friction_gains(1.0, 1e-3, 1e-6 / math.sqrt(12.0), 0.03)
    assert {v.name: v.start for v in KALMAN.given if v.name in found} == pytest.approx(found, rel=1e-9)


def test_the_law_is_the_filter_in_matrices():
    m, Ts = 2.0, 1e-3
    gains = kalman_friction_gains(m, Ts, 1e-6, 0.1, 1e-4)
    A, K = covariances(m, Ts, 1e-6, 0.1, 1e-4)
    B = np.array([Ts**2 / (2.0 * m), Ts / m, 0.0])
    random = np.random.default_rng(1)
    x, v, u = random.normal(size=(3, 200)) * [[1e-4], [1e-2], [5.0]]
    found = run(KALMAN, [{"x": a, "v": b, "u_prev": c} for a, b, c in zip(x, v, u, strict=True)], **gains)
    state = np.array([x[0], v[0], 0.0])
    for k in range(1, 200):
        state = A @ state + B * u[k]
        state = state + K @ (np.array([x[k], v[k]]) - state[:2])
        # of the size of what is corrected
        assert found[k]["F_hat"] == pytest.approx(state[2], rel=1e-5, abs=1e-4)
        assert (found[k]["x_hat"], found[k]["v_hat"]) == pytest.approx(state[:2], rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("m", [1.0, 4.0])
def test_kalman_lags_on_a_ramp_by_the_closed_form(m):
    Ts, c = 1e-3, 20.0
    gains = kalman_friction_gains(m, Ts, 1e-6, 0.05)
    F_hat = estimates(KALMAN, ramp(400, c, m, Ts), **gains)
    lag = c * Ts * np.arange(400) - F_hat
    assert lag[-1] == pytest.approx(c * (m * abs(gains["K_v"] / gains["K_F"]) - Ts / 2.0), rel=1e-6)


def test_the_estimate_of_a_constant_force_is_unbiased():
    t = 1e-3 * np.arange(400)
    samples = [{"x": 0.1 - 0.5 * 2.0 * s**2, "v": -2.0 * s, "u_prev": 3.0} for s in t]  # friction 5 N on 1 kg
    assert estimates(KALMAN, samples)[-1] == pytest.approx(5.0, rel=1e-6)
    assert estimates(PREDICTIVE, of(PREDICTIVE, samples))[-1] == pytest.approx(5.0, rel=1e-9)
    assert estimates(OBSERVER, of(OBSERVER, samples))[-1] == pytest.approx(5.0, rel=1e-9)


@pytest.mark.parametrize("bad", [{"m": 0.0}, {"Ts": -1.0}, {"position_noise": math.nan}, {"velocity_noise": 0.0}])
def test_arguments_of_the_gains_are_checked(bad):
    good = {"m": 1.0, "Ts": 1e-3, "position_noise": 1e-6, "force_step": 0.1}
    (name,) = bad
    with pytest.raises(FrictionError, match=rf"{name} = .* must be positive and finite"):
        kalman_friction_gains(**good | bad)


def test_noise_without_a_filter_is_refused():
    with pytest.raises(FrictionError, match="no stable filter"):
        kalman_friction_gains(1.0, 1e-3, 1e-3, 1e-9)


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
