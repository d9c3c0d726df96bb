"""Belt against the matrix exponential, against Mass seen from the belt, and the known stick-slip of LuGre."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from shell.instance import OK, Instance, Library, load
from thorough import few

from harness import FmuPart, System

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
sizes = st.floats(-2.0, 2.0)


@pytest.fixture(scope="module")
def belt(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Belt"))


def exact(y: np.ndarray, h: float, m: float, k: float, d: float, force: float, rate: float) -> np.ndarray:
    """x and v after h under force + rate s."""
    A = np.zeros((4, 4))  # x, v, force, rate
    A[0, 1] = A[2, 3] = 1.0
    A[1, :3] = np.array([-k, -d, 1.0]) / m
    return np.asarray(expm(A * h) @ [*y, force, rate])[:2]


@reproducibly
@given(
    y=st.tuples(sizes, sizes),
    steps=st.lists(st.tuples(st.floats(1e-5, 0.3), *[sizes] * 6), min_size=1, max_size=4),
    linear=st.booleans(),
    m=st.floats(0.05, 20.0),
    k=st.one_of(st.just(0.0), st.floats(1e-3, 1e3)),
    d=st.one_of(st.just(0.0), st.floats(1e-3, 30.0)),
)
def test_steps_are_exact_for_held_and_for_linear_forces(
    belt: Library,
    y: tuple[float, float],
    steps: list[tuple[float, ...]],
    linear: bool,
    m: float,
    k: float,
    d: float,
) -> None:
    names = ("F_friction", "F_load", "v_belt")
    state, t, size = np.array(y), 0.0, 4.0
    with Instance(belt) as run:
        run.initialise(m=m, k=k, d=d, x0=y[0], v0=y[1])
        for h, *rest in steps:
            values, slopes = rest[:3], rest[3:] if linear else [0.0] * 3
            run.set(dict(zip(names, values, strict=True)))
            if linear:
                assert run.input_derivatives(dict(zip(names, slopes, strict=True))) == OK
            run.step(t, h)
            t += h
            state = exact(state, h, m, k, d, values[1] - values[0], slopes[1] - slopes[0])
            size += float(np.abs(state).max())
            slack = 1e-12 * size * (1.0 + math.sqrt(k / m))
            assert run.get("x", "v") == pytest.approx(state.tolist(), rel=0, abs=slack)
            v_belt = values[2] + slopes[2] * h
            assert run.get1("v_rel") == pytest.approx(state[1] - v_belt, abs=slack)
            load_force, friction = values[1] + slopes[1] * h, values[0] + slopes[0] * h
            spring = k * state[0] + d * state[1]
            assert run.get("F_spring", "F_ext") == pytest.approx(
                [spring, load_force - spring], abs=slack * (1.0 + k + d)
            )
            assert run.get1("a") == pytest.approx(
                (load_force - spring - friction) / m, abs=slack * (1.0 + k + d) / min(m, 1.0)
            )


def test_the_belt_is_a_mass_on_a_moving_support_seen_from_the_belt(
    belt: Library, build_fmu: Callable[..., Path]
) -> None:
    """From a belt at v_belt the wall moves at -v_belt."""
    V, k, d = 0.3, 20.0, 0.7
    draw = np.random.default_rng(1)
    with Instance(belt) as fixed, Instance(load(build_fmu("Mass"))) as moving:
        fixed.initialise(k=k, d=d, v_belt=V, x0=0.1, v0=0.2)
        moving.initialise(k=k, d=d, v_support=-V, x0=0.1, v0=0.2 - V)
        t = 0.0
        for h in draw.uniform(1e-3, 0.2, 50):
            F = float(draw.uniform(-1.0, 1.0))
            for run in (fixed, moving):
                run.set({"F_friction": F})
                run.step(t, h)
            t += h
            assert fixed.get("v_rel", "a", "F_ext") == pytest.approx(moving.get("v", "a", "F_ext"), abs=1e-12)
            assert fixed.get1("x") == pytest.approx(moving.get1("x") + V * t, abs=1e-12)


@pytest.mark.parametrize("changed", [{"m": 3.0}, {"k": 50.0}, {"d": 0.0}, {"k": 0.0, "d": 0.0}, {"h": 0.03}])
def test_a_parameter_or_the_step_changes_in_a_run_and_back(belt: Library, changed: dict[str, float]) -> None:
    usual = {"m": 1.0, "k": 2.0, "d": 0.5, "h": 0.1}
    y, t = np.array([0.3, -0.4]), 0.0
    with Instance(belt) as run:
        run.initialise(x0=y[0], v0=y[1], F_load=0.7)
        for values in (usual, usual, usual | changed, usual | changed, usual):
            h, m, k, d = (values[name] for name in "hmkd")
            run.set({"m": m, "k": k, "d": d})
            run.step(t, h)
            t += h
            y = exact(y, h, m, k, d, 0.7, 0.0)
            assert run.get("x", "v") == pytest.approx(y, rel=1e-12)


def test_friction_of_the_size_of_F_ext_lets_the_mass_ride_on_an_accelerating_belt(belt: Library) -> None:
    """F_ext has no friction in it, but the inertia that the belt has to overcome: v = a t, x = a t^2 / 2 stays so."""
    m, k, d, a, h, t = 2.0, 3.0, 0.5, 0.4, 0.01, 1.0
    with Instance(belt) as run:
        run.initialise(m=m, k=k, d=d, x0=a * t**2 / 2.0, v0=a * t, v_belt=a * t, a_belt=a)
        F = run.get1("F_ext")
        assert pytest.approx(-(m * a + d * a * t + k * a * t**2 / 2.0), rel=1e-14) == F
        run.set({"F_friction": F})
        assert run.input_derivatives({"v_belt": a, "F_friction": -(d * a + k * a * t)}) == OK
        run.step(0.0, h)
        assert run.get1("v_rel") == pytest.approx(0.0, abs=k * a * h**3 / (6.0 * m))  # F is bent, by k a s^2 / 2
        assert run.get1("a") == pytest.approx(a, abs=k * a * h**2 / m)


def test_work_of_belt_and_wall_is_the_energy_of_the_mass(belt: Library) -> None:
    """Without damping, with held friction forces in steps of random size."""
    draw = np.random.default_rng(2)
    m, k = 0.7, 40.0
    with Instance(belt) as run:
        run.initialise(m=m, k=k, x0=0.1)
        t, expected = 0.0, k * 0.1**2 / 2.0
        for h in draw.uniform(1e-3, 0.2, 100):
            F, before = float(draw.uniform(-2.0, 2.0)), run.get1("x")
            run.set({"F_friction": F})
            run.step(t, h)
            t += h
            x, v = run.get("x", "v")
            expected -= F * (x - before)
            assert m * v**2 / 2.0 + k * x**2 / 2.0 == pytest.approx(expected, abs=1e-11)


def test_lugre_on_the_belt_has_the_known_period_of_stick_slip(build_fmu: Callable[..., Path]) -> None:
    """The mass of the 1995 paper's figure 6; period from an ODE solver at tight tolerances."""
    V, k, step = 0.1, 2.0, 1e-3
    with System(
        [FmuPart("belt", build_fmu("Belt")), FmuPart("friction", build_fmu("LuGre"))],
        ["belt.v_rel -> friction.v", "friction.F -> belt.F_friction"],
        {"belt.v_belt": V, "belt.k": k, "belt.v0": V},
    ) as system:
        result = system.run(stop=30.0, step=step, order=["belt", "friction"])
    # pulled back by the stretched spring: slips against the belt
    t, slip = result["time"].to_numpy(), -result["belt.v_rel"].to_numpy()
    begins = t[1:][(slip[1:] >= 0.5 * V) & (slip[:-1] < 0.5 * V)]
    assert begins.size >= 3
    assert np.mean(np.diff(begins)) == pytest.approx(6.36271982, abs=2.0 * step)
