"""Each condition against an independent computation: roots, simulations, grids of frequency and speed."""

from __future__ import annotations

import inspect
import math
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete
from thorough import some

from friction_fmus import conditions
from friction_fmus.blocks.axis_units import TURNING
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.conditions import (
    Condition,
    closed_loop,
    contraction,
    expected_slip,
    hunting,
    learning_filter,
    overcompensation,
    routh,
    sampled_sensitivity,
    steepest_fall,
    stick_slip_free,
)
from friction_fmus.lawkit.law import discover_laws


def discretised(m: float, damping: float, Ts: float) -> tuple[np.ndarray, np.ndarray]:
    """A mass with a damper under a held force, by scipy."""
    A, b = np.array([[0.0, 1.0], [0.0, -damping / m]]), np.array([[0.0], [1.0 / m]])
    found = cont2discrete((A, b, np.eye(2), np.zeros((2, 1))), Ts)
    return found[0], found[1][:, 0]


P95 = {"Fc": 1.0, "Fs": 1.5, "vs": 1e-3}
"""Table I of the LuGre paper of 1995; sigma1 is the root of sigma0 = 1e5 N/m."""

PID = next(law for law in discover_laws(laws_folder()) if law.name == "PID")


def number_after(words: str, text: str) -> float:
    """The number that a text advises."""
    found = re.search(rf"{words} ([-+.\de]+)", text)
    assert found is not None, text
    return float(found[1])


def test_routh_is_what_the_roots_of_the_polynomial_say() -> None:
    random = np.random.default_rng(1)
    verdicts = []
    for _ in range(500):
        m, s2, Kd = random.uniform(0.1, 3.0), random.uniform(0.0, 2.0), random.uniform(-1.0, 5.0)
        Kp, Ki = random.uniform(-5.0, 20.0), random.choice([0.0, random.uniform(0, 60)])
        roots = np.roots([m, Kd + s2, Kp, Ki] if Ki else [m, Kd + s2, Kp])
        verdicts.append(routh(m, s2, Kp, Kd, Ki).ok)
        assert verdicts[-1] == bool(roots.real.max() < 0.0)
    assert 100 < sum(verdicts) < 400


def test_what_routh_advises_is_the_edge_of_stability() -> None:
    m, s2, Kp, Kd, Ki = 1.0, 0.4, 3.0, 1.0, 10.0
    advice = routh(m, s2, Kp, Kd, Ki).change
    most, least = number_after("lower Ki below", advice), number_after("raise Kd above", advice)
    for gains in ([m, Kd + s2, Kp, most], [m, least + s2, Kp, Ki]):
        assert np.roots(gains).real.max() == pytest.approx(0.0, abs=1e-3)


def test_sampled_loop_is_the_law_with_a_held_mass() -> None:
    """The matrix against the law PID, evaluated by casadi, around a mass that scipy discretises."""
    m, s2, Kp, Kd, Ki, Ts = 2.0, 3.0, 700.0, 40.0, 900.0, 4e-3
    A, b = discretised(m, s2, Ts)
    state, integral = np.array([1.0, -2.0]), 0.3
    matrix, mine = closed_loop(m, s2, Kp, Kd, Ki, Ts), np.array([1.0, -2.0, 0.3])
    for _ in range(20):
        values = {"x": state[0], "v": state[1], "integral": integral, "Kp": Kp, "Kd": Kd, "Ki": Ki, "Ts": Ts}
        found = PID.evaluate({**values, "u_min": -1e9, "u_max": 1e9})
        state, integral = A @ state + b * found["u"], found["integral"]
        mine = matrix @ mine
    assert mine == pytest.approx([*state, integral], rel=1e-9)


def fall_on_a_grid(Fc: float, Fs: float, vs: float, delta: float) -> float:
    v = vs * np.geomspace(1e-6, 20.0, 200_001)
    return float(np.max(-np.diff(Fc + (Fs - Fc) * np.exp(-((v / vs) ** delta))) / np.diff(v)))


@pytest.mark.parametrize("delta", [1.0, 1.3, 2.0, 3.5, 10.0])
def test_steepest_fall_is_that_of_the_curve(delta: float) -> None:
    assert steepest_fall(2.0, 3.0, 0.01, delta) == pytest.approx(fall_on_a_grid(2.0, 3.0, 0.01, delta), rel=1e-4)


def test_numbers_of_the_lugre_paper() -> None:
    assert steepest_fall(**P95) == pytest.approx(math.sqrt(2.0 / math.e) * 0.5 / 1e-3)
    assert steepest_fall(**P95) == pytest.approx(429.0, abs=0.2)  # N.s/m


