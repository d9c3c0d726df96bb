"""Plain C from casadi expressions: one constant per operation, in casadi's own order, so that the bits agree.

`kernel` is the translation, for any surroundings.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi
from casadi import Function

from friction_fmus.errors import FrictionError


@dataclass(frozen=True)
class Real:
    """A floating-point type of C.

    Attributes
    ----------
    name : str
        Its keyword.
    suffix : str
        Of literals and of the functions of <math.h>.
    infinity : str
        Its infinity.
    largest : float
        Its largest finite number.
    smallest : float
        What constants nearer to zero become: a guard against division by zero must not become zero.
    """

    name: str
    suffix: str
    infinity: str
    largest: float
    smallest: float

    def literal(self, value: float) -> str:
        """The shortest literal that reads back as this number."""
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return f"(-{self.infinity})" if value < 0.0 else self.infinity
        if abs(value) > self.largest:
            raise FrictionError(f"The constant {value!r} is too large for the C type {self.name}")
        if 0.0 < abs(value) < self.smallest:
            value = math.copysign(self.smallest, value)
        text = repr(float(value)) + self.suffix
        return f"({text})" if math.copysign(1.0, value) < 0.0 else text


DOUBLE = Real("double", "", "HUGE_VAL", math.inf, 0.0)
FLOAT = Real("float", "f", "HUGE_VALF", 3.4028234e38, 1.1754944e-38)


@dataclass(frozen=True)
class Kernel:
    """The C statements of a function.

    Attributes
    ----------
    lines : tuple of str
        Declarations of constants, then assignments of all results.
    functions : frozenset of str
        What it calls of <math.h>.
    """

    lines: tuple[str, ...]
    functions: frozenset[str]


# ---- operations -----------------------------------------------------------------------------------------------------

_INFIX = {"ADD": "+", "SUB": "-", "MUL": "*", "DIV": "/"}
_COMPARE = {"LT": "<", "LE": "<=", "EQ": "==", "NE": "!="}
_LOGIC = {"AND": "&&", "OR": "||"}
_CONDITIONS = {*_COMPARE, *_LOGIC, "NOT"}
_LIBM = {
    **{name.upper(): name for name in ("exp", "log", "pow", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan")},
    **{name.upper(): name for name in ("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "atan2", "log1p", "expm1")},
    **{name.upper(): name for name in ("floor", "ceil", "fmod", "fabs", "copysign", "erf", "hypot", "remainder")},
    "CONSTPOW": "pow",
}
# {0}, {1}: arguments
_FORMULA = {
    "NEG": "-{0}",
    "SQ": "{0} * {0}",
    "TWICE": "{two} * {0}",
    "INV": "{one} / {0}",
    "SIGN": "{0} < {zero} ? {minus_one} : {0} > {zero} ? {one} : {0}",
    # the first of equal arguments, as fmin does; NaN in the first argument stays, where fmin gives the other
    "FMIN": "{1} < {0} ? {1} : {0}",
    "FMAX": "{1} > {0} ? {1} : {0}",
}
_NAMES = {getattr(casadi, name): name.removeprefix("OP_") for name in dir(casadi) if name.startswith("OP_")}
_OPERATIONS = {*_INFIX, *_CONDITIONS, *_LIBM, *_FORMULA, "IF_ELSE_ZERO"}
# results that are never -0.0, whatever the arguments
_NO_MINUS_ZERO = {"FABS", "SQ", "EXP", "COSH", "HYPOT", "SELECT", *_CONDITIONS}


@dataclass(frozen=True)
class _Node:
    """An operation: its name, the numbers of its arguments, and the value of a constant or number of an input."""

    operation: str
    arguments: tuple[int, ...] = ()
    value: float = 0.0


def _graph(function: Function) -> tuple[list[_Node], list[int]]:
    """The operations of a scalar SX function in casadi's order, and which of them the results are."""
    if not function.is_a("SXFunction"):
        raise FrictionError(f"The function {function.name()} is not made of SX expressions; C is written from SX only")
    for label, count, sparsity in (
        ("argument", function.n_in(), function.sparsity_in),
        ("result", function.n_out(), function.sparsity_out),
    ):
        for i in range(count):
            if not (sparsity(i).is_scalar() and sparsity(i).is_dense()):
                raise FrictionError(f"The {label} {i} of {function.name()} is not one number; split the vectors")

    nodes: list[_Node] = []
    numbers: dict[tuple[str, tuple[int, ...], bytes], int] = {}  # what was computed once is not computed again
    held: dict[int, int] = {}  # place in casadi's work vector -> node
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
            node = _Node("INPUT", (), reads[0])
        elif operation == "CONST":
            node = _Node("CONST", (), function.instruction_constant(k))
        elif operation in _OPERATIONS:
            node = _joined(nodes, _Node(operation, tuple(held[place] for place in reads)))
        else:
            raise FrictionError(
                f"{function.name()} uses the casadi operation {operation}, which cannot be written as C; "
                "express it by arithmetic, if_else and the functions of <math.h>"
            )
        held[writes[0]] = numbers.setdefault((node.operation, node.arguments, struct.pack("d", node.value)), len(nodes))
        if held[writes[0]] == len(nodes):
            nodes.append(node)
    return nodes, results


