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
    contact_step,
    contraction,
    dead_band,
    expected_slip,
    hunting,
    inertia,
    injection,
    learning_filter,
    longest_step,
    output_delay,
    overcompensation,
    routh,
    sample_step,
    sampled,
    sampled_sensitivity,
    steepest_fall,
    stick_slip_free,
    turned_friction,
)
from friction_fmus.lawkit.law_files import discover_laws


def discretised(m: float, damping: float, stiffness: float, Ts: float) -> tuple[np.ndarray, np.ndarray]:
    """A mass with spring and damper under a held force, by scipy."""
    A, b = np.array([[0.0, 1.0], [-stiffness / m, -damping / m]]), np.array([[0.0], [1.0 / m]])
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
        Kp, k, Ki = random.uniform(-5.0, 20.0), random.choice([0.0, 2.0]), random.choice([0.0, random.uniform(0, 60)])
        roots = np.roots([m, Kd + s2, Kp + k, Ki] if Ki else [m, Kd + s2, Kp + k])
        verdicts.append(routh(m, s2, Kp, Kd, Ki, k).ok)
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
    m, s2, k, Kp, Kd, Ki, Ts = 2.0, 3.0, 50.0, 700.0, 40.0, 900.0, 4e-3
    A, b = discretised(m, s2, k, Ts)
    state, integral = np.array([1.0, -2.0]), 0.3
    matrix, mine = closed_loop(m, s2, Kp, Kd, Ki, Ts, k), np.array([1.0, -2.0, 0.3])
    for _ in range(20):
        values = {"x": state[0], "v": state[1], "integral": integral, "Kp": Kp, "Kd": Kd, "Ki": Ki, "Ts": Ts}
        found = PID.evaluate({**values, "u_min": -1e9, "u_max": 1e9})
        state, integral = A @ state + b * found["u"], found["integral"]
        mine = matrix @ mine
    assert mine == pytest.approx([*state, integral], rel=1e-9)


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
    Kp, Kd, Ki = gains
    slow = sampled(1.0, 0.0, Kp, Kd, Ki, 10.0 / Kd)
    assert not slow.ok
    edge = number_after("sample faster than every", slow.change)
    assert growth(Kp, Kd, Ki, 0.98 * edge) < 1.0 < growth(Kp, Kd, Ki, 1.02 * edge)
    assert sampled(1.0, 0.0, Kp, Kd, Ki, 0.98 * edge).ok


def test_a_loop_that_no_sampling_makes_stable_is_not_advised_to_sample_faster() -> None:
    found = sampled(1.0, 0.0, 3.0, 0.1, 100.0, 1e-3)
    assert not found.ok
    assert "no sample time of 1 us or more makes the loop stable" in found.change


def fall_on_a_grid(Fc: float, Fs: float, vs: float, delta: float) -> float:
    v = vs * np.geomspace(1e-6, 20.0, 200_001)
    return float(np.max(-np.diff(Fc + (Fs - Fc) * np.exp(-((v / vs) ** delta))) / np.diff(v)))


@pytest.mark.parametrize("delta", [1.0, 1.3, 2.0, 3.5, 10.0])
def test_steepest_fall_is_that_of_the_curve(delta: float) -> None:
    assert steepest_fall(2.0, 3.0, 0.01, delta) == pytest.approx(fall_on_a_grid(2.0, 3.0, 0.01, delta), rel=1e-4)


def test_numbers_of_the_lugre_paper() -> None:
    assert steepest_fall(**P95) == pytest.approx(math.sqrt(2.0 / math.e) * 0.5 / 1e-3)
    assert steepest_fall(**P95) == pytest.approx(429.0, abs=0.2)  # N.s/m
    assert injection(1.0, 3.0, 6.0, 4.0, 1e5, math.sqrt(1e5)).bound == pytest.approx(316.0, abs=0.3)  # N.s/m
    c = math.sqrt(1e5) + 0.4
    assert longest_step("jacobi", 1.0, 1e5, c) == pytest.approx(1.58e-3, abs=5e-6)
    assert longest_step("gauss-seidel", 1.0, 1e5, c) == pytest.approx(3.91e-3, abs=5e-6)


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


def test_a_turned_integral_is_not_said_to_hunt_as_a_plain_one() -> None:
    plain, elastic, rigid = (hunting(4.0, 1.0, 1.5, *case) for case in ((), (True,), (True, False)))
    assert not (plain.ok or elastic.ok or rigid.ok)
    assert "far smaller" in elastic.why and "v_zc" in elastic.change
    assert "rigid" in rigid.why and rigid.change == plain.change
    assert "turned" not in plain.why + plain.source
    assert hunting(4.0, 1.0, 1.0, True).ok


def test_turned_friction_may_not_exceed_friction() -> None:
    assert turned_friction(1.0, 1.0).ok
    assert "0.5 N more than friction resists" in turned_friction(1.25, 1.0).why
    assert not turned_friction(1.25, 1.0).ok


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


def rests(db: float, Kp: float, Kd: float, Ki: float) -> bool:
    """Whether a mass of 1 kg under PID comes to rest that stands just outside the dead-band and is about to slip."""
    s0, s1, s2, h = 1e5, 316.2, 0.4, 1e-3
    x, v, z, F, moved = -1.01 * db, 0.0, 1.4e-5, 1.4, 0
    integral = (1.4 + Kp * x) / Ki
    for k in range(150_000):
        integral -= h * x * (abs(x) > db)
        v += h * (-Kp * x - Kd * v + Ki * integral - F)
        x += h * v
        g = 1.0 + 0.5 * math.exp(-((v / 1e-3) ** 2))
        rate = s0 * abs(v) / g
        if rate > 0.0:
            z = v / rate + (z - v / rate) * math.exp(-rate * h)
        F = s0 * z + s1 * (v - rate * z) + s2 * v
        moved = k if abs(v) > 1e-2 else moved
    return moved < 75_000