def test_curves_that_do_not_fall_or_fall_at_once() -> None:
    assert steepest_fall(2.0, 2.0, 0.01) == 0.0
    assert steepest_fall(2.0, 1.0, 0.01) == 0.0
    assert steepest_fall(1.0, 2.0, 0.01, 0.5) == math.inf
    assert "no Kd suffices" in stick_slip_free(1e6, 0.0, 1.0, 2.0, 0.01, 0.5).change


@pytest.mark.parametrize("Ki", [0.0, 40.0])
@pytest.mark.parametrize("Kd", [400.0, 428.0, 429.0, 430.0, 440.0])
def test_stick_slip_is_what_the_roots_at_all_speeds_say(Kd: float, Ki: float) -> None:
    """m s^3 + (Kd + s2 + g'(v)) s^2 + Kp s + Ki, linearised at each speed."""
    m, s2, Kp = 1.0, 0.4, 20.0
    speeds = 1e-3 * np.linspace(0.01, 5.0, 2000)
    slopes = -2.0 * 0.5 * speeds / 1e-6 * np.exp(-((speeds / 1e-3) ** 2))
    worst = max(np.roots([m, Kd + s2 + slope, Kp, *([Ki] if Ki else [])]).real.max() for slope in slopes)
    assert stick_slip_free(Kd, s2, **P95, integral=m * Ki / Kp).ok == (worst < 0.0)


def test_hunting_needs_an_integral_and_a_step_of_friction() -> None:
    assert not hunting(4.0, 1.0, 1.5).ok
    assert hunting(0.0, 1.0, 1.5).ok
    assert hunting(4.0, 1.0, 1.0).ok


def slip(m: float, s2: float, Kp: float, Kd: float, drop: float) -> float:
    """The same by an integrator that stops where the velocity comes back to 0."""

    def stops(_: float, y: np.ndarray) -> float:
        return float(y[1])

    stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, y: [y[1], (drop - Kp * y[0] - (Kd + s2) * y[1]) / m],
        (0.0, 200.0),
        [0.0, 1e-12],
        events=stops,
        rtol=1e-10,
        atol=1e-13,
    )
    return float(found.y[0, -1])


@pytest.mark.parametrize(("Kp", "Kd"), [(3.0, 6.0), (3.0, 1.0), (12e3, 190.0), (5.0, 0.0)])
def test_expected_slip_is_that_of_a_rigid_mass(Kp: float, Kd: float) -> None:
    assert expected_slip(1.0, 0.4, Kp, Kd, 1.0, 1.5) == pytest.approx(slip(1.0, 0.4, Kp, Kd, 0.5), rel=1e-5)
    assert expected_slip(1.0, -10.0, 1.0, 1.0, 1.0, 2.0) == np.inf  # overcompensated viscous friction: no stop


FREQUENCY = np.geomspace(0.01, 500.0, 4001)


def model(m: float, s2: float, Kp: float, Kd: float, Ki: float) -> np.ndarray:
    """Inverse process sensitivity, m s^2 + (Kd + s2) s + Kp + Ki/s."""
    s = 2j * np.pi * FREQUENCY
    return np.asarray(m * s**2 + (Kd + s2) * s + Kp + Ki / s)


@pytest.mark.parametrize("gamma", [0.3, 1.0, 1.9, 2.1])
def test_learning_with_an_exact_model_contracts_by_one_minus_gamma(gamma: float) -> None:
    L = model(1.0, 0.4, 12e3, 190.0, 250e3)
    found = contraction(FREQUENCY, 1.0 / L, L, gamma=gamma)
    assert found.value == pytest.approx(abs(1.0 - gamma), abs=1e-9)
    assert found.ok == (gamma < 2.0)


def test_learning_with_three_times_the_mass_needs_a_low_pass() -> None:
    """|1 - 3| = 2 far above the loop; trials of one sinusoid each, computed one after the other, say the same."""
    gains = (12e3, 190.0, 250e3)
    S, L = 1.0 / model(1.0, 0.4, *gains), model(3.0, 0.4, *gains)
    plain = contraction(FREQUENCY, S, L)
    assert not plain.ok
    assert plain.value == pytest.approx(2.0, abs=0.05)
    first = number_after("corner of Q well below", plain.change)
    slow = np.less(FREQUENCY, 0.99 * first)
    assert 100 < slow.sum() < 4000
    assert contraction(FREQUENCY[slow], S[slow], L[slow]).ok
    Q = np.asarray(1.0 / (1.0 + (FREQUENCY / 10.0) ** 4), dtype=np.complex128)
    with_lowpass = contraction(FREQUENCY, S, L, Q)
    assert with_lowpass.ok
    for lowpass, found in ((1.0, plain), (Q, with_lowpass)):
        u, errors = np.zeros_like(S), []
        for _ in range(3):  # the input changes by Q L e from trial to trial; the reference is what u = 1 gives
            errors.append(S * (1.0 - u))
            u = lowpass * (u + L * errors[-1])
        change = np.abs(np.diff(errors, axis=0))
        assert (change[1] / change[0]).max() == pytest.approx(found.value, rel=1e-6)


