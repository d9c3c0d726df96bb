"""Plain C from casadi expressions: one constant per operation, in casadi's order, for bit-identical results.

`kernel` translates a function for use in any C file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from casadi import Function

from friction_fmus.errors import FrictionError
from friction_fmus.lawkit.emit.branches import DECIDES, Block, Decision, plan
from friction_fmus.lawkit.emit.graph import (
    COMPARE,
    CONDITIONS,
    FORMULA,
    INFIX,
    LIBM,
    LOGIC,
    Node,
    graph,
)
from friction_fmus.lawkit.emit.pairs import Weight, split
from friction_fmus.lawkit.emit.signed_zeros import Zeros


@dataclass(frozen=True)
class Real:
    """A floating-point type of C.

    Attributes
    ----------
    name : str
        C keyword.
    suffix : str
        Suffix of literals and of the functions in <math.h>.
    infinity : str
        Expression for infinity.
    largest : float
        Largest finite number.
    smallest : float
        Smallest magnitude of a constant other than zero: a guard against division by zero must not become zero.
    """

    name: str
    suffix: str
    infinity: str
    largest: float
    smallest: float

    def literal(self, value: float) -> str:
        """Return the shortest literal that reads back as this number."""
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
        Declarations, then statements, which end with the assignments of all results.
    functions : frozenset of str
        Called functions of <math.h>.
    """

    lines: tuple[str, ...]
    functions: frozenset[str]


@dataclass(frozen=True)
class Lows:
    """Lower parts of pairs, see `friction_fmus.lawkit.emit.pairs`.

    Attributes
    ----------
    wide : mapping of int to Weight
        Arguments that are pairs.
    reads, writes : mapping of int to str
        C expressions of the lower parts, by index of the argument and of the result.
    """

    wide: Mapping[int, Weight]
    reads: Mapping[int, str]
    writes: Mapping[int, str]


_IN_A_LINE = 12  # names of variables


def kernel(
    function: Function,
    reads: Sequence[str],
    writes: Sequence[str],
    *,
    real: Real = DOUBLE,
    conditions: Iterable[int] = (),
    taken: Iterable[str] = (),
    lows: Lows | None = None,
) -> Kernel:
    """Translate a casadi function into C statements.

    All results are assigned after the last operation, so a result may overwrite an argument. Operations that only one
    side of a decision needs are computed on that side if this saves enough to justify a branch.

    Parameters
    ----------
    function : casadi.Function
        A function with scalar SX arguments and results.
    reads : sequence of str
        C expression of each argument, such as ``Kp``, ``k[2]``, ``parameters->Kp``; it is evaluated at each use.
    writes : sequence of str
        C expression that each result is assigned to, such as ``model->u``.
    real : Real
        Type of all numbers.
    conditions : iterable of int
        Indices of the arguments that are C truth values.
    taken : iterable of str
        Identifiers that are already in use.
    lows : Lows, optional
        Arguments and results that are pairs; the default is none.

    Returns
    -------
    Kernel
        C99 (and C89) declarations and assignments. In double, results are bit-identical to casadi's if compiled without
        contraction (``-ffp-contract=off``) and with the same C library.

    Raises
    ------
    FrictionError
        If an operation has no C form, or the function is not scalar.
    """
    nodes, results = graph(function)
    if lows:
        low_of = {number: len(reads) + i for i, number in enumerate(lows.reads)}
        nodes, results = split(nodes, results, lows.wide, low_of, lows.writes)
        reads, writes = [*reads, *lows.reads.values()], [*writes, *lows.writes.values()]
    truths = frozenset(conditions)
    writer = _Writer(nodes, reads, real, truths, frozenset(taken), Zeros(nodes, results, truths))
    block = plan(nodes, results)
    last = block[-1] if block else None
    joined = last.selects if isinstance(last, Decision) else ()  # their values are assigned there, among other results
    taken_there = [number for select in joined for number in nodes[select].arguments[1:]]
    copies = [line for number in (*results, *taken_there) for line in writer.copy(number)]
    targets: dict[int, list[str]] = {}
    for number, target in zip(results, writes, strict=True):
        targets.setdefault(number, []).append(target)
    lines = [*copies, *writer.block(block, targets)]
    return Kernel(tuple(lines), frozenset(writer.functions))