def _joined(nodes: list[_Node], node: _Node) -> _Node:
    """casadi writes if_else(c, a, b) as (c ? a : 0) + (!c ? b : 0); here it becomes one decision again."""
    if node.operation == "ADD":
        first, second = (nodes[argument] for argument in node.arguments)
        if first.operation == second.operation == "IF_ELSE_ZERO":
            opposite = nodes[second.arguments[0]]
            if opposite.operation == "NOT" and opposite.arguments[0] == first.arguments[0]:
                return _Node("SELECT", (*first.arguments, second.arguments[1]))
    return node


def _needed(nodes: list[_Node], results: Iterable[int]) -> list[int]:
    """The nodes that the results are made of, in order."""
    needed = set(results)
    for number in range(len(nodes) - 1, -1, -1):
        if number in needed:
            needed.update(nodes[number].arguments)
    return sorted(needed)


def kernel(
    function: Function,
    reads: Sequence[str],
    writes: Sequence[str],
    *,
    real: Real = DOUBLE,
    conditions: Iterable[int] = (),
    taken: Iterable[str] = (),
) -> Kernel:
    """Translate a casadi function into C statements.

    All results are assigned after the last operation, so a result may be stored where an argument is.

    Parameters
    ----------
    function : casadi.Function
        Of scalar SX arguments and results.
    reads : sequence of str
        C expression of every argument, such as ``Kp``, ``k[2]``, ``parameters->Kp``; read as often as it is used.
    writes : sequence of str
        Where every result is assigned, such as ``model->u``.
    real : Real
        Type of all numbers.
    conditions : iterable of int
        Numbers of the arguments that are C truth values and not numbers.
    taken : iterable of str
        Identifiers that the constants must not have.

    Returns
    -------
    Kernel
        C99 (and C89) declarations and assignments; equal to casadi's evaluation bit for bit in double if compiled
        without contraction (``-ffp-contract=off``) and with the same C library.

    Raises
    ------
    FrictionError
        For an operation without a C form, or a function that is not scalar.
    """
    nodes, results = _graph(function)
    writer = _Writer(nodes, reads, real, frozenset(conditions), frozenset(taken))
    for number in _needed(nodes, results):
        writer.declare(number)
    for number in results:
        writer.copy(number)
    for number, target in zip(results, writes, strict=True):
        writer.lines.append(f"{target} = {writer.number(number)};")
    return Kernel(tuple(writer.lines), frozenset(writer.functions))


