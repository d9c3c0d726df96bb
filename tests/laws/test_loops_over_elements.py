"""Operations on the elements of vectors: loops with casadi's numbers, and what stays outside them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import casadi as ca
import numpy as np
import pytest
from casadi import SX
from thorough import some

from friction_fmus.codegen.law_export import make_export
from friction_fmus.lawkit.emit.c_text import kernel

N = 5
NAMES = [*(f"{vector}[{i}]" for vector in "abc" for i in range(N)), "x", "y"]
"""Arguments: three vectors, of which b and c are also results, and two numbers."""


def random_law(random: np.random.Generator) -> ca.Function:
    """Random operations on elements, sums of elements, and numbers; results are two vectors and two numbers."""
    arguments = [SX.sym(re.sub(r"\W", "", name)) for name in NAMES]
    a, b, c = (arguments[N * k : N * (k + 1)] for k in range(3))
    scalars, conditions = arguments[3 * N :], [arguments[-1] > 0.0]
    vectors: list[Sequence[SX]] = [a, b, c, [SX(i + 3.0) for i in range(N)]]
    truths: list[Sequence[SX]] = [[value > 0.0 for value in a]]
    for _ in range(25):
        one, two = (vectors[random.integers(len(vectors))] for _ in range(2))
        number, other = (scalars[random.integers(len(scalars))] for _ in range(2))
        decided = conditions[random.integers(len(conditions))]
        truth = truths[random.integers(len(truths))]
        kind = random.integers(11)
        if kind < 6:
            made = [
                [p + q for p, q in zip(one, two, strict=True)],
                [p * number for p in one],
                [ca.sin(p) - q for p, q in zip(one, two, strict=True)],
                [ca.if_else(decided, p * q + number, ca.exp(-(q**2))) for p, q in zip(one, two, strict=True)],
                [ca.if_else(t, p, q * number) for p, q, t in zip(one, two, truth, strict=True)],
                [ca.if_else(t, ca.cos(p) * number + q, p - q) for p, q, t in zip(one, two, truth, strict=True)],
            ]
            vectors.append(made[kind])
        elif kind < 8:
            truths.append([[p < q for p, q in zip(one, two, strict=True)], [p > number for p in one]][kind - 6])
        elif kind == 8:
            scalars.append(sum(one[1:], one[0]) if random.integers(2) else sum(one, number))
        elif kind == 9:
            scalars.append(ca.if_else(decided, number * other, other - number))
        else:
            conditions.append(number < other)
    results = [*vectors[-1], *vectors[-2], scalars[-1], scalars[-2]]
    return ca.Function("f", arguments, results)


@pytest.mark.parametrize("seed", some(range(80), range(4)))
def test_random_operations_on_elements_have_casadis_bits(seed, workshop, by_casadi, different_bits):
    random = np.random.default_rng(seed)
    function = random_law(random)
    rows = np.concatenate(
        [random.normal(size=(200, len(NAMES))), random.integers(-2, 3, (50, len(NAMES))).astype(float)]
    )
    writes = [*(f"{vector}[{i}]" for vector in ("bc", "cb")[seed % 2] for i in range(N)), "x", "y"]
    places = {name: f"v->{name}" for name in NAMES}
    found = kernel(function, list(places.values()), [places[name] for name in writes])
    members = f"double a[{N}], b[{N}], c[{N}], x, y;"
    assert not different_bits(
        by_casadi(function, rows), workshop.in_struct(found, members, list(places.values()), writes)(rows)
    ).any()


def loops(result: Sequence[SX], arguments: Sequence[SX], reads: Sequence[str], writes: Sequence[str]) -> str:
    return "\n".join(kernel(ca.Function("f", [*arguments], [*result]), reads, writes).lines)


A = [SX.sym(f"a{i}") for i in range(4)]
READS = [f"a[{i}]" for i in range(4)]


def test_a_sum_has_the_order_of_its_elements():
    assert loops([sum(A[1:], A[0])], A, READS, ["u"]) == (
        "double t1 = 0.0;\nfor (int32_t i = 0; i < 4; i++) {\n    t1 += a[i];\n}\nu = t1;"
    )
    assert "for (" not in loops([A[1] + A[2] + A[0] + A[3]], A, READS, ["u"])
    assert "for (" not in loops([A[0] + A[2] + A[1] + A[3]], A, READS, ["u"])


def test_a_sum_of_minus_zeros_keeps_its_sign_if_it_matters(workshop, by_casadi, different_bits):
    """1/(-0.0 - 0.0 - ...) is minus infinity."""
    function = ca.Function("f", A, [1.0 / sum(A[1:], A[0])])
    rows = np.array([[-0.0] * 4, [0.0, -0.0, -0.0, -0.0], [0.0] * 4, [1.0, -1.0, 0.0, -0.0]])
    assert not different_bits(by_casadi(function, rows), workshop.evaluator(function)(rows)).any()
    assert "= -0.0;" in loops([1.0 / sum(A[1:], A[0])], A, READS, ["u"])


def test_elements_that_are_used_singly_stay_outside_loops():
    cubes, places = [ca.sin(a + 1.0) ** 2 for a in A], [f"u[{i}]" for i in range(4)]
    assert "for (" in loops(cubes, A, READS, places)
    assert "for (" not in loops([*cubes, ca.sin(A[2] + 1.0) * 3.0], A, READS, [*places, "x"])
    assert "for (" not in loops(cubes, A, READS, ["x", *places[1:]])


def test_a_shifted_vector_is_not_overwritten_in_a_loop():
    """Each element becomes a function of its neighbour."""
    assert "for (" not in loops([2.0 * A[0], *(2.0 * a for a in A[:3])], A, READS, READS)
    lines = loops([2.0 * a for a in A], A, READS, READS).splitlines()
    assert [line.strip() for line in lines[1:]] == ["const double t1 = 2.0 * a[i];", "a[i] = t1;", "}"]


def test_what_the_elements_share_is_computed_once():
    x = SX.sym("x")
    text = loops([a * ca.exp(x) for a in A], [*A, x], [*READS, "x"], [f"u[{i}]" for i in range(4)])
    assert text.index("exp(x)") < text.index("for (")


def test_a_table_is_read_by_rows():
    """Two rows of a table with the same weights: one loop, in which the second row has an offset."""
    weights, table = [SX.sym(f"w{i}") for i in range(4)], [SX.sym(f"t{i}") for i in range(8)]
    rows = [sum(weights[j] * table[4 * i + j] for j in range(4)) for i in range(2)]
    reads = [*(f"w[{i}]" for i in range(4)), *(f"t[{i}]" for i in range(8))]
    text = loops(rows, [*weights, *table], reads, ["x", "y"])
    assert text.count("for (") == 1
    assert "t1 += w[i] * t[i];" in text and "t2 += w[i] * t[i + 4];" in text


def test_a_part_of_a_vector_has_an_offset():
    text = loops([sum(ca.sin(a) for a in A[1:])], A, READS, ["u"])
    assert "i < 3;" in text and "t1 += sin(a[i + 1]);" in text


@pytest.mark.parametrize("name", ["GMSFeedforward", "GMSObserver"])
def test_elements_of_a_law_are_in_loops(name: str) -> None:
    """All ten elements: numbers in brackets are lengths of arrays."""
    text = "\n".join(make_export(name).kernel.lines)
    assert not re.search(r"\[\d+\](?!;)", text)
    assert re.findall(r"for \(.*\{", text) == ["for (int32_t i = 0; i < 10; i++) {"] * text.count("for (")
    assert len(text) < 7000
