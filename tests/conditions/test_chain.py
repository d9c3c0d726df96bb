"""The whole sampled loop against simulations in fine steps, and the laws' linear parts against the laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import bilinear, butter, cont2discrete, lfilter

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.conditions import (
    PathDynamics,
    SampledLaw,
    chain,
    closed_loop,
    loop_poles,
    on_bristles,
    one_mass,
    two_masses,
)
from friction_fmus.conditions.chain import loop_margins, open_loop
from friction_fmus.conditions.condition import spectral_radius
from friction_fmus.lawkit.law import Kind, discover_laws
from friction_fmus.study.margins import linearised, local_function

KNOWN_LAWS = {law.name: law for law in discover_laws(laws_folder())}
TS, FINE = 1e-3, 20


def pd(Kp: float, Kd: float) -> SampledLaw:
    return SampledLaw(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros(0), np.array([-Kp, -Kd, 0.0]))


def poles(matrix: np.ndarray) -> np.ndarray:
    """The eigenvalues apart from 0, sorted."""
    found = np.linalg.eigvals(matrix)
    return np.sort_complex(found[np.abs(found) > 1e-6])


def test_without_anything_else_it_is_the_loop_of_the_pid() -> None:
    law = linearised("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 250e3}, TS)
    expected = np.linalg.eigvals(closed_loop(1.0, 0.4, 12e3, 190.0, 250e3, TS))
    assert poles(chain(one_mass(1.0, 0.4), [law], TS)) == pytest.approx(np.sort_complex(expected), abs=1e-9)


@pytest.mark.parametrize("Kt", [0.0, 1e5])
@pytest.mark.parametrize("m_model", [0.5, 1.0, 4.0, 9.0])
@pytest.mark.parametrize("Ki", [0.0, 2e5])
def test_disturbance_observer_loop_is_its_recursion(Kt: float, m_model: float, Ki: float) -> None:
    """The observer sample by sample on a plant that scipy discretises: the same growth, the same verdict."""
    m, Kp, Kd, fq, Ts, gain = 1.0, 12e3, 150.0, 60.0, 1e-3, 0.9
    damping = 300.0 if Kt else 0.4
    continuous = (
        np.array([[0.0, 1.0], [-Kt / m, -damping / m]]),
        np.array([[0.0], [1.0 / m]]),
        np.eye(2),
        np.zeros((2, 1)),
    )
    A, column, *_ = cont2discrete(continuous, Ts)
    b = column[:, 0]
    a = 1.0 - math.exp(-2.0 * math.pi * fq * Ts)
    state, d, integral, u, last = np.array([1.0, 0.3]), 0.0, 0.0, None, 0.0
    norms = []
    for _ in range(6000):
        if u is not None:
            d += a * (u - m_model * (state[1] - last) / Ts - d)
        u = -Kp * state[0] - Kd * state[1] + Ki * integral + gain * d
        integral -= Ts * state[0]
        last, state = state[1], A @ state + b * u
        norms.append(float(np.linalg.norm(state)))
        if not 1e-60 < norms[-1] < 1e60:
            break
    half = len(norms) // 2
    grown = np.log(max(norms[-200:]) / max(norms[half : half + 200])) / (len(norms) - half - 200)
    laws = [linearised("PID", {"Kp": Kp, "Kd": Kd, "Ki": Ki}, Ts)]
    laws.append(linearised("DisturbanceObserver", {"m": m_model, "fq": fq, "gain": gain}, Ts))
    found = loop_poles(one_mass(m, damping, Kt), lambda _: laws, Ts)
    assert found.ok == (grown < 0.0)
    if len(norms) == 6000:
        assert math.log(found.value) == pytest.approx(grown, abs=3e-4)


@pytest.mark.parametrize("delay", [0.0, 0.35e-3, 1e-3, 2.6e-3])
@pytest.mark.parametrize("tau", [0.0, 0.7e-3])
@pytest.mark.parametrize("window", [0, 1, 3])
def test_lag_delay_and_encoder_as_in_a_simulation_in_fine_steps(delay: float, tau: float, window: int) -> None:
    """Motor and load under PD, the delay counted in steps of Ts/20; velocities by difference of kept positions."""
    m1, m2, k, d, Kp, Kd = 0.6, 0.4, 2e4, 8.0, 900.0, 30.0
    A = np.array([[0, 1, 0, 0], [-k / m1, -d / m1, k / m1, d / m1], [0, 0, 0, 1], [k / m2, d / m2, -k / m2, -d / m2]])
    step, push, *_ = cont2discrete((A, np.array([[0], [1 / m1], [0], [0]]), np.eye(4), np.zeros((4, 1))), TS / FINE)
    state, lagged, line = np.array([1e-3, 0.0, 1e-3, 0.0]), 0.0, [0.0] * 200
    positions = [0.0] * 3
    mine = np.zeros(len(chain(two_masses(m1, m2, k, d), [pd(Kp, Kd)], TS, PathDynamics(tau, delay, window))))
    mine[:4] = state
    if tau:
        # the lag moves within a fine step as well: both as one system
        A = np.block([[A, np.array([[0], [1 / m1], [0], [0]])], [np.zeros((1, 4)), np.array([[-1 / tau]])]])
        step, push, *_ = cont2discrete((A, np.array([[0]] * 4 + [[1 / tau]]), np.eye(5), np.zeros((5, 1))), TS / FINE)
        state = np.append(state, lagged)
    matrix = chain(two_masses(m1, m2, k, d), [pd(Kp, Kd)], TS, PathDynamics(tau, delay, window))
    for _ in range(40):
        v = (state[0] - positions[-window]) / (window * TS) if window else state[1]
        positions.append(state[0])
        u = -Kp * state[0] - Kd * v
        for _ in range(FINE):
            line.append(u)
            state = step @ state + push[:, 0] * line[-1 - round(delay / TS * FINE)]
        mine = matrix @ mine
    assert mine[: len(state)] == pytest.approx(state, rel=1e-7, abs=1e-12)


FILTERS = PathDynamics(
    delay=TS,
    window=2,
    lowpass=tuple(butter(2, 60.0, fs=1.0 / TS)),
    notch=bilinear([1.0, 20.0, 500.0**2], [1.0, 500.0, 500.0**2], 1.0 / TS),
)


def test_filters_of_velocity_and_force_are_those_of_scipy() -> None:
    """The whole past is filtered again in each sample."""
    matrix = chain(one_mass(1.0, 2.0), [pd(900.0, 20.0)], TS, FILTERS)
    A, b = cont2discrete((np.array([[0, 1], [0, -2.0]]), np.array([[0], [1.0]]), np.eye(2), np.zeros((2, 1))), TS)[:2]
    state, mine, x, u = np.array([1.0, 0.0]), np.zeros(len(matrix)), [0.0, 0.0], [0.0]
    mine[0] = 1.0
    for _ in range(60):
        x.append(state[0])
        v = lfilter(*FILTERS.lowpass, (np.array(x[2:]) - x[:-2]) / (2.0 * TS))[-1]
        u.append(-900.0 * state[0] - 20.0 * v)
        state = A @ state + b[:, 0] * lfilter(*FILTERS.notch, u)[-2]  # a sample late
        mine = matrix @ mine
    assert mine[:2] == pytest.approx(state, rel=1e-9)


def test_the_open_loop_with_filters_is_minus_one_at_the_edge_of_stability() -> None:
    plant = one_mass(1.0, 2.0)

    def stable(gain: float) -> bool:
        return spectral_radius(chain(plant, [pd(900.0 * gain, 20.0 * gain)], TS, FILTERS)) < 1.0

    low, high = 1.0, 100.0
    assert stable(low)
    assert not stable(high)
    while high - low > 1e-9:
        low, high = ((low + high) / 2.0, high) if stable((low + high) / 2.0) else (low, (low + high) / 2.0)
    z = np.exp(1j * np.linspace(1e-3, np.pi, 200_001))
    L = open_loop(plant, [pd(900.0 * low, 20.0 * low)], TS, FILTERS, z)
    assert np.min(np.abs(1.0 + L)) < 1e-4
    assert loop_margins(plant, [pd(900.0, 20.0)], TS, FILTERS).stable


LAWS: dict[str, dict[str, float | tuple[float, ...]]] = {
    "CascadePPI": {},
    "ExtendedStateObserver": {},
    "KalmanFriction": {},
    "PredictiveFilter": {},
    "DisturbanceObserver": {"second_order": 1.0},
}


@pytest.mark.parametrize("name", LAWS)
def test_a_linear_part_answers_a_small_signal_as_the_law_does(name: str) -> None:
    """From the state in which the law has settled, over twenty samples of noise of some picometres."""
    law, values = KNOWN_LAWS[name], LAWS[name]
    linear = linearised(name, values, TS)
    inputs = [key for key in ("x", "v", "u_prev") if key in {variable.name for variable in law.given}]
    states = {variable.name: variable.start for variable in law.select(Kind.STATE, Kind.STATES)}
    for _ in range(600):
        found = law.evaluate({**values, **states})
        states = {key: found[key] for key in states}
    random, own = np.random.default_rng(4), np.zeros(len(linear.C))
    for _ in range(20):
        signal = {"x": random.normal() * 1e-13, "v": random.normal() * 1e-11, "u_prev": random.normal() * 1e-8}
        found = law.evaluate({**values, **states, **{key: signal[key] for key in inputs}})
        states = {key: found[key] for key in states}
        y = np.array([signal["x"], signal["v"], signal["u_prev"] if "u_prev" in inputs else 0.0])
        expected = float(linear.C @ own + linear.D @ y)
        own = linear.A @ own + linear.B @ y
        assert found["u"] == pytest.approx(expected, rel=2e-3, abs=1e-13)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("window", [1, 2, 7])
def test_local_function_is_a_fit_of_a_polynomial_to_means(degree: int, window: int) -> None:
    """A force t^degree on a mass at rest in position: its means over intervals give its value at the end."""
    p = {"window": float(window), "degree": float(degree), "m": 2.0, "gain": 1.0}
    law, own, power = local_function(p, TS), np.zeros(window), min(degree, window - 1)
    v, random = 0.0, np.random.default_rng(5)
    for k in range(1, 3 * window + 3):
        u, mean = random.normal(), (k ** (power + 1) - (k - 1) ** (power + 1)) / (power + 1)
        v += TS / 2.0 * (u - mean)
        y = np.array([0.0, v, u])
        found = law.C @ own + law.D @ y
        own = law.A @ own + law.B @ y
    assert found == pytest.approx(float(k**power), rel=1e-6)


def test_what_is_advised_for_the_gains_is_the_edge() -> None:
    Kp, Kd = 12e3, 2500.0
    share = float(loop_poles(one_mass(1.0), lambda _: [pd(Kp, Kd)], TS).change.split("below ")[1].split(" of")[0])
    for times, ok in ((0.98, True), (1.02, False)):
        assert loop_poles(one_mass(1.0), lambda _, k=times * share: [pd(k * Kp, k * Kd)], TS).ok == ok  # type: ignore[misc]
    hopeless = loop_poles(one_mass(1.0), lambda _: [pd(Kp, -1.0)], TS)
    assert "no common factor" in hopeless.change


def growth(Kp: float, Kd: float, Ki: float, Ts: float) -> float:
    """Growth for each sample of a free mass of 1 kg under PID, from a simulation in closed form."""
    x, v, integral, norms = 1.0, 0.0, 0.0, []
    for _ in range(4000):
        u = -Kp * x - Kd * v + Ki * integral
        x, v, integral = x + Ts * v + Ts**2 / 2.0 * u, v + Ts * u, integral - Ts * x
        norms.append(math.hypot(x, v, Ki * integral))
        if not 1e-100 < norms[-1] < 1e100:
            break
    half = len(norms) // 2
    return float((norms[-1] / norms[half]) ** (1.0 / (len(norms) - 1 - half)))


@pytest.mark.parametrize("gains", [(12e3, 190.0, 250e3), (12e3, 600.0, 0.0), (3.0, 6.0, 4.0)])
def test_the_sample_time_that_is_advised_is_the_edge_of_stability(gains: tuple[float, float, float]) -> None:
    values = dict(zip(("Kp", "Kd", "Ki"), gains, strict=True))
    slow = loop_poles(one_mass(1.0), lambda Ts: [linearised("PID", values, Ts)], 10.0 / gains[1])
    assert not slow.ok
    edge = float(slow.change.split("sample faster than every ")[1].split(" s")[0])
    assert growth(*gains, 0.98 * edge) < 1.0 < growth(*gains, 1.02 * edge)


def test_what_is_advised_for_a_delay_is_the_edge() -> None:
    law = pd(12e3, 600.0)
    slow = loop_poles(one_mass(1.0, 0.4), lambda _: [law], TS, PathDynamics(delay=4e-3))
    assert not slow.ok
    edge = float(slow.change.split("below ")[-1].split(" s")[0])
    assert loop_poles(one_mass(1.0, 0.4), lambda _: [law], TS, PathDynamics(delay=0.98 * edge)).ok
    assert not loop_poles(one_mass(1.0, 0.4), lambda _: [law], TS, PathDynamics(delay=1.02 * edge)).ok


@pytest.mark.parametrize("v", [2e-4, 7e-4, 3e-3])
def test_bristles_of_a_sliding_mass_are_linearised_right(v: float) -> None:
    """Against differences of LuGre's equations."""
    s0, s1, Fc, Fs, vs = 1e5, 316.0, 1.0, 1.5, 1e-3

    def g(v: float) -> float:
        return Fc + (Fs - Fc) * np.exp(-((v / vs) ** 2))

    def rates(y: np.ndarray) -> np.ndarray:
        rate = y[1] - s0 * abs(y[1]) / g(y[1]) * y[2]
        return np.array([y[1], -(s0 * y[2] + s1 * rate + 0.4 * y[1]) / 2.0, rate])

    centre = np.array([0.0, v, g(v) / s0])
    sizes = np.diag([1e-6, 1e-4 * v, 1e-4 * centre[2]])
    expected = np.array([(rates(centre + d) - rates(centre - d)) / (2 * d.sum()) for d in sizes]).T
    slope = -2.0 * (Fs - Fc) * v / vs**2 * np.exp(-((v / vs) ** 2))
    found = on_bristles(one_mass(2.0, 0.4), 1, 2.0, s0, s1, g(v), slope, v)
    assert pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max()) == found.A
    assert spectral_radius(chain(found, [pd(3e3, 200.0)], TS)) > 0.0