class _Writer:
    """Names every node and writes its declaration."""

    def __init__(
        self, nodes: list[_Node], reads: Sequence[str], real: Real, conditions: frozenset[int], taken: frozenset[str]
    ) -> None:
        self.lines: list[str] = []
        self.functions: set[str] = set()
        self._nodes = nodes
        self._reads = reads
        self._real = real
        self._conditions = conditions
        self._taken = taken
        self._texts: dict[int, str] = {}
        self._copied: dict[int, str] = {}
        self._last = 0

    def declare(self, number: int) -> None:
        """Give the node a text: a literal, the expression of an argument, or the name of a new constant."""
        node = self._nodes[number]
        if node.operation == "CONST":
            self._texts[number] = self._real.literal(node.value)
        elif node.operation == "INPUT":
            self._texts[number] = self._reads[int(node.value)]
        else:
            kind = "int" if node.operation in _CONDITIONS else self._real.name
            expression = self._expression(node)
            self._texts[number] = self._new_name()
            self.lines.append(f"const {kind} {self._texts[number]} = {expression};")

    def copy(self, number: int) -> None:
        """Keep an argument that is itself a result: its place may be overwritten by another result."""
        if self._nodes[number].operation == "INPUT" and number not in self._copied:
            value = self.number(number)
            self._copied[number] = self._new_name()
            self.lines.append(f"const {self._real.name} {self._copied[number]} = {value};")

    def number(self, node: int) -> str:
        """The node as a number."""
        if node in self._copied:
            return self._copied[node]
        text = self._texts[node]
        return f"({self._real.name}){text}" if self._is_condition(node) else text

    def _truth(self, node: int) -> str:
        """The node as a truth value."""
        return self._texts[node] if self._is_condition(node) else f"{self._texts[node]} != {self._real.literal(0.0)}"

    def _is_condition(self, number: int) -> bool:
        node = self._nodes[number]
        return node.operation in _CONDITIONS or (node.operation == "INPUT" and int(node.value) in self._conditions)

    def _new_name(self) -> str:
        while True:
            self._last += 1
            if f"t{self._last}" not in self._taken:
                return f"t{self._last}"

    def _expression(self, node: _Node) -> str:
        operation, arguments = node.operation, node.arguments
        zero = self._real.literal(0.0)
        if operation in _LOGIC:
            return f" {_LOGIC[operation]} ".join(self._in_brackets(argument) for argument in arguments)
        if operation == "NOT":
            plain = self._texts[arguments[0]]
            return f"!{plain}" if self._is_condition(arguments[0]) else f"{plain} == {zero}"
        if operation == "IF_ELSE_ZERO":
            return f"{self._truth(arguments[0])} ? {self.number(arguments[1])} : {zero}"
        if operation == "SELECT":
            choice = f"{self._truth(arguments[0])} ? {self.number(arguments[1])} : {self.number(arguments[2])}"
            # casadi's sum turns -0.0 into 0.0
            return choice if all(map(self._never_minus_zero, arguments[1:])) else f"({choice}) + {zero}"
        numbers = [self.number(argument) for argument in arguments]
        if operation in _INFIX:
            return f"{numbers[0]} {_INFIX[operation]} {numbers[1]}"
        if operation in _COMPARE:
            return f"{numbers[0]} {_COMPARE[operation]} {numbers[1]}"
        if operation in _LIBM:
            called = _LIBM[operation] + self._real.suffix
            self.functions.add(called)
            return f"{called}({', '.join(numbers)})"
        one, two, minus_one = map(self._real.literal, (1.0, 2.0, -1.0))
        return _FORMULA[operation].format(*numbers, zero=zero, one=one, two=two, minus_one=minus_one)

    def _in_brackets(self, node: int) -> str:
        return self._texts[node] if self._is_condition(node) else f"({self._truth(node)})"

    def _never_minus_zero(self, number: int) -> bool:
        node = self._nodes[number]
        if node.operation == "CONST":
            return node.value != 0.0 or math.copysign(1.0, node.value) > 0.0
        if node.operation == "IF_ELSE_ZERO":
            return self._never_minus_zero(node.arguments[1])
        return node.operation in _NO_MINUS_ZERO or self._is_condition(number)
