"""TwoMass against the matrix exponential of the whole drive, closed forms and the balance of its energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson
from scipy.linalg import expm
from shell.instance import DISCARD, OK, Instance, Library, load
from thorough import few

from friction_fmus import build
from harness import CallablePart, FmuPart, Port, System

reproducibly = settings(max_examples=few(100), deadline=20_000, derandomize=True, database=None)
STATES = ("x1", "v1", "x2", "v2")
FORCES = ("F_drive", "F_load", "F_friction1", "F_friction2")
SIDES = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])
"""what each of FORCES adds to the force on motor and load"""


@pytest.fixture(scope="module")
def two_mass(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("TwoMass"))


def exact(state: np.ndarray, h: float, p: dict[str, float], F: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """x1, v1, x2, v2 after h under the forces F + rate s on motor and load, not taken apart into modes."""
    k, d = p["k"], p["d"]
    A = np.zeros((8, 8))  # x1, v1, x2, v2, F1, F2, their rates
    A[0, 1] = A[2, 3] = A[4, 6] = A[5, 7] = 1.0
    A[1, :5] = np.array([-k, -d, k, d, 1.0]) / p["m1"]
    A[3, :6] = np.array([k, d, -k, -d, 0.0, 1.0]) / p["m2"]
    return np.asarray(expm(A * h) @ [*state, *F, *rate])[:4]


def initial(state: np.ndarray) -> dict[str, float]:
    return {f"{name}_0": float(value) for name, value in zip(STATES, state, strict=True)}


sizes = st.floats(-2.0, 2.0)


@reproducibly
@given(
    state=st.tuples(sizes, sizes, sizes, sizes),
    steps=st.lists(
        st.tuples(
            st.floats(1e-5, 0.3), st.tuples(*[sizes] * 4), st.one_of(st.just((0.0,) * 4), st.tuples(*[sizes] * 4))
        ),
        min_size=1,
        max_size=4,
    ),
    m1=st.floats(0.05, 20.0),
    m2=st.floats(0.05, 20.0),
    k=st.one_of(st.just(0.0), st.floats(1e-3, 1e3)),
    d=st.one_of(st.just(0.0), st.floats(1e-3, 30.0)),
)
def test_steps_are_exact_for_held_and_for_linear_forces(
    two_mass: Library,
    state: tuple[float, ...],
    steps: list[tuple[float, tuple[float, ...], tuple[float, ...]]],
    m1: float,
    m2: float,
    k: float,
    d: float,
) -> None:
    p = {"m1": m1, "m2": m2, "k": k, "d": d}
    y, t, size = np.array(state), 0.0, 4.0
    with Instance(two_mass) as run:
        run.initialise(**p, **initial(y))
        for h, forces, slopes in steps:
            run.set(dict(zip(FORCES, forces, strict=True)))
            if any(slopes):
                assert run.input_derivatives(dict(zip(FORCES, slopes, strict=True))) == OK
            run.step(t, h)
            t += h
            y = exact(y, h, p, SIDES @ forces, SIDES @ slopes)
            size += float(np.abs(y).max())
            w = math.sqrt(k * (1.0 / m1 + 1.0 / m2))
            np.testing.assert_allclose(run.get(*STATES), y, rtol=0, atol=1e-12 * size * (1.0 + w))

        # and the outputs belong to the end of the last step
        F1, F2 = SIDES @ run.get(*FORCES)
        x1, v1, x2, v2 = run.get(*STATES)
        spring = k * (x1 - x2) + d * (v1 - v2)
        drive, load_force = run.get("F_drive", "F_load")
        slack = 1e-14 * (k + d + 1.0) * size
        assert run.get("F_spring", "F_ext1", "F_ext2") == pytest.approx(
            [spring, drive - spring, load_force + spring], abs=slack
        )
        assert run.get("a1", "a2") == pytest.approx([(F1 - spring) / m1, (F2 + spring) / m2], abs=slack / min(m1, m2))


@pytest.mark.parametrize(
    "changed", [{"m1": 3.0}, {"m2": 0.2}, {"k": 50.0}, {"d": 0.0}, {"k": 0.0, "d": 0.0}, {"h": 0.03}]
)
def test_a_parameter_or_the_step_changes_in_a_run_and_back(two_mass: Library, changed: dict[str, float]) -> None:
    usual = {"m1": 1.0, "m2": 0.5, "k": 20.0, "d": 0.5, "h": 0.1}
    forces = np.array([0.7, 0.1, -0.2, 0.3])
    y, t = np.array([0.3, -0.4, 0.1, 0.2]), 0.0
    with Instance(two_mass) as run:
        run.initialise(**initial(y), **dict(zip(FORCES, forces.tolist(), strict=True)))
        for values in (usual, usual, usual | changed, usual | changed, usual):
            h = values["h"]
            run.set({name: value for name, value in values.items() if name != "h"})
            run.step(t, h)
            t += h
            y = exact(y, h, values, SIDES @ forces, np.zeros(2))
            assert run.get(*STATES) == pytest.approx(y, rel=1e-12)


@pytest.mark.parametrize("h", [1e-4, 0.01 / 3.0, 0.7])
def test_the_free_drive_rings_at_its_resonance(two_mass: Library, h: float) -> None:
    """q = q0 cos(w_r t) about a centre of mass that flies on, over a thousand steps of any size."""
    m1, m2, k, q0, V = 0.3, 1.2, 50.0, 0.01, 0.02
    w, M = math.sqrt(k * (m1 + m2) / (m1 * m2)), m1 + m2
    with Instance(two_mass) as run:
        run.initialise(m1=m1, m2=m2, k=k, d=0.0, x1_0=q0, v1_0=V, v2_0=V)
        for n in range(1000):
            run.step(n * h, h)
        t = 1000.0 * h
        X, q = m1 / M * q0 + V * t, q0 * math.cos(w * t)
        assert run.get("x1", "x2") == pytest.approx([X + m2 / M * q, X - m1 / M * q], abs=1e-11)
        assert run.get1("F_spring") == pytest.approx(k * q, abs=1e-9)


@pytest.mark.parametrize("k", [1e4, 1e8, 1e12])
@pytest.mark.parametrize("d", [0.0, 1e2])
def test_however_stiff_the_spring_momentum_is_kept(two_mass: Library, k: float, d: float) -> None:
    """The centre of mass is that of one body under the ramp 2 N + 3 N/s t."""
    m1, m2, h = 0.4, 0.6, 0.01
    with Instance(two_mass) as run:
        run.initialise(m1=m1, m2=m2, k=k, d=d)
        for n in range(10):
            run.set({"F_drive": 2.0 + 3.0 * n * h})
            assert run.input_derivatives({"F_drive": 3.0}) == OK
            run.step(n * h, h)
        t = 10 * h
        x1, v1, x2, v2 = run.get(*STATES)
        assert m1 * x1 + m2 * x2 == pytest.approx(2.0 * t**2 / 2.0 + 3.0 * t**3 / 6.0, rel=1e-12)
        assert m1 * v1 + m2 * v2 == pytest.approx(2.0 * t + 3.0 * t**2 / 2.0, rel=1e-12)
        assert abs(x1 - x2) < 2.1 * 3.0 / k  # at most twice the static stretch


def test_work_of_the_forces_is_kinetic_energy_and_that_of_the_spring(two_mass: Library) -> None:
    """Without damping, in steps of random size with held forces, whose work is F times the way."""
    draw = np.random.default_rng(1)
    m1, m2, k = 0.5, 2.0, 300.0
    with Instance(two_mass) as run:
        run.initialise(m1=m1, m2=m2, k=k, d=0.0, x1_0=0.02)

        def energy() -> float:
            x1, v1, x2, v2 = run.get(*STATES)
            return (m1 * v1**2 + m2 * v2**2 + k * (x1 - x2) ** 2) / 2.0

        t, expected = 0.0, energy()
        for h in draw.uniform(1e-4, 0.1, 100):
            forces = draw.uniform(-3.0, 3.0, 4)
            run.set(dict(zip(FORCES, forces, strict=True)))
            before = np.array(run.get("x1", "x2"))
            run.step(t, h)
            t += h
            expected += (SIDES @ forces) @ (np.array(run.get("x1", "x2")) - before)
            assert energy() == pytest.approx(expected, abs=1e-11 * 100.0)


def test_the_damper_takes_what_energy_is_lost(two_mass: Library) -> None:
    """d q'^2, integrated over many small steps, while the drive rings down."""
    m1, m2, k, d, h, n = 0.5, 2.0, 300.0, 3.0, 1e-4, 4000
    with Instance(two_mass) as run:
        run.initialise(m1=m1, m2=m2, k=k, d=d, x1_0=0.02)
        lost = []
        for i in range(n + 1):
            x1, v1, x2, v2 = run.get(*STATES)
            lost.append(d * (v1 - v2) ** 2)
            if i < n:
                run.step(i * h, h)
        energy = (m1 * v1**2 + m2 * v2**2 + k * (x1 - x2) ** 2) / 2.0
        assert k * 0.02**2 / 2.0 - energy == pytest.approx(simpson(lost, dx=h), rel=1e-9)
        assert energy < 0.1 * k * 0.02**2 / 2.0


