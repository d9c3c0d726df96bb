"""The graph of operations of a casadi function, from which C code is generated."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import casadi
from casadi import Function

from friction_fmus.errors import FrictionError

INFIX = {"ADD": "+", "SUB": "-", "MUL": "*", "DIV": "/"}
COMPARE = {"LT": "<", "LE": "<=", "EQ": "==", "NE": "!="}
LOGIC = {"AND": "&&", "OR": "||"}
CONDITIONS = {*COMPARE, *LOGIC, "NOT"}
LIBM = {
    **{name.upper(): name for name in ("exp", "log", "pow", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan")},
    **{name.upper(): name for name in ("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "atan2", "log1p", "expm1")},
    **{name.upper(): name for name in ("floor", "ceil", "fmod", "fabs", "copysign", "erf", "hypot", "remainder")},
    "CONSTPOW": "pow",
    "FMA": "fma",  # for pairs; casadi has no fma
}
FORMULAS = {"NEG", "SQ", "TWICE", "INV", "SIGN", "FMIN", "FMAX"}
CALLS = {*LIBM} - {"FABS", "COPYSIGN", "SQRT"}  # the others compile to instructions
_NAMES = {getattr(casadi, name): name.removeprefix("OP_") for name in dir(casadi) if name.startswith("OP_")}
OPERATIONS = {*INFIX, *CONDITIONS, *LIBM, *FORMULAS, "IF_ELSE_ZERO"}


@dataclass(frozen=True)
class Node:
    """An operation."""

    operation: str
    """Its name."""
    arguments: tuple[int, ...] = ()
    """Indices of its arguments."""
    value: float = 0.0
    """The value of a constant, the index of an input, the first value of the index of a loop."""
    lanes: int = 0
    """Number of elements of a vector; 0 for a scalar."""
    brief: bool = False
    """Whether its expression is repeated at each use."""

    @property
    def is_leaf(self) -> bool:
        """Whether it is computed wherever it is used: an argument, a number, an index or a brief expression."""
        return self.brief or self.operation in ("CONST", "INPUT", "INDEX")


def graph(function: Function) -> tuple[list[Node], list[int]]:
    """Return the operations of a scalar SX function in casadi's order, and the indices of the results."""
    if not function.is_a("SXFunction"):
        raise FrictionError(f"The function {function.name()} does not consist of SX expressions; rewrite it with SX")
    for label, count, sparsity in (
        ("argument", function.n_in(), function.sparsity_in),
        ("result", function.n_out(), function.sparsity_out),
    ):
        for i in range(count):
            if not (sparsity(i).is_scalar() and sparsity(i).is_dense()):
                raise FrictionError(f"The {label} {i} of {function.name()} is not a scalar; split the vectors")

    nodes: list[Node] = []
    numbers: dict[tuple[str, tuple[int, ...], bytes], int] = {}  # equal operations are computed once
    held: dict[int, int] = {}  # index in casadi's work vector -> node
    results = [0] * function.n_out()
    for k in range(function.n_instructions()):
        operation = _NAMES.get(function.instruction_id(k), str(function.instruction_id(k)))
        reads, writes = function.instruction_input(k), function.instruction_output(k)
        if operation == "OUTPUT":
            results[writes[0]] = held[reads[0]]
            continue
        if operation in ("ASSIGN", "LIFT"):
            held[writes[0]] = held[reads[0]]
            continue
        if operation == "INPUT":
            node = Node("INPUT", (), reads[0])
        elif operation == "CONST":
            node = Node("CONST", (), function.instruction_constant(k))
        elif operation in OPERATIONS:
            node = _joined(nodes, Node(operation, tuple(held[place] for place in reads)))
        else:
            raise FrictionError(
                f"{function.name()} uses the casadi operation {operation}, which has no C form; "
                "express it by arithmetic, if_else and the functions of <math.h>"
            )
        held[writes[0]] = numbers.setdefault((node.operation, node.arguments, struct.pack("d", node.value)), len(nodes))
        if held[writes[0]] == len(nodes):
            nodes.append(node)
    return nodes, results


def _joined(nodes: list[Node], node: Node) -> Node:
    """Join casadi's form of if_else(c, a, b), which is (c ? a : 0) + (!c ? b : 0), into one decision."""
    if node.operation == "ADD":
        terms = [nodes[argument] for argument in node.arguments]
        for first, second in (terms, terms[::-1]):
            if first.operation == second.operation == "IF_ELSE_ZERO":
                opposite = nodes[second.arguments[0]]
                if opposite.operation == "NOT" and opposite.arguments[0] == first.arguments[0]:
                    return Node("SELECT", (*first.arguments, second.arguments[1]))
    return node
