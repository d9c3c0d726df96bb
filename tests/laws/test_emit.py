"""The C that is written from casadi expressions."""

from __future__ import annotations

import ctypes
import json
import math
import re
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from laws.draws import random_arguments
from shell.selection import EACH_FEATURE
from thorough import THOROUGH, nightly, some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.c_text import DOUBLE, FLOAT, kernel
from friction_fmus.lawkit.emit.operations import OPERATIONS, graph
from friction_fmus.lawkit.law import Kind, block_source, discover_laws

LAWS = discover_laws(laws_folder())
SOME_LAWS = [law for law in LAWS if law.name in EACH_FEATURE]


def everything() -> ca.Function:
    """Every operation that the emitter knows, on any two numbers."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    size, unit = ca.fabs(y), x / (1.0 + ca.fabs(x))
    results = [
        *(x + y, x - y, x * y, x / y, -x, ca.exp(unit), ca.log(size), size**x, size**1.5, ca.sqrt(size), x**2, 2 * x),
        *(ca.sin(x), ca.cos(x), ca.tan(x), ca.asin(unit), ca.acos(unit), ca.atan(x), x < y, x <= y, x == y, x != y),
        *(ca.logic_not(x), ca.logic_and(x, y), ca.logic_or(x, y), ca.floor(x), ca.ceil(x), ca.fmod(x, y), ca.fabs(x)),
        *(ca.sign(x), ca.copysign(x, y), ca.if_else(x, y, 0), ca.erf(x), ca.fmin(x, y), ca.fmax(x, y), 1 / x),
        *(ca.sinh(unit), ca.cosh(unit), ca.tanh(x), ca.asinh(x), ca.acosh(1 + size), ca.atanh(unit), ca.atan2(x, y)),
        *(ca.log1p(size), ca.expm1(unit), ca.hypot(x, y), ca.remainder(x, y)),
        # decisions: casadi's sum makes 0.0 of -0.0
        *(
            ca.if_else(x < y, x, y),
            ca.if_else(x < y, -x, ca.if_else(y > 1, y, -0.0)),
            ca.if_else(ca.logic_and(x, y), x, y),
        ),
        ca.if_else(x > 0, 1, -1),
        ca.if_else(x > y, x**2, ca.fabs(y)),
        ca.if_else(x + y, x * y, 1e-320),
        # truth values as numbers, constants, results that are arguments
        *((x > 0) - (x < 0), 0.1 + x, x * 1e300, x - 1 / 3, ca.SX(-2.5), ca.SX(0.0), x, ca.inf * x, -1e-3 * x),
    ]
    return ca.Function("everything", [x, y], results)


def special_pairs() -> np.ndarray:
    special = [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 1.7e308, -1.7e308, 2.5, -0.5]
    return np.array([(a, b) for a in special for b in special])


def test_the_synthetic_function_uses_every_operation():
    nodes, _ = graph(everything())
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    plain, _ = graph(ca.Function("f", [x, y], [ca.if_else(x, y, 0)]))
    used = {node.operation for node in nodes} | {node.operation for node in plain}
    assert OPERATIONS - used == {"FMA"}  # of pairs of floats alone, see test_travel.py


def test_every_operation_has_casadis_bits(workshop, by_casadi, different_bits):
    function = everything()
    evaluate = workshop.evaluator(function)
    random = np.random.default_rng(1)
    draws = random.normal(size=(5000, 2))
    rows = np.concatenate([special_pairs(), draws, 1e3 * draws[::-1], random.integers(-2, 3, (500, 2))])
    expected, found = by_casadi(function, rows), evaluate(rows)
    differ = different_bits(expected, found)
    # a NaN beside a number: fmin and fmax of the library drop it; which zero is smaller is open in C
    names = [str(result) for result in function(ca.SX.sym("x"), ca.SX.sym("y"))]
    order = [i for i, name in enumerate(names) if name.startswith(("fmin", "fmax"))]
    assert len(order) == 2
    differ[np.ix_(np.isnan(rows).any(axis=1) | (rows == 0.0).all(axis=1), order)] = False
    assert not differ.any(), (rows[differ.any(axis=1)][:3], np.flatnonzero(differ.any(axis=0)))


@pytest.mark.parametrize("law", some(LAWS, SOME_LAWS), ids=lambda law: law.name)
def test_every_law_has_casadis_bits(law, workshop, by_casadi, different_bits):
    rows = random_arguments(law, 20000, seed=2)
    expected, found = by_casadi(law.function, rows), workshop.evaluator(law.function)(rows)
    assert np.isfinite(expected).all()
    assert not different_bits(expected, found).any()
    results = (*law.select(Kind.OUTPUT), *law.select(Kind.STATE, Kind.STATES))
    # a sample with valid inputs ends each gap, so that the number of missed samples becomes 0
    varied = [variable.name != "missed" for variable in results for _ in variable.starts]
    assert (np.ptp(expected, axis=0)[varied] > 0.0).all()


@nightly
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_every_law_keeps_casadis_bits_over_a_long_run(law, workshop, different_bits):
    """States fed back for 1e5 samples each night, inputs and Booleans at random, parameters at their start values."""
    n = 100_000 if THOROUGH else 10_000
    rows = random_arguments(law, n, seed=3)
    labels = [variable for variable in law.given for _ in variable.starts]
    states = [i for i, variable in enumerate(labels) if variable.kind in (Kind.STATE, Kind.STATES)]
    fixed = [
        i
        for i, variable in enumerate(labels)
        if variable.kind not in (Kind.INPUT, Kind.OPTIONAL, Kind.COMMAND, Kind.STATE, Kind.STATES)
    ]
    starts = np.array([start for variable in law.given for start in variable.starts])
    rows[:, fixed] = starts[fixed]
    first_next = len(law.select(Kind.OUTPUT))

    buffer, evaluate = law.function.buffer()
    given, result = starts.copy(), np.zeros(law.function.n_out())
    for i in range(given.size):
        buffer.set_arg(i, memoryview(given[i : i + 1]))
    for i in range(result.size):
        buffer.set_res(i, memoryview(result[i : i + 1]))
    expected = np.empty((n, result.size))
    state = starts[states]
    for k in range(n):
        rows[k, states] = state
        given[:] = rows[k]
        evaluate()
        expected[k] = result
        state = result[first_next:].copy()
    # the compiled code agrees in every sample, given the same state: so it agrees in the run
    assert not different_bits(expected, workshop.evaluator(law.function)(rows)).any()


A, B = ca.SX.sym("a"), ca.SX.sym("b")


@pytest.mark.parametrize(("results", "expected"), [((B + 1, A * 2), (6.0, 6.0)), ((B, A), (5.0, 3.0))])
def test_a_result_may_be_stored_where_an_argument_is(results, expected, workshop):
    """casadi's own code gives something else when results alias arguments; this must not."""
    written = kernel(ca.Function("f", [A, B], [*results]), ["p[0]", "p[1]"], ["p[0]", "p[1]"])
    head = '__attribute__((visibility("default"))) void f(double *p)'
    values = (ctypes.c_double * 2)(3.0, 5.0)
    ctypes.CDLL(
        str(
            workshop.library(
                "\n".join(
                    [
                        "#include <stdbool.h>\n#include <stdint.h>",
                        f"{head};",
                        "void f(double *p) {",
                        *written.lines,
                        "}",
                        "",
                    ]
                )
            )
        )
    ).f(values)
    assert tuple(values) == expected