@pytest.mark.parametrize(("share", "ends"), [(1.05, True), (0.95, False)])
def test_a_dead_band_ends_hunting_if_a_slip_fits_in(share: float, ends: bool) -> None:
    """Simulated on the contact of the paper, which is nearly rigid."""
    bound = expected_slip(1.0, 0.4, 3.0, 6.0, 1.0, 1.5) / 2.0
    assert dead_band(share * bound, 2.0 * bound).ok == ends
    assert rests(share * bound, 3.0, 6.0, 4.0) == ends


def test_injection_is_positive_realness_on_a_grid_of_frequencies() -> None:
    random = np.random.default_rng(2)
    w = np.geomspace(1e-6, 1e6, 20_001)
    verdicts = []
    for _ in range(300):
        m, Kp, Kd, Ki, s0, s1 = np.exp(random.uniform(-2.0, 2.0, 6))
        Ki *= random.integers(2)
        s = 1j * w
        G = s * (s1 * s + s0) / (m * s**3 + Kd * s**2 + Kp * s + Ki)
        stable = np.roots([m, Kd, Kp, Ki] if Ki else [m, Kd, Kp]).real.max() < 0.0
        verdicts.append(injection(m, Kp, Kd, Ki, s0, s1).ok)
        assert verdicts[-1] == bool(stable and G.real.min() >= -1e-12 * np.abs(G).max())
    assert 20 < sum(verdicts) < 280


def test_gains_of_the_paper_and_a_triple_pole_of_10_hz_do_not_stand_injection() -> None:
    w = 2.0 * math.pi * 10.0
    contact = (1e5, math.sqrt(1e5))
    assert not injection(1.0, 3.0, 6.0, 4.0, *contact).ok
    assert not injection(1.0, 3.0 * w**2, 3.0 * w, w**3, *contact).ok
    assert injection(1.0, 3.0 * w**2, 320.0, w**3, *contact).ok
    by_integral = injection(1.0, 3.0, 320.0, 1e6, *contact)
    assert (by_integral.ok, by_integral.value) == (False, 3.0)


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
    A, b = discretised(1.0, 0.4, 0.0, Ts)
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


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_longest_step_is_the_edge_of_the_coupled_map(master: str) -> None:
    """The recursion of a mass and a stuck contact written out, its eigenvalues by numpy."""
    random = np.random.default_rng(3)
    for m, s0, c in np.exp(random.uniform(-2.0, 8.0, (100, 3))):
        for share in (0.999, 1.001):
            H = share * longest_step(master, m, s0, c)
            step = np.zeros((3, 3))
            for i, (x, v, F) in enumerate(np.eye(3)):  # one unit vector after the other: z, v, F
                after = v - H / m * F
                used = v if master == "jacobi" else after
                step[:, i] = x + H * used, after, s0 * (x + H * used) + c * used
            assert (np.abs(np.linalg.eigvals(step)).max() < 1.0 + 1e-12) == (share < 1.0)


def test_implicit_masters_have_no_longest_step_and_jacobi_needs_damping() -> None:
    assert longest_step("newton", 1.0, 1e5, 300.0) == longest_step("adaptive", 1.0, 1e5, 0.0) == math.inf
    assert longest_step("jacobi", 1.0, 1e5, 0.0) == 0.0
    assert contact_step("newton", 0.1, 1.0, 1e5, 300.0).ok
    assert contact_step("jacobi", 1e-9, 1.0, 1e5, 0.0).change == "use the master newton"


@pytest.mark.parametrize(
    ("Ts", "step", "ok", "advised"),
    [(1e-3, 1e-3, True, 1e-3), (1e-3, 1e-4, True, 1e-4), (1e-3, 3e-3, False, 1e-3), (1e-3, 4e-4, False, 1e-3 / 3)],
)
def test_sample_times_are_multiples_of_the_step(Ts: float, step: float, ok: bool, advised: float) -> None:
    found = sample_step(Ts, step)
    assert found.ok == ok
    assert number_after("communication step of", found.change) == pytest.approx(advised, rel=1e-5)


def test_late_values_and_shares() -> None:
    assert output_delay(0.0, 1e-3, "a", "b").ok
    assert output_delay(1e-5, 1e-3, "a", "b").ok
    assert not output_delay(1e-3, 1e-3, "a", "b").ok
    assert overcompensation(1.0).ok
    assert not overcompensation(1.01).ok
    assert overcompensation(1.01).why != overcompensation(1.01, measured=False).why
    assert inertia(5.0, 1.0, laws=1).ok
    assert not inertia(2.0, 1.0, laws=2).ok


def test_every_condition_says_all_there_is_to_say() -> None:
    for found in (
        routh(1.0, 0.0, 1.0, 1.0, 2.0),
        hunting(1.0, 1.0, 2.0),
        hunting(1.0, 1.0, 2.0, True),
        turned_friction(2.0, 1.0),
        dead_band(1.0, 3.0),
        output_delay(1.0, 1.0, "a", "b"),
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