def test_at_the_antiresonance_the_motor_stands_still_while_the_load_swings(two_mass: Library) -> None:
    """x2 = a cos(w_a t) by the force that the spring then needs, w_a = sqrt(k/m2), given as a polygon."""
    m2, k, a, h = 0.8, 200.0, 0.01, 1e-3
    w = math.sqrt(k / m2)
    with Instance(two_mass) as run:
        run.initialise(m1=0.5, m2=m2, k=k, d=0.0, x2_0=a)
        for n in range(2000):
            now, then = -k * a * math.cos(w * n * h), -k * a * math.cos(w * (n + 1) * h)
            run.set({"F_drive": now})
            assert run.input_derivatives({"F_drive": (then - now) / h}) == OK
            run.step(n * h, h)
            assert abs(run.get1("x1")) < 1e-3 * a
        assert run.get1("x2") == pytest.approx(a * math.cos(w * 2000 * h), abs=1e-3 * a)


def test_a_stiff_spring_makes_one_mass_and_none_makes_two(two_mass: Library) -> None:
    with Instance(two_mass) as run:
        run.initialise(m1=0.5, m2=1.5, k=1e9, d=1e4, F_drive=4.0, F_friction2=1.0)
        run.step(0.0, 0.5)
        assert run.get("v1", "v2", "x1") == pytest.approx([0.75, 0.75, 0.1875], rel=1e-6)
        assert run.get1("F_spring") == pytest.approx(1.5 * 1.5 + 1.0, rel=1e-6)
    with Instance(two_mass) as run:
        run.initialise(m1=0.5, m2=1.5, k=0.0, d=0.0, F_drive=4.0, F_load=-3.0)
        run.step(0.0, 0.5)
        assert run.get("v1", "v2", "x1", "x2") == pytest.approx([4.0, -1.0, 1.0, -0.25], rel=1e-14)