def test_branches_store_results_where_their_arguments_are(workshop):
    """Two states change places in a branch that pays."""
    long = ca.exp(A) + ca.exp(B)
    results = [ca.if_else(A > 0, B, long), ca.if_else(A > 0, A, long)]
    written = kernel(ca.Function("f", [A, B], results), ["p[0]", "p[1]"], ["p[0]", "p[1]"])
    assert any(line.startswith("if (") for line in written.lines)
    head = '__attribute__((visibility("default"))) void f(double *p)'
    text = "\n".join(
        [
            "#include <math.h>\n#include <stdbool.h>\n#include <stdint.h>",
            f"{head};",
            "void f(double *p) {",
            *written.lines,
            "}",
            "",
        ]
    )
    values = (ctypes.c_double * 2)(3.0, 5.0)
    ctypes.CDLL(str(workshop.library(text))).f(values)
    assert tuple(values) == (5.0, 3.0)


def test_only_the_side_that_is_taken_is_computed():
    """A call stands in the branch that needs it; one that both sides need before it; cheap sides have no branch."""
    condition, both = A < B, ca.sin(A)
    lines = kernel(ca.Function("f", [A, B], [ca.if_else(condition, ca.exp(A) + both, both)]), "ab", "c").lines
    text = "\n".join(lines)
    assert text.index("sin(a)") < text.index("if (") < text.index("exp(a)") < text.index("} else {")
    cheap = kernel(ca.Function("f", [A, B], [ca.if_else(condition, A + 1, A - 1)]), "ab", "c").lines
    assert not any("if" in line for line in cheap)


