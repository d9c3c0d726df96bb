"""Derivatives over time of inputs and outputs, and directional derivatives, against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double, c_int, c_uint
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shell.instance import DISCARD, ERROR, OK, Instance, Library, load
from thorough import some

P95 = {"sigma0": 1e5, "sigma1": math.sqrt(1e5), "sigma2": 0.4, "Fc": 1.0, "Fs": 1.5, "vs": 1e-3}


@pytest.fixture
def mass(build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu("Mass"))


def stribeck(v: float) -> tuple[float, float]:
    """g(v) of the 1995 parameters and its slope."""
    peak = 0.5 * math.exp(-((v / 1e-3) ** 2))
    return 1.0 + peak, -2.0 * v / 1e-6 * peak


# ---- inputs


def test_a_slope_moves_its_input_during_the_step_and_is_then_forgotten(mass: Library) -> None:
    """v(1) of a mass with the force 2 + 3 s is 2 + 3/2; then the force stays at 5."""
    with Instance(mass) as run:
        run.initialise(F_drive=2.0)
        assert run.input_derivatives({"F_drive": 3.0}) == OK
        run.step(0.0, 1.0)
        assert run.get("F_drive", "v", "x") == pytest.approx([5.0, 3.5, 1.5], rel=1e-15)
        run.step(1.0, 1.0)
        assert run.get("F_drive", "v") == pytest.approx([5.0, 8.5], rel=1e-15)


def test_an_input_that_is_set_again_starts_the_slope_there(mass: Library) -> None:
    with Instance(mass) as run:
        run.initialise(F_drive=2.0)
        assert run.input_derivatives({"F_drive": 3.0}) == OK
        run.step(0.0, 1.0)
        run.set({"F_drive": 0.0})
        assert run.input_derivatives({"F_drive": -1.0}) == OK
        run.step(1.0, 1.0)
        assert run.get("F_drive", "v") == pytest.approx([-1.0, 3.0], rel=1e-15)


def test_slopes_of_one_step_may_come_in_several_calls(mass: Library) -> None:
    with Instance(mass) as run:
        run.initialise()
        for _ in range(2):
            t = run.get1("time")
            assert run.input_derivatives({"F_drive": 3.0}) == OK
            assert run.input_derivatives({"F_load": 1.0}) == OK
            run.step(t, 1.0)
        assert run.get("F_drive", "F_load") == [6.0, 2.0]


@pytest.mark.parametrize(("name", "inputs", "outputs"), [("Mass", "F_drive F_load", "v a"), ("PID", "r x", "u u")])
def test_what_stands_behind_the_number_of_elements_is_left_alone(
    build_fmu: Callable[..., Path], name: str, inputs: str, outputs: str
) -> None:
    with Instance(load(build_fmu(name))) as run:
        run.initialise(**dict.fromkeys(inputs.split(), 1.0))
        given, wanted = ((c_uint * 2)(*map(run.reference, names.split())) for names in (inputs, outputs))
        orders, seven = (c_int * 2)(1, 1), (c_double * 2)(7.0, 7.0)
        run.must("SetRealInputDerivatives", given, 1, orders, seven)
        run.must("SetReal", given, 1, seven)
        run.step(0.0, 1e-3)
        assert run.get(*inputs.split()) == [7.0 + 7e-3, 1.0]
        for function, more in (("GetReal", ()), ("GetRealOutputDerivatives", (orders,))):
            found = (c_double * 2)(-5.0, -5.0)
            run.must(function, wanted, 1, *more, found)
            assert found[0] != -5.0
            assert found[1] == -5.0
        alone, beside = ((c_double * 2)(-5.0, -5.0) for _ in range(2))
        run.must("GetDirectionalDerivative", wanted, 1, given, 1, seven, alone)
        run.must("GetDirectionalDerivative", wanted, 2, given, 1, (c_double * 2)(7.0, 0.0), beside)
        assert list(alone) == [beside[0], -5.0]


@pytest.mark.parametrize("order", some([-1, 0, 2, 3], [0, 2]))
def test_other_orders_than_the_first_are_refused(library: Library, running: Instance, order: int) -> None:
    before = running.serialised()
    for name in library.names("input", type="Real"):
        assert running.input_derivatives({name: 1.0}, order) == ERROR
    for name in library.names("output", type="Real"):
        value = c_double(-7.0)
        assert (
            running.call(
                "GetRealOutputDerivatives", (c_uint * 1)(running.reference(name)), 1, (c_int * 1)(order), value
            )
            == ERROR
        )
        assert value.value == -7.0
    assert all(message[1:3] == (ERROR, "logStatusError") for message in running.messages)
    assert running.serialised() == before


def test_only_inputs_have_input_derivatives_and_only_outputs_output_derivatives(
    library: Library, running: Instance
) -> None:
    before = running.serialised()
    for v in library.variables.values():
        if v.type == "Real" and v.causality != "input":
            assert running.input_derivatives({v.name: 1.0}) == ERROR, v.name
        if v.type == "Real" and v.causality != "output":
            value = c_double()
            reference = (c_uint * 1)(running.reference(v.name))
            assert running.call("GetRealOutputDerivatives", reference, 1, (c_int * 1)(1), value) == ERROR, v.name
    assert running.serialised() == before


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_slopes_that_are_not_finite_are_discarded(library: Library, running: Instance, bad: float) -> None:
    before = running.serialised()
    names = library.names("input", type="Real")
    for name in names:
        assert running.input_derivatives({names[0]: 1.0, name: bad} if name != names[0] else {name: bad}) == DISCARD
        assert running.messages[-1][1:3] == (DISCARD, "logStatusDiscard")
    assert running.serialised() == before


# ---- outputs


def test_the_rate_of_a_sine_is_its_own_output(build_fmu: Callable[..., Path]) -> None:
    with Instance(load(build_fmu("Sine"))) as run:
        run.initialise()
        for k in range(200):
            run.step(0.05 * k, 0.05)
            r, rd, rdd = run.output_derivatives("r", "rd", "rdd")
            _, velocity, acceleration = run.get("r", "rd", "rdd")
            jerk = -((2.0 * math.pi) ** 2) * velocity
            scale = 0.01 * 2.0 * math.pi
            assert r == pytest.approx(velocity, abs=1e-8 * scale)
            assert rd == pytest.approx(acceleration, abs=1e-8 * scale * 6.3)
            assert rdd == pytest.approx(jerk, abs=1e-8 * scale * 40.0)


def test_the_rates_of_a_mass_are_those_of_newton(mass: Library) -> None:
    with Instance(mass) as run:
        run.initialise(m=2.0, k=3.0, d=0.5, x0=0.1, v0=-0.2, F_drive=1.0)
        assert run.input_derivatives({"F_drive": 0.7, "v_support": 0.3}) == OK
        run.step(0.0, 0.01)
        v, a, v_support = run.get("v", "a", "v_support")
        jerk_of_force = 0.7 - 3.0 * (v - v_support) - 0.5 * (a - 0.3)
        expected = [v, a, v_support, jerk_of_force / 2.0, jerk_of_force]
        assert run.output_derivatives("x", "v", "x_support", "a", "F_ext") == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("v0", [1e-3, -2e-3])
def test_the_rate_of_the_friction_force_is_the_chain_rule(lugre: Library, v0: float) -> None:
    slope = 0.05
    with Instance(lugre) as run:
        run.initialise(v=v0, z=3e-6)
        assert run.input_derivatives({"v": slope}) == OK
        run.step(0.0, 1e-3)
        v, z, z_dot = run.get("v", "z", "der(z)")
        g, g_slope = stribeck(v)
        direction = math.copysign(1.0, v)
        z_2 = slope - 1e5 * (direction * slope * z + abs(v) * z_dot - abs(v) * z * g_slope * slope / g) / g
        expected = 1e5 * z_dot + P95["sigma1"] * z_2 + 0.4 * slope
        assert run.output_derivatives("F") == pytest.approx([expected], rel=1e-7)


# ---- directional derivatives


def test_a_mass_has_constant_partial_derivatives(mass: Library) -> None:
    m, k, d = 2.0, 3.0, 0.5
    with Instance(mass) as run:
        run.initialise(m=m, k=k, d=d, x0=0.1, v0=-0.2, F_drive=1.0)
        run.step(0.0, 0.01)
        unknowns = ("a", "F_ext", "der(v)", "der(x)", "der(x_support)")
        for known, expected in {
            "F_drive": (1 / m, 1, 1 / m, 0, 0),
            "F_load": (1 / m, 1, 1 / m, 0, 0),
            "F_friction": (-1 / m, 0, -1 / m, 0, 0),
            "v_support": (d / m, d, d / m, 0, 1),
            "x": (-k / m, -k, -k / m, 0, 0),
            "v": (-d / m, -d, -d / m, 1, 0),
            "x_support": (k / m, k, k / m, 0, 0),
        }.items():
            assert run.directional(unknowns, {known: 1.0}) == pytest.approx(expected, rel=1e-9, abs=1e-10), known
        together = run.directional(unknowns, {"F_drive": 2.0, "x": -1.0, "v": 0.5})
        by_hand = [2 / m + k / m - 0.5 * d / m, 2 + k - 0.5 * d, 2 / m + k / m - 0.5 * d / m, 0.5, 0]
        assert together == pytest.approx(by_hand, rel=1e-9, abs=1e-10)


def test_lugre_has_the_partial_derivatives_of_its_equations(lugre: Library) -> None:
    s0, s1 = 1e5, P95["sigma1"]
    draw = np.random.default_rng(1)
    for _ in range(300):
        v = float(draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-7.0, 1.0))
        z = float(draw.uniform(-1e-5, 1e-5))
        g, g_slope = stribeck(v)
        rate_by_v = 1.0 - s0 * z * (math.copysign(1.0, v) / g - abs(v) * g_slope / g**2)
        rate_by_z = -s0 * abs(v) / g
        by_v, by_z = [s1 * rate_by_v + 0.4, rate_by_v], [s0 + s1 * rate_by_z, rate_by_z]
        with Instance(lugre) as run:
            run.initialise(v=v, z=z)
            assert run.directional(["F", "der(z)"], {"v": 1.0}) == pytest.approx(by_v, rel=1e-8, abs=1e-8)
            assert run.directional(["F", "der(z)"], {"z": 1.0}) == pytest.approx(by_z, rel=1e-8)
            assert run.directional(["F"], {"v": -2e-3}) == pytest.approx([-2e-3 * by_v[0]], rel=1e-8, abs=1e-10)


def test_in_initialization_mode_parameters_are_known_too(lugre: Library, mass: Library) -> None:
    with Instance(lugre) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set({"v": 2e-3, "z": 1e-6})
        z_dot = 2e-3 - 1e5 * 2e-3 * 1e-6 / stribeck(2e-3)[0]
        assert run.directional(["F"], {"sigma2": 1.0}) == pytest.approx([2e-3], rel=1e-7)
        assert run.directional(["F"], {"sigma1": 1.0}) == pytest.approx([z_dot], rel=1e-7)
        run.must("ExitInitializationMode")
        arguments = (c_uint * 1)(run.reference("F")), 1, (c_uint * 1)(run.reference("sigma2")), 1
        assert run.call("GetDirectionalDerivative", *arguments, c_double(1.0), c_double()) == ERROR
    with Instance(mass) as run:
        run.setup()
        run.must("EnterInitializationMode")
        assert run.directional(["x", "v"], {"x0": 1.0, "v0": 2.0}) == pytest.approx([1.0, 2.0], rel=1e-9)


def test_directional_derivatives_of_and_by_the_wrong_variables_are_errors(library: Library, running: Instance) -> None:
    before = running.serialised()
    (output,) = library.names("output", type="Real")[:1]
    good = (c_uint * 1)(running.reference(output))
    for v in library.variables.values():
        wrong = (c_uint * 1)(int(v.valueReference))
        result = c_double(-7.0)
        if v.causality in ("parameter", "independent", "input") or v.type != "Real":
            assert running.call("GetDirectionalDerivative", wrong, 1, None, 0, None, result) == ERROR, v.name
        if v.causality in ("parameter", "independent") or v.type != "Real":
            assert running.call("GetDirectionalDerivative", good, 1, wrong, 1, c_double(1.0), result) == ERROR, v.name
        assert result.value == -7.0
    for name in library.names("input", type="Real"):
        known = (c_uint * 1)(running.reference(name))
        assert running.call("GetDirectionalDerivative", good, 1, known, 1, c_double(math.nan), c_double()) == ERROR
    assert running.serialised() == before


def test_a_directional_derivative_that_is_not_finite_is_an_error(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.initialise()
        run.set({"v": 1e308})
        result = c_double(-7.0)
        arguments = (c_uint * 1)(run.reference("F")), 1, (c_uint * 1)(run.reference("v")), 1
        assert run.call("GetDirectionalDerivative", *arguments, c_double(1.0), result) == ERROR
        assert run.messages[-1][1:3] == (ERROR, "logStatusError")
        assert result.value == -7.0


# ---- tolerance


def test_a_tolerance_is_honoured(lugre: Library) -> None:
    """Errors against scipy fall with the tolerance, down to nothing without one."""
    v0, slope, ends = 1e-4, 0.02, (0.025, 0.05, 0.075, 0.1)

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        v = v0 + slope * t
        return v - 1e5 * abs(v) * z / stribeck(v)[0]

    exact = solve_ivp(rate, (0.0, ends[-1]), [0.0], method="Radau", rtol=1e-13, atol=1e-20, t_eval=ends).y[0]
    errors = {}
    for tolerance in (1e-2, 1e-5, 1e-8, None):
        with Instance(lugre) as run:
            run.initialise(tolerance=tolerance, v=v0)
            for end, expected in zip(ends, exact, strict=True):
                t = run.get1("time")
                assert run.input_derivatives({"v": slope}) == OK
                run.step(t, end - t)
                errors[tolerance] = max(errors.get(tolerance, 0.0), abs(run.get1("z") / expected - 1.0))
    assert errors[1e-2] < 2e-2 and errors[1e-5] < 1e-4 and errors[1e-8] < 1e-7
    assert errors[None] < 1e-9
    assert errors[1e-2] > errors[1e-5] > errors[1e-8]
