"""The inner solver and the sampling, on blocks written for it: several states, stiffness, time, blow-up."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from ctypes import c_double

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from shell.instance import DISCARD, LAST_SUCCESSFUL_TIME, OK, Instance, Library, drive, load
from thorough import THOROUGH, some

from friction_fmus import build

BLOCKS = {
    # x'' = -sin x - 0.1 x' + 0.5 cos(2 t) + u
    "Pendulum": """
        INPUT (u, NO_UNIT, 0.0, "push") \\
        STATE_OUTPUT(x, NO_UNIT, x0, 1.0, "angle") \\
        STATE (w, NO_UNIT, 0.5, 1.0, "rate") \\
        FIXED (x0, NO_UNIT, 1.0, -INF, INF, "initial angle")
        |m->der_x = w; m->der_w = -sin(x) - 0.1 * w + 0.5 * cos(2.0 * m->time) + u;""",
    # van der Pol, mu large: relaxation oscillations
    "VanDerPol": """
        OUTPUT(y, NO_UNIT, "twice x") \\
        STATE (x, NO_UNIT, 2.0, 1.0, "x") \\
        STATE (w, NO_UNIT, 0.0, 1.0, "x'") \\
        PARAMETER(mu, NO_UNIT, 1000.0, 0.0, INF, "stiffness")
        |m->der_x = w; m->der_w = mu * (1.0 - x * x) * w - x; m->y = 2.0 * x;""",
    # Robertson's reactions
    "Robertson": """
        STATE_OUTPUT(a, NO_UNIT, a0, 1.0, "a") \\
        STATE (b, NO_UNIT, 0.0, 1e-4, "b") \\
        STATE (c, NO_UNIT, 0.0, 1.0, "c") \\
        FIXED (a0, NO_UNIT, 1.0, 0.0, INF, "initial a")
        |const double k1 = 0.04 * a, k2 = 3e7 * b * b, k3 = 1e4 * b * c;
        m->der_a = k3 - k1; m->der_b = k1 - k2 - k3; m->der_c = k2;""",
    # x' = x^2, infinite at t = 1
    "BlowUp": """
        STATE_OUTPUT(x, NO_UNIT, x0, 1.0, "x") \\
        FIXED (x0, NO_UNIT, 1.0, -INF, INF, "initial x")
        |m->der_x = x * x;""",
    # a vector of states, named so that der(d[1]) is not easily spelt
    "Decays": """
        STATES(d, 3, NO_UNIT, (1.0, 2.0, 3.0), 1.0, "decaying number") \\
        OUTPUT(y, NO_UNIT, "sum") \\
        PARAMETERS(rate, 3, FREQUENCY, (1.0, 10.0, 100.0), 0.0, INF, "rate of decay")
        |m->y = 0.0;
        for (int i = 0; i < 3; i++) { m->der_d[i] = -rate[i] * d[i]; m->y += d[i]; }""",
    # counts its samples and adds up its input
    "Counter": """
        INPUT (u, NO_UNIT, 0.0, "summand") \\
        STATE_OUTPUT(n, NO_UNIT, n0, 1.0, "number of samples") \\
        OUTPUT(before, NO_UNIT, "sum before this sample") \\
        STATE (sum, NO_UNIT, 2.0, 1.0, "sum") \\
        FIXED (n0, NO_UNIT, 10.0, -INF, INF, "initial number") \\
        FIXED (Ts, TIME, 0.1, 1e-9, INF, "sample time")
        |m->before = sum; m->sum = sum + u; m->n = n + 1.0;""",
}


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Library]:
    folder = tmp_path_factory.mktemp("blocks")

    def make(name: str) -> Library:
        table, body = BLOCKS[name].split("|")
        source = folder / f"{name}.c"
        sampled = name == "Counter"
        lines = [
            f"#define MODEL {name}",
            '#define SUMMARY "for a test"',
            '#define SOURCE "none"',
            *(["#define SAMPLED"] if sampled else []),
            f"#define VARIABLES \\\n{table.strip()}",
            '#include "block.h"',
            f"static void {'sample' if sampled else 'equations'}(Model *m)",
            f"{{ GIVEN(m) {body} }}",
        ]
        source.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return load(build(source, folder))

    return make


@pytest.fixture
def counter(block: Callable[[str], Library]) -> Iterator[Instance]:
    with Instance(block("Counter")) as made:
        yield made


@pytest.mark.parametrize("name", some([*BLOCKS], [*BLOCKS][:1]))
def test_these_blocks_are_valid(block: Callable[[str], Library], name: str) -> None:
    assert validate_fmu(str(block(name).fmu)) == []


def scipy_at(times: list[float], rate: Callable[[float, np.ndarray], list[float]], start: list[float]) -> np.ndarray:
    solution = solve_ivp(rate, (0.0, times[-1]), start, "LSODA", t_eval=times, rtol=1e-12, atol=1e-14)
    assert solution.success
    return np.asarray(solution.y.T)


@pytest.mark.parametrize("h", [0.01, 0.5, 5.0])
def test_equations_in_time_and_two_states_follow_scipy(block: Callable[[str], Library], h: float) -> None:
    times = [h * (k + 1) for k in range(round(10.0 / h))]

    def rate(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -math.sin(y[0]) - 0.1 * y[1] + 0.5 * math.cos(2.0 * t) + 0.2 * t]

    expected = scipy_at(times, rate, [1.0, 0.5])
    with Instance(block("Pendulum")) as run:
        run.initialise()
        found = []
        for k in range(len(times)):
            run.set({"u": 0.2 * k * h})
            assert run.input_derivatives({"u": 0.2}) == OK
            run.step(k * h, h)
            found.append(run.get("x", "w"))
    np.testing.assert_allclose(found, expected, atol=2e-8)


def test_stiff_equations_follow_scipy(block: Callable[[str], Library]) -> None:
    times = [1.0, 400.0, 800.0, 820.0, 1500.0]
    expected = scipy_at(times, lambda t, y: [y[1], 1000.0 * (1.0 - y[0] ** 2) * y[1] - y[0]], [2.0, 0.0])
    with Instance(block("VanDerPol")) as run:
        run.initialise()
        t, found = 0.0, []
        for end in times:
            run.step(t, end - t)
            t = end
            found.append(run.get1("x"))
    np.testing.assert_allclose(found, expected[:, 0], rtol=1e-6)


def test_states_of_very_different_size_follow_scipy(block: Callable[[str], Library]) -> None:
    def rate(_: float, y: np.ndarray) -> list[float]:
        k1, k2, k3 = 0.04 * y[0], 3e7 * y[1] ** 2, 1e4 * y[1] * y[2]
        return [k3 - k1, k1 - k2 - k3, k2]

    times = [0.4, 40.0, 4000.0, 4e5]
    expected = scipy_at(times, rate, [1.0, 0.0, 0.0])
    with Instance(block("Robertson")) as run:
        run.initialise()
        t = 0.0
        for end, (a, b, c) in zip(times, expected, strict=True):
            run.step(t, end - t)
            t = end
            assert run.get("a", "b", "c") == pytest.approx([a, b, c], rel=1e-6)
            assert sum(run.get("a", "b", "c")) == pytest.approx(1.0, abs=1e-9)


def test_a_vector_of_states_decays_element_by_element(block: Callable[[str], Library]) -> None:
    library = block("Decays")
    assert [name for name in library.variables if "d" in name] == [
        *("d[1]", "d[2]", "d[3]", "der(d[1])", "der(d[2])", "der(d[3])")
    ]
    for k in (1, 2, 3):
        assert library.variables[f"der(d[{k}])"].derivative is library.variables[f"d[{k}]"]
    with Instance(library) as run:
        run.initialise(**{"d[2]": 4.0})
        run.step(0.0, 0.05)
        expected = [start * math.exp(-rate * 0.05) for start, rate in ((1.0, 1.0), (4.0, 10.0), (3.0, 100.0))]
        assert run.get("d[1]", "d[2]", "d[3]") == pytest.approx(expected, rel=1e-8)
        assert run.get1("y") == pytest.approx(sum(expected), rel=1e-8)
        assert run.output_derivatives("y") == pytest.approx(
            [sum(run.get("der(d[1])", "der(d[2])", "der(d[3])"))], rel=1e-8
        )


def test_a_solution_that_ends_within_the_step_is_discarded_soon(block: Callable[[str], Library]) -> None:
    with Instance(block("BlowUp")) as run:
        run.initialise()
        run.step(0.0, 0.5)
        assert run.get1("x") == pytest.approx(2.0, rel=1e-8)
        begin = time.perf_counter()
        assert run.call("DoStep", 0.5, 1.0, 1) == DISCARD
        assert not THOROUGH or time.perf_counter() - begin < 2.0
        last = c_double()
        assert run.call("GetRealStatus", LAST_SUCCESSFUL_TIME, last) == OK
        assert last.value == 0.5
        assert run.get1("x") == pytest.approx(2.0, rel=1e-8)


# ---- sampling


def test_a_sampled_state_that_is_an_output_starts_at_its_parameter(counter: Instance) -> None:
    counter.setup()
    counter.must("EnterInitializationMode")
    assert counter.get("n", "sum", "before") == [10.0, 2.0, 2.0]
    counter.set({"n0": 20.0, "sum": 3.0})
    assert counter.get("n", "sum", "before") == [20.0, 3.0, 3.0]
    counter.must("ExitInitializationMode")
    assert counter.get("n", "sum", "before") == [20.0, 3.0, 3.0]
    counter.step(0.0, 0.1)
    assert counter.get("n", "sum", "before") == [21.0, 3.0, 3.0]


@pytest.mark.parametrize("h", [0.1, 0.05, 0.025, 0.2, 0.1 / 3.0, 1.0 / 60.0, 0.07, 1.0])
def test_a_block_samples_at_start_plus_k_ts_whatever_the_step(counter: Instance, h: float) -> None:
    """All k with start + k Ts in [start, t), although the times in steps of h differ from them by rounding."""
    start = 0.3
    counter.initialise(start=start)
    for k in range(round(20.0 / h)):
        counter.step(start + k * h, h)
        passed = (k + 1) * h
        assert counter.get1("n") == 10 + math.ceil(passed / 0.1 - 1e-6)


def test_a_sample_sees_the_input_of_its_moment(counter: Instance) -> None:
    """u = 3 + 4 (t - 0) at 0, 0.1, 0.2 within one step."""
    counter.initialise(u=3.0)
    assert counter.input_derivatives({"u": 4.0}) == OK
    counter.step(0.0, 0.3)
    assert counter.get("sum", "u") == pytest.approx([2.0 + 3.0 + 3.4 + 3.8, 3.0 + 1.2], rel=1e-14)


def test_outputs_of_a_sampled_block_are_held_until_the_next_sample(counter: Instance) -> None:
    counter.initialise()
    held = []
    for k in range(8):
        counter.set({"u": float(k)})
        counter.step(k * 0.025, 0.025)
        held.append(counter.get1("sum"))
    assert held == [2.0] * 4 + [6.0] * 4


def test_looking_at_a_sampled_block_takes_no_sample(counter: Instance) -> None:
    counter.initialise()
    for _ in range(5):
        counter.set({"u": 1.0})
        counter.everything()
    assert counter.get("n", "sum") == [10.0, 2.0]
    drive(counter, [{"u": 1.0}], 0.0, 0.1)
    assert counter.get("n", "sum") == [11.0, 3.0]