CHOSEN = ca.if_else(A < B, A, B)


@pytest.mark.parametrize(
    ("result", "shows"),
    [
        *((CHOSEN < 1, False), (CHOSEN**2, False), (1 / (CHOSEN - 3), False), (CHOSEN - A, False), (CHOSEN, False)),
        *((ca.sign(CHOSEN), False), (ca.atan2(1, CHOSEN), False), (1 / CHOSEN, True), (A / ca.sign(CHOSEN), True)),
        *((1 / (CHOSEN * 3), True), (ca.atan2(A, CHOSEN), True), (ca.copysign(A, ca.sin(CHOSEN)), True)),
    ],
)
def test_minus_zero_is_made_plus_only_where_it_changes_a_number(result, shows):
    """By IEEE 754: a divisor and the arguments of atan2 tell the zeros apart; sums, products and comparisons do not."""
    lines = kernel(ca.Function("f", [A, B], [result]), "ab", "c").lines
    assert any("+ 0.0" in line for line in lines) == shows


@pytest.mark.parametrize(("divisor", "shows"), [(A, True), (B, False)])
def test_minus_zero_is_made_plus_if_a_later_call_divides_by_it(divisor, shows):
    lines = kernel(ca.Function("f", [A, B], [CHOSEN, 1 / divisor]), "ab", ["states->a", "c"]).lines
    assert any("+ 0.0" in line for line in lines) == shows


def test_selects_that_need_each_other_share_two_branches():
    """All of the first ones are taken in one branch, all that need them in a second."""
    first = [ca.if_else(A < B, ca.exp(A + i), ca.sin(B + i)) for i in range(3)]
    total = sum(first)
    second = [ca.if_else(A < B, ca.cos(total + i), total) for i in range(3)]
    lines = kernel(ca.Function("f", [A, B], [sum(second) * total]), "ab", "c").lines
    assert sum(line.startswith("if (") for line in lines) == 2


