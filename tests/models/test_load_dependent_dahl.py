"""LoadDependentDahl against scipy, closed forms, the block Dahl, and measured records."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from shell.instance import ERROR, OK, Instance, Library, load
from thorough import few

from friction_fmus.data import load_emps, load_tribometer

EPS, AVERAGE, HALF, VISCOUS = 1e-3, 0.1, 0.03, 0.4
"""Start values of eps, mu_avg, mu_dif and Fv."""

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
speeds = st.one_of(st.floats(-0.5, 0.5), st.sampled_from([0.0, 1e-9, -1e-9, 10.0]))
forces = st.one_of(st.floats(-50.0, 50.0), st.just(0.0))
motion = st.lists(st.tuples(speeds, st.floats(-50.0, 50.0), forces, st.floats(1e-6, 0.02)), min_size=1, max_size=6)


@pytest.fixture(scope="module")
def gear(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("LoadDependentDahl"))


def friction(z: float, v: float, F_t: float) -> float:
    """The equation with the start values."""
    return AVERAGE * abs(F_t) * z + HALF * F_t * z * z + VISCOUS * v


def integrated(z: float, v: float, slope: float, h: float) -> float:
    """z after h by numerical integration, from one reversal to the next."""
    reversal = -v / slope if slope else math.inf
    times = [0.0, reversal, h] if 0.0 < reversal < h else [0.0, h]
    for start, end in itertools.pairwise(times):
        middle = v + slope * (start + end) / 2.0

        def rate(t: float, z: np.ndarray, s: float = float(np.sign(middle))) -> np.ndarray:
            w = v + slope * t
            return (w - s * w * z) / EPS

        found = solve_ivp(rate, (start, end), [z], "DOP853", rtol=1e-12, atol=1e-14)
        z = float(found.y[0, -1])
    return z


@reproducibly
@given(motion, st.sampled_from([0.0, 0.3, -0.9]))
def test_a_step_is_the_solution_of_the_equations(
    gear: Library, motion: list[tuple[float, float, float, float]], z: float
) -> None:
    """Velocity and transmitted force change linearly within a step, and jump between steps."""
    with Instance(gear) as run:
        run.initialise(z=z)
        t = 0.0
        for v, slope, F_t, h in motion:
            run.set({"v": v, "F_t": F_t})
            assert run.input_derivatives({"v": slope, "F_t": 100.0}) == OK
            run.step(t, h)
            t += h
            z = integrated(z, v, slope, h)
            assert run.get1("z") == pytest.approx(z, abs=1e-9)
            expected = friction(z, v + slope * h, F_t + 100.0 * h)
            assert run.get1("F") == pytest.approx(expected, abs=1e-9 * (1.0 + abs(F_t) + abs(slope)))
            assert abs(z) <= 1.0 + 1e-12


@pytest.mark.parametrize("z", [3.0, -7.0, 1.0 + 1e-9])
def test_a_deflection_that_no_motion_reaches_does_not_drive(gear: Library, z: float) -> None:
    """Beyond +-1, the contact would give back more energy than it can store: 3 times as much force after a reversal."""
    side = math.copysign(1.0, z)
    with Instance(gear) as far, Instance(gear) as bent:
        far.initialise(z=z, v=-side, F_t=10.0)
        bent.initialise(z=side, v=-side, F_t=10.0)
        for k in range(3):
            assert far.get("F", "der(z)") == bent.get("F", "der(z)")
            far.step(k * 1e-4, 1e-4)
            bent.step(k * 1e-4, 1e-4)
            assert far.get1("z") == bent.get1("z")


@reproducibly
@given(motion, st.floats(-50.0, 50.0).filter(lambda F: abs(F) > 1e-3), st.floats(1e-6, 1e-2))
def test_under_a_constant_load_it_is_dahl(
    gear: Library,
    build_fmu: Callable[..., Path],
    motion: list[tuple[float, float, float, float]],
    F_t: float,
    eps: float,
) -> None:
    level = AVERAGE * abs(F_t)
    with Instance(gear) as run, Instance(load(build_fmu("Dahl"))) as dahl:
        run.initialise(F_t=F_t, eps=eps, mu_dif=0.0, Fv=0.0)
        dahl.initialise(Fc=level, sigma=level / eps)
        t = 0.0
        for v, slope, _, h in motion:
            for each in (run, dahl):
                each.set({"v": v})
                assert each.input_derivatives({"v": slope}) == OK
                each.step(t, h)
            t += h
            assert run.get1("F") == pytest.approx(dahl.get1("F"), abs=1e-12 * level)


@pytest.mark.parametrize(("F_t", "v"), [(8.0, 0.1), (-8.0, -0.1), (8.0, -0.1), (-8.0, 0.1)])
def test_the_efficiency_of_driving_and_back_driving(gear: Library, F_t: float, v: float) -> None:
    """Output power over input power after ten path constants, with the load F_t - F in equilibrium."""
    with Instance(gear) as run:
        run.initialise(v=v, F_t=F_t, Fv=0.0)
        run.step(0.0, 0.4)
        drive, out = F_t * v, (F_t - run.get1("F")) * v
    driven = drive > 0.0
    expected = 1.0 - AVERAGE - HALF if driven else 1.0 / (1.0 + AVERAGE - HALF)
    assert (out / drive if driven else drive / out) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("amplitude", [0.2 * EPS, EPS, 5.0 * EPS])
@pytest.mark.parametrize("half", [0.0, HALF, -AVERAGE])
def test_a_steady_loop_has_the_tip_and_the_area_of_dahl_for_any_difference(
    gear: Library, amplitude: float, half: float
) -> None:
    """The tip is tanh(A/eps); of the area 4 mu |F_t| (A - eps tanh(A/eps)), mu_dif contributes nothing."""
    F_t, points, h = 20.0, 400, 1e-3
    with Instance(gear) as run:
        run.initialise(F_t=F_t, mu_dif=half, Fv=0.0, z=-math.tanh(amplitude / EPS))
        work, last = 0.0, run.get1("F")
        t = 0.0
        for side in (1.0, -1.0):
            speed = side * 2.0 * amplitude / (points * h)
            run.set({"v": speed})
            last = run.get1("F")
            for _ in range(points):
                run.step(t, h)
                t += h
                now = run.get1("F")
                work += (last + now) / 2.0 * speed * h
                last = now
            assert run.get1("z") == pytest.approx(side * math.tanh(amplitude / EPS), rel=1e-10)
    area = 4.0 * AVERAGE * F_t * (amplitude - EPS * math.tanh(amplitude / EPS))
    assert work == pytest.approx(area, rel=3e-3)


@pytest.mark.parametrize("half", [AVERAGE, HALF, -AVERAGE])
@pytest.mark.parametrize("F_t", [3.0, -3.0])
def test_it_never_returns_more_work_than_it_stored(gear: Library, half: float, F_t: float) -> None:
    """Work minus the change of the stored energy is positive on each leg of a random path."""

    def stored(z: float) -> float:
        return EPS * (AVERAGE * abs(F_t) * z**2 / 2.0 + half * F_t * z**3 / 3.0)

    random = np.random.default_rng(5)
    with Instance(gear) as run:
        run.initialise(F_t=F_t, mu_dif=half, Fv=0.0)
        t, h, points = 0.0, 1e-4, 200
        for speed in random.normal(scale=0.05, size=40):
            run.set({"v": speed})
            before = stored(run.get1("z"))
            path = [run.get1("F")]
            for _ in range(points):
                run.step(t, h)
                t += h
                path.append(run.get1("F"))
            work = float(np.trapezoid(path)) * speed * h
            assert work - (stored(run.get1("z")) - before) >= -1e-7 * EPS * abs(F_t)


def test_without_load_only_viscous_friction_is_left_and_at_rest_friction_follows_the_load(gear: Library) -> None:
    with Instance(gear) as run:
        run.initialise(v=0.2, F_t=0.0)
        run.step(0.0, 1.0)
        assert run.get1("F") == VISCOUS * 0.2
        run.set({"v": 0.0, "F_t": 7.0})
        run.step(1.0, 50.0)
        assert run.get1("F") == pytest.approx(7.0 * (AVERAGE + HALF), rel=1e-12)


def test_a_difference_that_would_drive_the_axis_is_rejected(gear: Library) -> None:
    for half, accepted in ((-AVERAGE, True), (1.01 * AVERAGE, False), (-1.01 * AVERAGE, False)):
        with Instance(gear) as run:
            run.setup()
            run.must("EnterInitializationMode")
            run.set({"mu_dif": half})
            assert run.call("ExitInitializationMode") == (OK if accepted else ERROR)
            assert accepted or b"|mu_dif| <= mu_avg" in run.messages[-1][3]


# ---- measured records


def test_on_the_tribometer_it_is_as_accurate_as_dahl_under_a_load_that_hardly_changes(gear: Library) -> None:
    """An independent fit of Dahl with n = 1 to this window leaves 12.0 % of the rms friction; Coulomb leaves more."""
    record = load_tribometer()
    window = (record.t >= 60.0) & (record.t < 90.0)
    q, normal, measured = (record.column(name)[window] for name in ("q", "normal", "friction"))
    assert np.std(normal) < 1e-3 * np.mean(normal)
    moves = np.diff(q, prepend=q[0])

    def residual(p: np.ndarray) -> np.ndarray:
        mu, eps, z = p
        decays, signs = np.exp(-np.abs(moves) / abs(eps)), np.sign(moves)
        found = np.empty(len(q))
        for i, (decay, s) in enumerate(zip(decays, signs, strict=True)):
            z = s + (z - s) * decay
            found[i] = mu * normal[i] * z
        return measured - found

    fit = least_squares(residual, [0.45, 2e-5, -0.5], x_scale=[0.1, 1e-5, 1.0])
    mu, eps, z = fit.x
    size = float(np.sqrt(np.mean(measured**2)))
    assert np.sqrt(np.mean(fit.fun**2)) / size == pytest.approx(0.12, abs=0.005)
    coulomb = np.sign(moves)
    mean = np.sum(measured * coulomb) / np.sum(coulomb**2)
    assert np.sqrt(np.mean((measured - mean * coulomb)[moves != 0.0] ** 2)) > 2.0 * 0.12 * size

    h = 5e-3
    with Instance(gear) as run:
        run.initialise(mu_avg=mu, mu_dif=0.0, eps=eps, Fv=0.0, z=z)
        simulated = []
        for k, (move, load_of_contact) in enumerate(zip(moves, normal, strict=True)):
            run.set({"v": move / h, "F_t": load_of_contact})
            run.step(k * h, h)
            simulated.append(run.get1("F"))
    np.testing.assert_allclose(measured - simulated, fit.fun, atol=1e-9 * size)


def test_the_ball_screw_of_emps_has_no_friction_proportional_to_the_transmitted_force() -> None:
    """In sliding the model adds mu |F_t| sgn(v) to the friction: 0 within two standard errors of regression."""
    record = load_emps()
    low_pass = scipy.signal.butter(4, 2.0 * 60.0 / 1000.0)
    q, force = (scipy.signal.filtfilt(*low_pass, record.column(name)) for name in ("q", "force"))
    v = np.gradient(q, record.t)
    a = np.gradient(v, record.t)
    sliding = np.abs(v) > 2e-3
    sliding[:200] = sliding[-200:] = False
    columns = np.column_stack([a, v, np.sign(v), np.ones_like(v)])[sliding]
    without, *_ = np.linalg.lstsq(columns, force[sliding])
    transmitted = np.abs(columns @ without)  # from the motion: free of the noise of the measured force
    columns = np.column_stack([columns, transmitted * np.sign(v[sliding])])
    found, *_ = np.linalg.lstsq(columns, force[sliding])
    error = force[sliding] - columns @ found
    samples = np.sum(sliding) / 50  # independent ones: the errors are correlated over about 50 ms
    variances = np.linalg.inv(columns.T @ columns * samples / np.sum(sliding)) * np.mean(error**2)
    assert abs(found[-1]) < 2.0 * math.sqrt(variances[-1, -1])
    assert abs(found[-1]) < 0.015
