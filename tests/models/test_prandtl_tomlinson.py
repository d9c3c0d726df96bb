"""The Prandtl-Tomlinson tip against closed forms, tabulated friction and scipy, cold and warm."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from shell.instance import DISCARD, OK, Instance, Library, load
from thorough import few, some

reproducibly = settings(max_examples=few(25), deadline=20_000, derandomize=True, database=None)
START = {"m": 1.0, "damping": 2.0, "k": 1.0, "E0": 0.25, "a": 1.0}
TIP = {"m": 1e-12, "damping": 2e6, "k": 1.0, "E0": 1e-19, "a": 0.3e-9}  # of a force microscope, SI units
B28 = {1.5: 0.02045312, 2.0: 0.06412423, 3.0: 0.18006672, 4.0: 0.31314155, 5.0: 0.45435696, 10.0: 1.20507565}


@pytest.fixture(scope="module")
def tip(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("PrandtlTomlinson"))


def moved(y: np.ndarray, v: float, slope: float, h: float, p: dict[str, float]) -> np.ndarray:
    """(X, x, w) after h by scipy, from the equations in the comment of the block."""

    def rate(s: float, q: np.ndarray) -> list[float]:
        X = y[0] + v * s + slope * s * s / 2.0
        pull = p["k"] * (X - q[0]) - math.pi * p["E0"] / p["a"] * math.sin(2.0 * math.pi * q[0] / p["a"])
        return [q[1], pull / p["m"] - p["damping"] * q[1]]

    natural = math.sqrt((p["k"] + 2.0 * math.pi**2 * p["E0"] / p["a"] ** 2) / p["m"])
    scale = [1e-14 * p["a"], 1e-14 * p["a"] * natural]
    solution = solve_ivp(rate, (0.0, h), y[1:], "DOP853", rtol=1e-13, atol=scale)
    assert solution.success
    return np.array([y[0] + v * h + slope * h * h / 2.0, *solution.y[:, -1]])


def corrugation(p: dict[str, float]) -> float:
    return math.pi * p["E0"] / p["a"]


# ---- the equations


@reproducibly
@given(
    h=st.floats(1e-6, 0.02),
    velocities=st.lists(st.one_of(st.floats(-5.0, 5.0), st.just(0.0)), min_size=1, max_size=15),
    m=st.floats(0.05, 5.0),
    damping=st.one_of(st.floats(0.0, 50.0), st.just(0.0)),
    k=st.floats(0.1, 20.0),
    E0=st.floats(0.0, 3.0),
    a=st.floats(0.2, 5.0),
)
def test_held_velocities_are_solved_to_1e_9(tip: Library, h: float, velocities: list[float], **p: float) -> None:
    y = np.zeros(3)
    with Instance(tip) as run:
        run.initialise(**p)
        t = 0.0
        for v in velocities:
            run.set({"v": v})
            run.step(t, h)
            t += h
            y = moved(y, v, 0.0, h, p)
            assert abs(run.get1("F") - p["k"] * (y[0] - y[1])) < 1e-9 * max(corrugation(p), 1e-3 * p["k"] * p["a"])


@pytest.mark.parametrize("h", some([1e-4, 0.02], [0.02]))
@pytest.mark.parametrize("p", [START, START | {"damping": 0.2}, START | {"damping": 40.0}, START | {"m": 0.05}])
def test_a_long_run_of_jumps_of_velocity_and_holds(tip: Library, h: float, p: dict[str, float]) -> None:
    draw = np.random.default_rng(3)
    y, t, steps = np.zeros(3), 0.0, 500
    with Instance(tip) as run:
        run.initialise(**p)
        for k in range(steps):
            v = 0.0 if k % 50 < 10 else float(draw.uniform(-2.0, 3.0))
            run.set({"v": v})
            run.step(t, h)
            t += h
            y = moved(y, v, 0.0, h, p)
            assert abs(run.get1("F") - p["k"] * (y[0] - y[1])) < 1e-9 * corrugation(p)
        assert run.get("X", "x", "w") == pytest.approx(list(y), abs=1e-9)


@pytest.mark.parametrize(
    ("v", "slope", "h"), [(1.0, -150.0, 0.02), (-0.3, 40.0, 0.02), (0.0, 5.0, 0.5), (3.0, -6.0, 1.0)]
)
def test_linear_velocities_are_solved_through_their_reversal(tip: Library, v: float, slope: float, h: float) -> None:
    y = moved(np.zeros(3), v, slope, h, START)
    with Instance(tip) as run:
        run.initialise(v=v)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, h)
        assert run.get("X", "x", "w") == pytest.approx(list(y), abs=1e-10)
        assert abs(run.get1("F") - (y[0] - y[1])) < 1e-9 * corrugation(START)


@pytest.mark.parametrize("h", [1e-7, 1e-6, 2e-5])
def test_a_tip_of_a_force_microscope_is_solved_in_si_units(tip: Library, h: float) -> None:
    """Accuracy is relative to the lattice, 0.3 nm, not to a metre."""
    y, t = np.zeros(3), 0.0
    with Instance(tip) as run:
        run.initialise(**TIP)
        assert run.get1("eta") == pytest.approx(2.0 * math.pi**2 * 1e-19 / 0.09e-18, rel=1e-12)
        for v in (1e-4, -3e-4, 0.0, 5e-4):
            run.set({"v": v})
            run.step(t, h)
            t += h
            y = moved(y, v, 0.0, h, TIP)
            assert abs(run.get1("F") - TIP["k"] * (y[0] - y[1])) < 1e-9 * corrugation(TIP)


def test_how_a_span_is_cut_does_not_matter(tip: Library) -> None:
    found = []
    for pieces in (1, 7, 500):
        with Instance(tip) as run:
            run.initialise(v=1.3, damping=0.3)
            for j in range(pieces):
                run.step(5.0 * j / pieces, 5.0 / pieces)
            found.append(run.get("F", "x", "w"))
    assert found[1] == pytest.approx(found[0], rel=1e-9, abs=1e-10)
    assert found[2] == pytest.approx(found[0], rel=1e-9, abs=1e-10)


def test_friction_is_odd(tip: Library) -> None:
    results = []
    for sign in (1.0, -1.0):
        with Instance(tip) as run:
            run.initialise(x=sign * 0.2, w=sign * 0.1)
            for k in range(100):
                run.set({"v": sign * math.sin(0.3 * k)})
                run.step(0.05 * k, 0.05)
            results.append([sign * value for value in run.get("F", "x", "w")])
    assert results[0] == pytest.approx(results[1], rel=1e-12)


def test_the_whole_chain_may_be_moved_by_periods(tip: Library) -> None:
    forces = []
    for offset in (0.0, 1e6):
        with Instance(tip) as run:
            run.initialise(x=offset, X=offset, v=0.7)
            run.step(0.0, 10.0)
            forces.append(run.get1("F"))
    assert forces[1] == pytest.approx(forces[0], abs=1e-8)


@reproducibly
@given(damping=st.floats(0.0, 10.0), E0=st.floats(0.0, 2.0), x=st.floats(-3.0, 3.0), w=st.floats(-2.0, 2.0))
def test_a_held_driver_takes_no_energy_in(tip: Library, damping: float, E0: float, x: float, w: float) -> None:
    def energy(run: Instance) -> float:
        X, x, w = run.get("X", "x", "w")
        return w * w / 2.0 + (X - x) ** 2 / 2.0 + E0 / 2.0 * (1.0 - math.cos(2.0 * math.pi * x))

    with Instance(tip) as run:
        run.initialise(damping=damping, E0=E0, x=x, w=w)
        last = energy(run)
        for k in range(40):
            run.step(0.1 * k, 0.1)
            assert energy(run) <= last + 1e-10 * (1.0 + last)
            last = energy(run)


def test_output_derivatives_are_those_of_the_spring(tip: Library) -> None:
    with Instance(tip) as run:
        run.initialise(v=0.8)
        run.step(0.0, 0.3)
        assert run.output_derivatives("F") == pytest.approx([1.0 * (0.8 - run.get1("w"))], rel=1e-8)


def test_a_tolerance_is_honoured(tip: Library) -> None:
    y = moved(np.zeros(3), 1.3, 0.0, 5.0, START)
    errors = {}
    for tolerance in (1e-4, 1e-7, None):
        with Instance(tip) as run:
            run.initialise(tolerance=tolerance, v=1.3)
            run.step(0.0, 5.0)
            errors[tolerance] = abs(run.get1("F") - (y[0] - y[1]))
    assert 1e-3 > errors[1e-4] > errors[1e-7] > errors[None]
    assert errors[1e-7] < 1e-5 and errors[None] < 1e-9


# ---- friction


def mean_friction(tip: Library, v: float, samples: int = 20000, **p: float) -> float:
    """Over one period of the substrate, after one period."""
    period = p.get("a", 1.0) / v
    with Instance(tip) as run:
        run.initialise(v=v, **p)
        run.step(0.0, period)
        total = 0.0
        for j in range(samples):
            run.step(period * (1.0 + j / samples), period / samples)
            total += run.get1("F")
    return total / samples


def quasi_static(eta: float) -> tuple[float, float]:
    """X of the jump and mean friction for k = a = 1: the energy lost in the jump from the end of one branch of
    positions of rest to the one it falls into, where X - x = eta / (2 pi) sin(2 pi x)."""
    amplitude = eta / (2.0 * math.pi)
    x = math.acos(-1.0 / eta) / (2.0 * math.pi)
    X = x + amplitude * math.sin(2.0 * math.pi * x)

    def energy(x: float) -> float:
        return (X - x) ** 2 / 2.0 - amplitude / (2.0 * math.pi) * math.cos(2.0 * math.pi * x)

    def rest(x: float) -> float:
        return X - x - amplitude * math.sin(2.0 * math.pi * x)

    places = np.linspace(x + 1e-3, x + 1.5, 3000)
    k = next(k for k in range(len(places) - 1) if rest(places[k]) > 0.0 >= rest(places[k + 1]))
    x_after = brentq(rest, places[k], places[k + 1], xtol=1e-15)
    return X, energy(x) - energy(x_after)


@pytest.mark.parametrize(("eta", "F"), some([*B28.items()], [*B28.items()][::4]))
def test_b28_slow_friction_is_the_energy_of_the_jumps(tip: Library, eta: float, F: float) -> None:
    """The excess at a small v goes with v^(2/3); with m damping = 1 it is below 2 % at 1e-5."""
    X_jump, expected = quasi_static(eta)
    assert X_jump == pytest.approx((math.acos(-1.0 / eta) + math.sqrt(eta**2 - 1.0)) / (2.0 * math.pi), rel=1e-12)
    assert pytest.approx(F, abs=5e-9) == expected
    p = {"E0": eta / (2.0 * math.pi**2), "m": 0.01, "damping": 100.0}
    slow, slower = (mean_friction(tip, v, **p) for v in (8e-6, 1e-6))
    assert 0.0 < slower / expected - 1.0 < slow / expected - 1.0 < 0.02
    assert (4.0 * slower - slow) / 3.0 == pytest.approx(expected, rel=1e-3)


def test_b28_the_tip_jumps_where_its_position_of_rest_ends(tip: Library) -> None:
    X_jump, _ = quasi_static(4.0)
    v, h, last = 1e-5, 20.0, 0.0
    with Instance(tip) as run:
        run.initialise(E0=4.0 / (2.0 * math.pi**2), v=v)
        for k in range(10000):
            run.step(h * k, h)
            X, x = run.get("X", "x")
            if x - last > 0.2:
                break
            last = x
    assert X_jump < X < X_jump + 3e-3


@pytest.mark.parametrize("eta", some([0.0, 0.3, 0.7], [0.3]))
def test_b28_without_multistability_slow_friction_vanishes(tip: Library, eta: float) -> None:
    """What is left is viscous: proportional to v."""
    E0 = eta / (2.0 * math.pi**2)
    one, ten = (mean_friction(tip, v, E0=E0) for v in (1e-5, 1e-4))
    assert 0.0 < one < 2e-4
    assert ten == pytest.approx(10.0 * one, rel=0.01)
    if eta == 0.0:
        assert one == pytest.approx(2.0 * 1e-5, rel=1e-6)


@pytest.mark.parametrize("v", [0.05, 0.16, 0.5, 2.0])
@pytest.mark.parametrize("damping", [0.5, 2.0])
def test_b29_fast_friction_over_a_weak_corrugation(tip: Library, v: float, damping: float) -> None:
    m, k, E0, a = 1.0, 1.0, 5e-4, 1.0
    w = 2.0 * math.pi * v / a
    resonance = (math.pi * E0 / (a * m)) ** 2 / ((k / m - w * w) ** 2 + (damping * w) ** 2)
    corrugated = m * damping * w * w / (2.0 * v) * resonance
    with Instance(tip) as run:
        run.initialise(v=v, damping=damping, E0=E0)
        settled = math.ceil(200.0 * v) / v
        run.step(0.0, settled)
        total, samples = 0.0, 400
        for j in range(samples):
            run.step(settled + j / v / samples, 1.0 / v / samples)
            total += run.get1("F") / samples
    assert total == pytest.approx(m * damping * v + corrugated, rel=1e-3)
    assert total - m * damping * v == pytest.approx(corrugated, rel=1e-3, abs=2e-11)


# ---- temperature

WARM = {"kT": 0.02, "damping": 1.0, "dt": 0.02}


def test_noise_follows_from_the_seed_and_not_from_the_steps(tip: Library) -> None:
    def forces(pieces: int, **values: float) -> list[float]:
        with Instance(tip) as run:
            run.initialise(v=0.3, **(WARM | values))
            for j in range(pieces):
                run.step(4.0 * j / pieces, 4.0 / pieces)
            return run.get("F", "x", "w", "R")

    whole = forces(1, seed=5)
    assert forces(1, seed=5) == whole
    for pieces in (2, 13, 200, 1237):
        assert forces(pieces, seed=5) == pytest.approx(whole, rel=1e-8, abs=1e-9)
    assert abs(forces(1, seed=6)[0] - whole[0]) > 1e-3
    assert forces(1, kT=0.0)[3] == 0.0


def test_noise_does_not_depend_on_when_the_run_starts(tip: Library) -> None:
    found = []
    for start in (0.0, 64.0):
        with Instance(tip) as run:
            run.initialise(start=start, v=0.3, **WARM)
            run.step(start, 2.0)
            found.append(run.get("F", "R"))
    assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_the_thermal_force_is_white_and_has_the_stated_size(tip: Library) -> None:
    kT, damping, dt, m, n = 0.02, 1.5, 0.3, 2.0, 20000
    R = np.empty(n)
    with Instance(tip) as run:
        run.initialise(kT=kT, damping=damping, dt=dt, m=m, E0=0.0)
        for j in range(n):
            run.step(j * dt, dt)
            R[j] = run.get1("R")
    variance = m * kT * (1.0 - math.exp(-2.0 * damping * dt)) / dt**2  # of the impulse of the exact solution, over dt
    assert R.var() == pytest.approx(variance, rel=0.05)
    assert abs(R.mean()) < 4.0 * math.sqrt(variance / n)
    assert abs(np.corrcoef(R[1:], R[:-1])[0, 1]) < 4.0 / math.sqrt(n)
    assert (R**4).mean() / variance**2 == pytest.approx(3.0, rel=0.15)


@pytest.mark.parametrize("E0", some([0.0, 0.1], [0.1]))
def test_a_warm_tip_has_its_share_of_energy(tip: Library, E0: float) -> None:
    """Equipartition: m w^2 = kT on average, and (virial) the restoring force times x, too."""
    kT, h, n = 0.03, 0.5, 30000
    kinetic = virial = 0.0
    with Instance(tip) as run:
        run.initialise(kT=kT, damping=1.0, dt=0.05, E0=E0, tolerance=1e-6)
        run.step(0.0, 20.0)
        for j in range(n):
            run.step(20.0 + h * j, h)
            x, w = run.get("x", "w")
            kinetic += w * w / n
            virial += x * (x + math.pi * E0 * math.sin(2.0 * math.pi * x)) / n
    assert kinetic == pytest.approx(kT, rel=0.05)
    assert virial == pytest.approx(kT, rel=0.07)


def test_temperature_lowers_slow_friction(tip: Library) -> None:
    def friction(kT: float) -> float:
        total, samples, v = 0.0, 4000, 5e-3
        with Instance(tip) as run:
            run.initialise(v=v, kT=kT, dt=0.05, tolerance=1e-6)
            run.step(0.0, 200.0)
            for j in range(samples):
                run.step(200.0 + 0.5 * j, 0.5)
                total += run.get1("F") / samples
        return total

    cold, warm, hot = (friction(kT) for kT in (0.0, 0.01, 0.05))
    assert cold > warm > hot > 0.0


def test_a_restored_state_continues_with_the_same_noise(tip: Library) -> None:
    with Instance(tip) as run, Instance(tip) as other:
        run.initialise(v=0.3, **WARM)
        run.step(0.0, 0.333)
        other.restore(run.serialised())
        for each in (run, other):
            each.step(0.333, 1.0)
        assert run.everything() == other.everything()


# ---- limits


@pytest.mark.parametrize(
    "values", [{"E0": 0.0}, {"damping": 0.0, "kT": 1.0}, {"kT": 0.5, "damping": 1e-300}, {"k": 1e-30}]
)
def test_parameters_at_their_limits_give_finite_forces(tip: Library, values: dict[str, float]) -> None:
    with Instance(tip) as run:
        run.initialise(v=1.0, **values)
        for k in range(20):
            run.step(0.02 * k, 0.02)
            assert all(map(math.isfinite, run.get("F", "x", "w", "R", "eta")))


def test_a_step_over_too_many_intervals_of_noise_is_discarded(tip: Library) -> None:
    with Instance(tip) as run:
        run.initialise(kT=0.1, dt=1e-12)
        assert run.call("DoStep", 0.0, 1.0, 1) == DISCARD