def test_a_load_that_sticks_lets_the_motor_wind_up_the_spring(build_fmu: Callable[..., Path]) -> None:
    """Static friction of 1.5 N on the load, told by F_ext2: held at 1 N, where x1 = F/k, let go soon after 1.5 N."""
    drive = CallablePart("drive", lambda t, u, x: min(t, 1.0) + 4.0 * max(t - 2.0, 0.0), outputs=[Port("F", "N")])
    wires = ["drive.F -> axis.F_drive", "axis.v2 -> friction.v", "axis.F_ext2 -> friction.F_ext"]
    with System(
        [drive, FmuPart("axis", build_fmu("TwoMass")), FmuPart("friction", build_fmu("Stribeck"))],
        [*wires, "friction.F -> axis.F_friction2"],
        {"axis.k": 1e4, "axis.d": 20.0},
    ) as system:
        result = system.run(stop=2.5, step=1e-3, master="newton")
    t, x1, x2, spring = (result[name].to_numpy() for name in ("time", "axis.x1", "axis.x2", "axis.F_spring"))
    assert np.abs(x2[t <= 2.0]).max() < 1e-9
    assert x1[t <= 2.0][-1] == pytest.approx(1.0 / 1e4, rel=1e-4)
    # 1 kg is 0.1 mm away 19 ms after 2.125 s if friction falls to 1 N at once, 53 ms after it if it stays at 1.5 N:
    # s^2 / 4 + 4 s^3 / 6 = 1e-4 and 4 s^3 / 6 = 1e-4
    free = t[np.flatnonzero(x2 > 1e-4)[0]]
    assert 2.125 + 0.018 < free < 2.125 + 0.054
    assert spring[t < free].max() > 1.5


def test_the_rotational_twin_has_the_same_numbers_in_other_units(tmp_path: Path) -> None:
    twin = load(build("TwoMass", tmp_path, domain="rotational"))
    assert [twin.variables[name].unit for name in ("x1", "m1", "k", "d", "F_ext2")] == [
        "rad", "kg.m2", "N.m/rad", "N.m.s/rad", "N.m",
    ]  # fmt: skip
    with Instance(twin) as run:
        run.initialise(m1=0.5, m2=1.5, k=0.0, d=0.0, F_drive=4.0)
        run.step(0.0, 0.5)
        assert run.get("v1", "x1") == pytest.approx([4.0, 1.0], rel=1e-14)


@pytest.mark.parametrize("values", [{"m1": 0.0}, {"m2": -1.0}, {"k": -1.0}, {"d": -1e-9}])
def test_impossible_parameters_are_discarded(two_mass: Library, values: dict[str, float]) -> None:
    with Instance(two_mass) as run:
        run.initialise()
        assert run.try_set(values) == [DISCARD]