class _Writer:
    """Writer that names every node and declares it."""

    def __init__(
        self,
        nodes: list[Node],
        reads: Sequence[str],
        real: Real,
        conditions: frozenset[int],
        taken: frozenset[str],
        zeros: Zeros,
    ) -> None:
        self.functions: set[str] = set()
        self._nodes = nodes
        self._real = real
        self._conditions = conditions
        self._taken = taken
        self._zeros = zeros
        self._texts: dict[int, str] = {}
        self._copied: dict[int, str] = {}
        self._last = 0
        for number, node in enumerate(nodes):
            if node.operation == "CONST":
                self._texts[number] = real.literal(node.value)
            elif node.operation == "INPUT":
                self._texts[number] = reads[int(node.value)]

    def copy(self, number: int) -> list[str]:
        """Copy an argument that is also a result, as another result may overwrite it."""
        if self._nodes[number].operation != "INPUT" or number in self._copied:
            return []
        value = self.number(number)
        self._copied[number] = self._new_name()
        return [f"const {self._real.name} {self._copied[number]} = {value};"]

    def block(self, block: Block, targets: Mapping[int, Sequence[str]] | None = None) -> list[str]:
        """Return declarations, then statements, then assignments to the targets of nodes."""
        left = dict(targets or {})
        constants: list[str] = []
        variables: dict[str, list[str]] = {}
        statements: list[str] = []
        for item in block:
            if isinstance(item, Decision):
                # nothing is computed after the last decision, so results there need no names
                final = {number: left.pop(number) for number in item.selects if number in left and item is block[-1]}
                names = {number: self._new_name() for number in item.selects if number not in final}
                statements += self._decision(item, {**final, **{number: [name] for number, name in names.items()}})
                variables.setdefault(self._real.name, []).extend(names.values())
                self._texts.update(names)
                continue
            node = self._nodes[item]
            kind = "int" if node.operation in CONDITIONS else self._real.name
            expression = self._expression(item)
            name = self._texts[item] = self._new_name()
            if statements:  # C89 has no declarations after statements
                variables.setdefault(kind, []).append(name)
                statements.append(f"{name} = {expression};")
            else:
                constants.append(f"const {kind} {name} = {expression};")
        declared = [
            f"{kind} {', '.join(names[first : first + _IN_A_LINE])};"
            for kind, names in variables.items()
            for first in range(0, len(names), _IN_A_LINE)
        ]
        results = [f"{target} = {self.number(number)};" for number, names in left.items() for target in names]
        return [*constants, *declared, *statements, *results]

    def _decision(self, decision: Decision, targets: Mapping[int, Sequence[str]]) -> list[str]:
        """Return both sides, each with the operations that only it needs."""
        lines = [f"if ({self._truth(decision.condition)}) {{"]
        for side, block in enumerate(decision.sides, start=1):
            lines += [f"    {line}" for line in self.block(block)]
            for number, names in targets.items():
                value = self._side(number, side)
                lines += [f"    {name} = {value};" for name in names]
            lines.append("} else {" if side == 1 else "}")
        return lines

    def _side(self, number: int, side: int) -> str:
        """Return the value of a select on one side; casadi's sum of both sides turns -0.0 into 0.0."""
        node, zero = self._nodes[number], self._real.literal(0.0)
        if side == len(node.arguments):
            return zero
        value = self.number(node.arguments[side])
        return f"{value} + {zero}" if self._zeros.becomes_plus(number, side) else value

    def number(self, node: int) -> str:
        """Return the node as a number."""
        if node in self._copied:
            return self._copied[node]
        text = self._texts[node]
        return f"({self._real.name}){text}" if self._is_condition(node) else text

    def _truth(self, node: int) -> str:
        """Return the node as a truth value."""
        return self._texts[node] if self._is_condition(node) else f"{self._texts[node]} != {self._real.literal(0.0)}"

    def _is_condition(self, number: int) -> bool:
        node = self._nodes[number]
        return node.operation in CONDITIONS or (node.operation == "INPUT" and int(node.value) in self._conditions)

    def _new_name(self) -> str:
        while True:
            self._last += 1
            if f"t{self._last}" not in self._taken:
                return f"t{self._last}"

    def _expression(self, number: int) -> str:
        node = self._nodes[number]
        operation, arguments = node.operation, node.arguments
        zero = self._real.literal(0.0)
        if operation in LOGIC:
            return f" {LOGIC[operation]} ".join(self._in_brackets(argument) for argument in arguments)
        if operation == "NOT":
            plain = self._texts[arguments[0]]
            return f"!{plain}" if self._is_condition(arguments[0]) else f"{plain} == {zero}"
        if operation in DECIDES:
            return f"{self._truth(arguments[0])} ? {self._side(number, 1)} : {self._side(number, 2)}"
        numbers = [self.number(argument) for argument in arguments]
        if operation in INFIX:
            return f"{numbers[0]} {INFIX[operation]} {numbers[1]}"
        if operation in COMPARE:
            return f"{numbers[0]} {COMPARE[operation]} {numbers[1]}"
        if operation in LIBM:
            called = LIBM[operation] + self._real.suffix
            self.functions.add(called)
            return f"{called}({', '.join(numbers)})"
        one, two, minus_one = map(self._real.literal, (1.0, 2.0, -1.0))
        return FORMULA[operation].format(*numbers, zero=zero, one=one, two=two, minus_one=minus_one)

    def _in_brackets(self, node: int) -> str:
        return self._texts[node] if self._is_condition(node) else f"({self._truth(node)})"