def random_function(random: np.random.Generator) -> ca.Function:
    """Operations and decisions on what was computed before, at random, some of them shared, some in circles."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    values, conditions = [x, y, x + y], [x < y, x > 0]
    for _ in range(40):
        a, b, c = (values[random.integers(len(values))] for _ in range(3))
        condition = conditions[random.integers(len(conditions))]
        kind = random.integers(8)
        if kind == 0:
            conditions.append([a < b, ca.logic_or(condition, a > c), ca.logic_not(condition)][random.integers(3)])
        else:
            decisions = [ca.if_else(condition, a, b), ca.if_else(condition, c, 0)]
            values.append([a + b, ca.sin(a) - c, *decisions, a * c, b / a, ca.atan2(a, b)][kind - 1])
    return ca.Function("f", [x, y], values[-4:])


@pytest.mark.parametrize("seed", some(range(80), range(4)))
def test_random_decisions_have_casadis_bits(seed, workshop, by_casadi, different_bits):
    random = np.random.default_rng(seed)
    function = random_function(random)
    zeros = np.array([(a, b) for a in (0.0, -0.0, 1.0, -1.0) for b in (0.0, -0.0, 1.0, -1.0)])
    rows = np.concatenate([random.normal(size=(300, 2)), random.integers(-1, 2, (50, 2)).astype(float), zeros])
    expected = by_casadi(function, rows)
    assert not different_bits(expected, workshop.evaluator(function)(rows)).any()
    assert not different_bits(expected, workshop.evaluator(function, in_place=True)(rows)).any()


def test_literals_read_back_exactly():
    random = np.random.default_rng(4)
    numbers = [*(random.normal(size=200) * 10.0 ** random.uniform(-300, 300, 200)), 0.1, 1e-320, 1e22, 1 / 3, -2.0, 0.0]
    for number in numbers:
        assert float(DOUBLE.literal(number)) == number
        assert re.search(r"[.e]", DOUBLE.literal(number))
    assert DOUBLE.literal(-0.0) == "-0.0"
    assert FLOAT.literal(0.5) == "0.5f"


def test_a_guard_against_zero_stays_above_zero_in_float():
    for guard in (1e-300, -1e-300, 1e-45):
        literal = np.float32(FLOAT.literal(guard).strip("f"))
        assert abs(literal) == np.finfo(np.float32).tiny
        assert np.sign(literal) == np.sign(guard)
    assert FLOAT.literal(0.0) == "0.0f"


def test_float_code_uses_float_only(workshop, by_casadi):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    decision = ca.if_else(x < y, ca.tanh(x), 0.1 * y)
    results = [ca.exp(-(x**2)) + ca.sin(y), decision, ca.sign(x) + (x > y), ca.hypot(x, y)]
    function = ca.Function("smooth", [x, y], results)
    rows = np.random.default_rng(5).normal(size=(5000, 2)).astype(np.float32)
    found = workshop.evaluator(function, FLOAT, "-Wdouble-promotion")(rows)
    assert np.abs(found - by_casadi(function, rows.astype(float))).max() < 2e-6
    written = kernel(function, ["x", "y"], ["a", "b", "c", "d"], real=FLOAT)
    assert written.functions == {"expf", "sinf", "tanhf", "hypotf"}
    assert not re.search(r"double|\d\.\d+(?![\df])", "\n".join(written.lines))


@pytest.mark.parametrize("law", some(LAWS, SOME_LAWS), ids=lambda law: law.name)
def test_every_law_is_clean_c_in_float(law, workshop):
    workshop.evaluator(law.function, FLOAT, "-Wdouble-promotion")


def test_a_decision_is_one_ternary():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    written = kernel(ca.Function("f", [x, y], [ca.if_else(x < y, 1.0, 2.0), ca.if_else(x < y, x, 0.0)]), "xy", "ab")
    assert written.lines == (
        "const bool t1 = x < y;",
        "a = t1 ? 1.0 : 2.0;",
        "b = t1 ? x : 0.0;",
    )


def test_names_that_are_taken_are_left_out():
    x = ca.SX.sym("x")
    assert (
        kernel(ca.Function("f", [x], [(x + 1) ** 2]), ["t1"], ["y"], taken=["t1", "t2"]).lines[0]
        == "const double t3 = t1 + 1.0;"
    )


def test_unknown_operations_are_refused_by_name():
    x = ca.SX.sym("x")
    with pytest.raises(FrictionError, match="f uses the casadi operation ERFINV, which has no C form"):
        kernel(ca.Function("f", [x], [ca.erfinv(x)]), ["x"], ["y"])


def test_functions_that_are_not_scalar_sx_are_refused():
    x, v, z = ca.MX.sym("x"), ca.SX.sym("v", 2), ca.SX.sym("z")
    with pytest.raises(FrictionError, match="does not consist of SX"):
        kernel(ca.Function("f", [x], [ca.sin(x)]), ["x"], ["y"])
    with pytest.raises(FrictionError, match="argument 0 of f is not a scalar"):
        kernel(ca.Function("f", [v], [v[0]]), ["x"], ["y"])
    with pytest.raises(FrictionError, match="result 0 of f is not a scalar"):
        kernel(ca.Function("f", [z], [ca.vertcat(z, z)]), ["x"], ["y"])


def test_constants_beyond_float_are_refused():
    x = ca.SX.sym("x")
    with pytest.raises(FrictionError, match="too large for the type float"):
        kernel(ca.Function("f", [x], [x * 1e300]), ["x"], ["y"], real=FLOAT)


@pytest.fixture(scope="module")
def texts_of_another_process():
    paths = [str(law.path) for law in LAWS]
    script = (
        "import json\nfrom friction_fmus.lawkit.law import block_source\n"
        "from friction_fmus.lawkit.law import discover_laws\n"
        f"print(json.dumps({{path: block_source(discover_laws(path)[0]) for path in {paths!r}}}))"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


@pytest.mark.parametrize("law", some(LAWS, SOME_LAWS), ids=lambda law: law.name)
def test_block_text_is_the_same_in_another_process(law, texts_of_another_process):
    text = block_source(law)
    assert texts_of_another_process[str(law.path)] == text
    assert str(law.path.parent) not in text
    assert "\t" not in text
    assert all(line == line.rstrip() for line in text.splitlines())