@pytest.mark.parametrize("Ki", [0.0, 250e3])
@pytest.mark.parametrize("f", some([2.0, 30.0, 200.0], [30.0]))
def test_sampled_sensitivity_is_what_a_sinusoidal_force_does(f: float, Ki: float) -> None:
    """Amplitude and phase from a simulation of the loop, sample by sample, after the transients."""
    Kp, Kd, Ts, periods = 12e3, 190.0, 1e-3, 400
    A, b = discretised(1.0, 0.4, Ts)
    state, integral, x = np.zeros(2), 0.0, []
    force = np.cos(2.0 * np.pi * f * Ts * np.arange(round(periods / f / Ts)))
    for u in force:
        x.append(state[0])
        drive = u - Kp * state[0] - Kd * state[1] + Ki * integral
        integral -= Ts * state[0]
        state = A @ state + b * drive
    tail = len(x) // 2
    turn = np.exp(-2j * np.pi * f * Ts * np.arange(len(x)))
    measured = 2.0 * np.mean((np.array(x) * turn)[tail:])
    assert sampled_sensitivity(np.array([f]), 1.0, 0.4, Kp, Kd, Ki, Ts)[0] == pytest.approx(measured, rel=1e-3)


def test_learning_filter_is_central_differences_and_a_sum() -> None:
    f, Ts, m, Kp, Kd, Ki = 50.0, 1e-3, 2.0, 300.0, 20.0, 7e3
    e = np.exp(2j * np.pi * f * Ts * np.arange(-1, 21))  # a whole period from sample 0 on
    k = 8
    now = m * (e[k + 2] - 2.0 * e[k + 1] + e[k]) / Ts**2 + Kd * (e[k + 2] - e[k]) / (2.0 * Ts) + Kp * e[k + 1]
    # a sum of a sinusoid is a sinusoid and a constant, which the mean over a period removes
    sums = Ts * np.cumsum(e[1:-1]) - Ts * e[1:-1]
    force = now + Ki * (sums[k] - sums.mean())
    assert learning_filter(np.array([f]), m, Kp, Kd, Ki, Ts)[0] == pytest.approx(force / e[k + 1], rel=1e-9)


def test_shares() -> None:
    assert overcompensation(1.0).ok
    assert not overcompensation(1.01).ok
    assert overcompensation(1.01).why != overcompensation(1.01, measured=False).why


def test_every_condition_says_all_there_is_to_say() -> None:
    for found in (
        routh(1.0, 0.0, 1.0, 1.0, 2.0),
        hunting(1.0, 1.0, 2.0),
        overcompensation(2.0),
    ):
        assert isinstance(found, Condition)
        for text in (found.name, found.wrong, found.why, found.change, found.source):
            assert text
            assert not text.endswith(".")


LINEAR_WORDS = re.compile(
    r"\b([Ff]orces?|[Mm]ass(es)?|kg)\b(?!\.m)|\bN(\.s)?/m\b|N/\(m\.s\)|N2\.s/m2|(?<![.\w])m/s\b|(?<= \d )[Nm]\b(?!\.m)"
)
ARGUMENTS = {
    "float": 2.0,
    "float | None": 1.5,
    "int": 3,
    "str": "gauss-seidel",
    "Array": np.array([0.5, 1.0]),
    "tuple[float, ...]": (1.0, 2.0, 3.0, 4.0),
    "DrivenPlant": conditions.one_mass(1.0, 0.0),
    "Callable[[float], Sequence[SampledLaw]]": lambda Ts: [],
}


CONDITIONS = [n for n in conditions.__all__ if vars(conditions)[n].__annotations__.get("return") == "Condition"]


@pytest.mark.parametrize("name", sorted({*CONDITIONS} - {"contraction"}))
def test_texts_of_a_rotary_axis_have_its_nouns_and_units(name: str) -> None:
    function = vars(conditions)[name]
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is inspect.Parameter.empty]
    linear = function(*(ARGUMENTS[p.annotation] for p in needed))
    rotary = linear.in_words(TURNING)
    texts = [" . ".join((c.wrong, c.why, c.change, c.source)) for c in (linear, rotary)]
    assert LINEAR_WORDS.search(texts[0]) or texts[0] == texts[1]
    assert not LINEAR_WORDS.search(texts[1]), texts[1]
    assert "{" not in " ".join(texts)
