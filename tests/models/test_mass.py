"""Mass against scipy's matrix exponential and closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from shell.instance import DISCARD, ERROR, OK, Instance, Library, load
from thorough import few

reproducibly = settings(max_examples=few(150), deadline=20_000, derandomize=True, database=None)
FORCES = {"F_drive": 1.0, "F_load": 1.0, "F_friction": -1.0}


@pytest.fixture(scope="module")
def mass(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Mass"))


def exact(
    state: tuple[float, float, float], h: float, m: float, k: float, d: float,
    force: float, v_support: float, force_rate: float = 0.0, support_rate: float = 0.0,
) -> np.ndarray:  # fmt: skip
    """(x, v, x_support) after h: the exponential of the matrix that also moves force, support velocity and rates."""
    A = np.zeros((7, 7))  # x, v, x_support, force, v_support, force_rate, support_rate
    A[0, 1] = A[2, 4] = A[3, 5] = A[4, 6] = 1.0
    A[1, :5] = -k / m, -d / m, k / m, 1.0 / m, d / m
    return (expm(A * h) @ [*state, force, v_support, force_rate, support_rate])[:3]


sizes = st.floats(-2.0, 2.0)


@reproducibly
@given(
    state=st.tuples(sizes, sizes, sizes),
    h=st.floats(1e-6, 0.5),
    m=st.floats(0.01, 100.0),
    k=st.one_of(st.just(0.0), st.floats(1e-3, 1e3)),
    d=st.one_of(st.just(0.0), st.floats(1e-3, 30.0)),
    inputs=st.tuples(sizes, sizes, sizes, sizes),
    slopes=st.one_of(st.just((0.0, 0.0, 0.0, 0.0)), st.tuples(sizes, sizes, sizes, sizes)),
)
def test_a_step_is_exact_for_held_and_for_linear_inputs(
    mass: Library,
    state: tuple[float, float, float],
    h: float,
    m: float,
    k: float,
    d: float,
    inputs: tuple[float, ...],
    slopes: tuple[float, ...],
) -> None:
    names = (*FORCES, "v_support")
    values, rates = dict(zip(names, inputs, strict=True)), dict(zip(names, slopes, strict=True))
    with Instance(mass) as run:
        run.initialise(m=m, k=k, d=d, x0=state[0], v0=state[1], x_support0=state[2], **values)
        if any(slopes):
            assert run.input_derivatives(rates) == OK
        run.step(0.0, h)
        force = sum(sign * values[name] for name, sign in FORCES.items())
        force_rate = sum(sign * rates[name] for name, sign in FORCES.items())
        x, v, x_support = exact(state, h, m, k, d, force, values["v_support"], force_rate, rates["v_support"])
        scale = 10.0 * (1.0 + h / m)
        assert run.get("x", "v", "x_support") == pytest.approx([x, v, x_support], rel=1e-11, abs=1e-12 * scale)

        # and the outputs belong to the end of the step
        external = run.get1("F_drive") + run.get1("F_load") - k * (x - x_support) - d * (v - run.get1("v_support"))
        slack = 1e-11 * (10.0 + k + d) * scale
        assert run.get1("F_ext") == pytest.approx(external, abs=slack)
        assert run.get1("a") == pytest.approx((external - run.get1("F_friction")) / m, abs=slack / m)


def test_a_free_mass_flies(mass: Library) -> None:
    with Instance(mass) as run:
        run.initialise(x0=0.5, v0=-3.0)
        run.step(0.0, 7.0)
        assert run.get("x", "v", "a", "F_ext") == [0.5 - 21.0, -3.0, 0.0, 0.0]


def test_a_constant_force_accelerates(mass: Library) -> None:
    with Instance(mass) as run:
        run.initialise(m=4.0, F_drive=3.0, F_load=2.0, F_friction=1.0)
        for k in range(10):
            run.step(0.1 * k, 0.1)
        assert run.get("x", "v", "a", "F_ext") == pytest.approx([0.5, 1.0, 1.0, 5.0], rel=1e-14)


@pytest.mark.parametrize("h", [1e-3, 0.1, 3.0])
def test_an_undamped_oscillator_keeps_its_energy(mass: Library, h: float) -> None:
    """Closed form x = cos(w t) over a thousand steps of any size."""
    w = 2.0
    with Instance(mass) as run:
        run.initialise(k=w * w, x0=1.0)
        for n in range(1000):
            run.step(n * h, h)
        x, v = run.get("x", "v")
        assert (x, v) == pytest.approx((math.cos(w * 1000 * h), -w * math.sin(w * 1000 * h)), abs=1e-10)
        assert v * v + w * w * x * x == pytest.approx(w * w, rel=1e-10)


@pytest.mark.parametrize("d", [1e2, 1e4, 1e6, 1e8, 1e10])
def test_damping_alone_stops_a_mass_however_stiff(mass: Library, d: float) -> None:
    """v = v0 exp(-d t/m) and x = v0 m/d (1 - exp(-d t/m)), d t/m up to 1e9."""
    h = 0.1
    with Instance(mass) as run:
        run.initialise(d=d, v0=1.0)
        run.step(0.0, h)
        assert run.get1("v") == pytest.approx(math.exp(-d * h), abs=1e-12)
        assert run.get1("x") == pytest.approx(-math.expm1(-d * h) / d, rel=1e-9)


@pytest.mark.parametrize("d", [1e2, 1e4, 1e6, 1e8, 1e10])
def test_a_stiff_damper_to_a_moving_support_drags_the_mass_along(mass: Library, d: float) -> None:
    """Terminal velocity v_support + F/d."""
    with Instance(mass) as run:
        run.initialise(d=d, v_support=0.5, F_drive=2.0)
        run.step(0.0, 10.0)
        assert run.get1("v") == pytest.approx(0.5 + 2.0 / d, rel=1e-9)


@pytest.mark.parametrize("d", [20.0, 2e3, 2e5, 2e7])
def test_an_overdamped_mass_creeps_back_as_in_the_closed_form(mass: Library, d: float) -> None:
    """m = 1, k = 1: the rates are d/2 -+ sqrt(d^2/4 - 1), the slow one written without cancellation."""
    fast = d / 2.0 + math.sqrt(d * d / 4.0 - 1.0)
    slow = 1.0 / fast
    h = 0.5
    with Instance(mass) as run:
        run.initialise(k=1.0, d=d, x0=1.0)
        t, steps = 0.0, 4
        for _ in range(steps):
            run.step(t, h)
            t += h
        x = (fast * math.exp(-slow * t) - slow * math.exp(-fast * t)) / (fast - slow)
        v = -(math.exp(-slow * t) - math.exp(-fast * t)) * fast * slow / (fast - slow)
        assert run.get1("x") == pytest.approx(x, rel=1e-9)
        assert run.get1("v") == pytest.approx(v, rel=1e-7)


@pytest.mark.parametrize("k", [1e4, 1e8, 1e12])
def test_a_stiff_spring_without_damping_keeps_amplitude_and_phase(mass: Library, k: float) -> None:
    w, h = math.sqrt(k), 0.01
    with Instance(mass) as run:
        run.initialise(k=k, x0=1e-3)
        for n in range(10):
            run.step(n * h, h)
        x, v = run.get("x", "v")
        rounding = 1e-12 + 1e-14 * w * 10 * h
        assert x == pytest.approx(1e-3 * math.cos(w * 10 * h), abs=1e-3 * rounding)
        assert v == pytest.approx(-1e-3 * w * math.sin(w * 10 * h), abs=1e-3 * w * rounding)


@pytest.mark.parametrize(("k", "d"), [(1e-12, 0.0), (0.0, 1e-12), (1e-300, 1e-300), (1e-12, 1e-12)])
def test_hardly_any_spring_or_damper_is_as_none(mass: Library, k: float, d: float) -> None:
    with Instance(mass) as run:
        run.initialise(k=k, d=d, x0=2.0, v0=1.0, F_drive=1.0)
        run.step(0.0, 0.5)
        assert run.get("x", "v") == pytest.approx([2.625, 1.5], rel=1e-10)


def test_the_spring_is_pulled_by_its_support(mass: Library) -> None:
    """From rest, k = w^2: x = V t - V/w sin(w t)."""
    w, V, t = 3.0, 0.2, 1.7
    with Instance(mass) as run:
        run.initialise(k=w * w, v_support=V)
        run.step(0.0, t)
        expected = [V * t - V / w * math.sin(w * t), V - V * math.cos(w * t), V * t]
        assert run.get("x", "v", "x_support") == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("force", [-5e-324, -1e-320, -1e-308, -1e-300, -1e-20])
@pytest.mark.parametrize(("k", "d"), [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)])
def test_a_force_that_changes_sign_right_after_the_start_is_passed(
    mass: Library, force: float, k: float, d: float
) -> None:
    """Even where the time until then is too short for a number."""
    with Instance(mass) as run:
        run.initialise(k=k, d=d, F_drive=force)
        assert run.input_derivatives({"F_drive": 1e5}) == OK
        run.step(0.0, 0.1)
        assert run.get("x", "v") == pytest.approx(exact((0, 0, 0), 0.1, 1, k, d, 0, 0, 1e5)[:2], rel=1e-11)


def test_initial_values_are_parameters(mass: Library) -> None:
    with Instance(mass) as run:
        run.setup()
        run.set({"x0": 1.0, "v0": 2.0})
        run.must("EnterInitializationMode")
        assert run.get("x", "v", "x_support") == [1.0, 2.0, 0.0]
        run.set({"x_support0": 3.0, "k": 5.0})
        assert run.get("x", "v", "x_support", "F_ext") == [1.0, 2.0, 3.0, 10.0]
        run.must("ExitInitializationMode")
        assert run.get("x", "v", "x_support", "F_ext") == [1.0, 2.0, 3.0, 10.0]
        assert run.try_set({"x0": 7.0}) == [ERROR]


def test_parameters_may_change_between_steps(mass: Library) -> None:
    state = (0.3, -0.4, 0.1)
    with Instance(mass) as run:
        run.initialise(x0=state[0], v0=state[1], x_support0=state[2], F_drive=0.5, v_support=0.2)
        for n, (m, k, d) in enumerate(
            [(1.0, 2.0, 0.5), (3.0, 2.0, 0.5), (3.0, 0.0, 0.0), (3.0, 50.0, 0.0), (1.0, 0.0, 4.0)]
        ):
            run.set({"m": m, "k": k, "d": d})
            run.step(0.1 * n, 0.1)
            state = tuple(exact(state, 0.1, m, k, d, 0.5, 0.2))
            assert run.get("x", "v", "x_support") == pytest.approx(state, rel=1e-12)


USUAL = {"m": 1.0, "k": 2.0, "d": 0.5, "h": 0.1}
CHANGED = [{"m": 3.0}, {"k": 50.0}, {"k": 0.0}, {"d": 0.0}, {"k": 0.0, "d": 0.0}, {"h": 0.03}, {"k": 2e4}]


@pytest.mark.parametrize("changed", CHANGED)
def test_a_parameter_or_the_step_changes_in_a_run_and_back(mass: Library, changed: dict[str, float]) -> None:
    """Also within a step, which is divided where the force passes 0."""
    state, t = (0.3, -0.4, 0.1), 0.0
    with Instance(mass) as run:
        run.initialise(x0=state[0], v0=state[1], x_support0=state[2], v_support=0.2)
        for values in (USUAL, USUAL, USUAL | changed, USUAL | changed, USUAL):
            h = values["h"]
            run.set({"m": values["m"], "k": values["k"], "d": values["d"], "F_drive": -0.5})
            assert run.input_derivatives({"F_drive": 1.2 / h}) == OK
            run.step(t, h)
            t += h
            state = tuple(exact(state, *(values[name] for name in "hmkd"), -0.5, 0.2, 1.2 / h))
            assert run.get("x", "v", "x_support") == pytest.approx(state, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("changed", CHANGED)
def test_a_state_goes_on_to_the_last_bit_in_an_instance_that_did_something_else(
    mass: Library, changed: dict[str, float]
) -> None:
    """Nothing that the steps of that instance have left belongs to the state."""
    other = USUAL | changed
    with Instance(mass) as run, Instance(mass) as elsewhere:
        run.initialise(x0=0.3, v_support=0.2, m=1.0, k=2.0, d=0.5)
        elsewhere.initialise(v0=1.0, m=other["m"], k=other["k"], d=other["d"])
        for n in range(3):
            run.step(0.1 * n, 0.1)
            elsewhere.step(0.0, other["h"])
            data = run.serialised()
            assert elsewhere.try_restore(data) == OK
            assert elsewhere.serialised() == data
            elsewhere.step(0.1 * (n + 1), 0.1)
            run.step(0.1 * (n + 1), 0.1)
            assert elsewhere.serialised() == run.serialised()
            assert run.try_restore(data) == OK
            elsewhere.must("Reset")
            elsewhere.initialise(v0=1.0, m=other["m"], k=other["k"], d=other["d"])


@pytest.mark.parametrize("values", [{"m": 0.0}, {"m": -1.0}, {"k": -1.0}, {"d": -1e-9}])
def test_impossible_parameters_are_discarded(mass: Library, values: dict[str, float]) -> None:
    with Instance(mass) as run:
        run.initialise()
        assert run.try_set(values) == [DISCARD]
        run.step(0.0, 0.1)
