"""The graph of operations of a casadi function, from which C code is generated, and the signs of its zeros."""

import math
import struct
from collections.abc import Collection, Iterable, Mapping, Sequence
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

    operation: str  # its name
    arguments: tuple[int, ...] = ()  # indices of its arguments
    value: float = 0.0  # the value of a constant, the index of an input, the first value of the index of a loop
    lanes: int = 0  # number of elements of a vector; 0 for a scalar
    brief: bool = False  # whether its expression is repeated at each use

    @property
    def is_leaf(self) -> bool:
        """Whether it is computed wherever it is used: an argument, a number, an index or a brief expression."""
        return self.brief or self.operation in ("CONST", "INPUT", "INDEX")


def needed_for(nodes: Sequence[Node], results: Iterable[int]) -> set[int]:
    """Return the nodes on which results depend."""
    found = set(results)
    for number in range(len(nodes) - 1, -1, -1):
        if number in found:
            found.update(nodes[number].arguments)
    return found


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


# Where the sign of a zero matters: casadi's sum of both sides of a decision turns -0.0 into 0.0.
#
# Generated code may leave -0.0 there, unless an operation such as a division can make another number of it. Results
# therefore equal casadi's, but a zero may have the other sign.

# results that are never -0.0, whatever the arguments
_NO_MINUS_ZERO = {"INDEX", "FABS", "SQ", "EXP", "COS", "COSH", "ACOS", "HYPOT", *CONDITIONS}
_NEVER_NEGATIVE = {"INDEX", "FABS", "SQ", "EXP", "COSH", "ACOS", "HYPOT", *CONDITIONS}
# the sign of a zero argument has no effect
_BLIND = {*COMPARE, *LOGIC, "NOT", "FABS", "SQ", "EXP", "COS", "COSH", "ACOS", "LOG", "ACOSH", "HYPOT"}
# the sign of a zero argument affects at most the sign of a zero result; so does the first argument of DIV
_PASSES = {"MUL", "NEG", "TWICE", "FMIN", "FMAX", "SIGN", "SQRT", "EXPM1", "LOG1P", "FLOOR", "CEIL", "FMA", "SUM"}
_PASSES |= {"SIN", "TAN", "ASIN", "ATAN", "SINH", "TANH", "ASINH", "ATANH", "ERF"}


class Zeros:
    """Analysis of the zeros among the values of nodes."""

    def __init__(
        self,
        nodes: Sequence[Node],
        kept: Mapping[int, Sequence[int]],
        unsigned: Collection[int],
        positive: Collection[int],
    ) -> None:
        """Find the zeros whose sign affects a number, now or in a later call."""
        self._nodes = nodes
        self._unsigned = unsigned
        self._positive = positive
        self._seen: set[int] = set()
        count = -1
        while len(self._seen) > count:
            count = len(self._seen)
            for number in range(len(nodes) - 1, -1, -1):
                self._seen.update(self._shown(number))
            for node in [nodes[number] for number in self._seen]:
                if node.operation == "INPUT":
                    self._seen.update(kept.get(int(node.value), ()))

    def never_minus(self, number: int) -> bool:
        """Return whether a node is never -0.0."""
        node = self._nodes[number]
        if node.operation == "CONST":
            return node.value != 0.0 or math.copysign(1.0, node.value) > 0.0
        if node.operation == "INPUT":
            return int(node.value) in self._unsigned
        if node.operation in ("IF_ELSE_ZERO", "SUB"):
            return self.never_minus(node.arguments[1 if node.operation == "IF_ELSE_ZERO" else 0])
        if node.operation == "SELECT":
            return number in self._seen or all(map(self.never_minus, node.arguments[1:]))
        if node.operation in ("ADD", "SUM"):
            return any(map(self.never_minus, node.arguments))
        if node.operation in ("MUL", "DIV"):
            return all(map(self._never_negative, node.arguments))
        return node.operation in _NO_MINUS_ZERO

    def _never_negative(self, number: int) -> bool:
        """Return whether a node is neither negative nor -0.0, as far as this is easy to see."""
        node = self._nodes[number]
        if node.operation == "CONST":
            return math.copysign(1.0, node.value) > 0.0
        if node.operation == "INPUT":
            return int(node.value) in self._positive
        if node.operation in ("ADD", "MUL", "DIV"):
            return all(map(self._never_negative, node.arguments))
        if node.operation in ("SELECT", "IF_ELSE_ZERO"):
            condition, first, *second = node.arguments
            return (self._never_negative(first) or self._holds_if_positive(condition, first)) and all(
                map(self._never_negative, second)
            )
        return node.operation in _NEVER_NEGATIVE

    def _holds_if_positive(self, condition: int, value: int) -> bool:
        """Return whether a condition is ``0 < value``."""
        node = self._nodes[condition]
        zero, compared = node.arguments if node.operation == "LT" else (condition, condition)
        return compared == value and self._nodes[zero].operation == "CONST" and self._nodes[zero].value == 0.0

    def matters(self, number: int) -> bool:
        """Return whether the sign of a zero affects a number."""
        return number in self._seen

    def becomes_plus(self, select: int, side: int) -> bool:
        """Return whether -0.0 on a side of a select must become 0.0."""
        node = self._nodes[select]
        return node.operation == "SELECT" and select in self._seen and not self.never_minus(node.arguments[side])

    def _shown(self, number: int) -> list[int]:
        """Return the arguments for which the sign of a zero affects a number through this node."""
        node, seen = self._nodes[number], number in self._seen
        if node.operation in _BLIND:
            return []
        if node.operation == "IF_ELSE_ZERO":
            return [node.arguments[1]] if seen else []
        if node.operation == "SELECT":
            return [node.arguments[side] for side in (1, 2) if seen and not self.becomes_plus(number, side)]
        if node.operation in ("ADD", "SUB"):
            return self._terms(node) if seen else []
        if node.operation in _PASSES or self._is_positive_power(node):
            return list(node.arguments) if seen else []
        if node.operation == "DIV" and not seen:
            return [node.arguments[1]]
        if node.operation == "ATAN2" and self._never_zero(node.arguments[0]):
            return []  # +-pi/2 at a zero of either sign
        return list(node.arguments)

    def _is_positive_power(self, node: Node) -> bool:
        """Return whether a node is a power with a positive exponent, which makes a zero of a zero."""
        if node.operation not in ("POW", "CONSTPOW"):
            return False
        exponent = self._nodes[node.arguments[1]]
        return exponent.operation == "CONST" and exponent.value > 0.0

    def _terms(self, node: Node) -> list[int]:
        """Return the terms whose sign affects the sign of a sum of zeros: it is -0.0 only if both terms are."""
        first, second = node.arguments
        if node.operation == "ADD":
            shown = [(first, not self.never_minus(second)), (second, not self.never_minus(first))]
        else:
            shown = [(first, not self._never_zero(second)), (second, not self.never_minus(first))]
        return [term for term, shows in shown if shows and not self._never_zero(term)]

    def _never_zero(self, number: int) -> bool:
        node = self._nodes[number]
        return node.operation == "CONST" and node.value != 0.0
