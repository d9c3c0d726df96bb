"""Where the sign of a zero matters: casadi's sum of both sides of a decision turns -0.0 into 0.0."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence

from friction_fmus.lawkit.emit.graph import COMPARE, CONDITIONS, LOGIC, Node

# results that are never -0.0, whatever the arguments
_NO_MINUS_ZERO = {"FABS", "SQ", "EXP", "COSH", "HYPOT", "SELECT", *CONDITIONS}
# the sign of a zero argument has no effect
_BLIND = {*COMPARE, *LOGIC, "NOT", "FABS", "SQ", "EXP"}
# the sign of a zero argument affects at most the sign of a zero result; so does the first argument of DIV
_PASSES = {"ADD", "SUB", "MUL", "NEG", "TWICE", "FMIN", "FMAX", "SQRT", "EXPM1"}


class Zeros:
    """Analysis of the zeros among the values of nodes.

    Parameters
    ----------
    nodes : sequence of Node
        All operations, arguments before their users.
    results : iterable of int
        Indices of the results.
    conditions : collection of int
        Indices of the arguments of the function that are truth values.
    """

    def __init__(self, nodes: Sequence[Node], results: Iterable[int], conditions: Collection[int]) -> None:
        """Find the zeros whose sign affects a result."""
        self._nodes = nodes
        self._conditions = conditions
        self._seen = set(results)
        for number in range(len(nodes) - 1, -1, -1):
            self._seen.update(self._shown(number))

    def never_minus(self, number: int) -> bool:
        """Return whether a node is never -0.0."""
        node = self._nodes[number]
        if node.operation == "CONST":
            return node.value != 0.0 or math.copysign(1.0, node.value) > 0.0
        if node.operation == "INPUT":
            return int(node.value) in self._conditions
        if node.operation in ("IF_ELSE_ZERO", "SUB"):
            return self.never_minus(node.arguments[1 if node.operation == "IF_ELSE_ZERO" else 0])
        if node.operation == "ADD":
            return any(map(self.never_minus, node.arguments))
        return node.operation in _NO_MINUS_ZERO

    def becomes_plus(self, select: int, side: int) -> bool:
        """Return whether -0.0 on a side of a select must become 0.0."""
        node = self._nodes[select]
        return node.operation == "SELECT" and select in self._seen and not self.never_minus(node.arguments[side])

    def _shown(self, number: int) -> list[int]:
        """Return the arguments for which the sign of a zero affects a result through this node."""
        node, seen = self._nodes[number], number in self._seen
        if node.operation in _BLIND:
            return []
        if node.operation == "IF_ELSE_ZERO":
            return [node.arguments[1]] if seen else []
        if node.operation == "SELECT":
            return [node.arguments[side] for side in (1, 2) if seen and not self.becomes_plus(number, side)]
        if node.operation in _PASSES:
            return list(node.arguments) if seen else []
        if node.operation == "DIV" and not seen:
            return [node.arguments[1]]
        return list(node.arguments)
