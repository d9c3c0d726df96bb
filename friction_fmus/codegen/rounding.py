"""Rounding of each operation of a law, at random: how far results may be off, and which decisions it makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from friction_fmus.codegen.layout import STATES, Export
from friction_fmus.lawkit.emit.c_text import DOUBLE
from friction_fmus.lawkit.emit.operations import CALLS, COMPARE, LOGIC, Node, graph
from friction_fmus.lawkit.law import Kind

RUNS = 17  # number of runs; the first one is exact

Other = Callable[["Node", np.ndarray, int], Any]
_MARGIN = 4.0  # of a decision over the largest deviation of its sides
_SAME = 1e-3  # relative difference of results between both sides of a decision that does not matter
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{"ADD": np.add, "SUB": np.subtract, "MUL": np.multiply, "DIV": np.divide, "NEG": np.negative, "SQ": np.square},
    **{"TWICE": lambda a: 2.0 * a, "INV": lambda a: 1.0 / a, "SIGN": np.sign, "FMIN": np.fmin, "FMAX": np.fmax},
    **{"LT": np.less, "LE": np.less_equal, "EQ": np.equal, "NE": np.not_equal, "AND": np.logical_and},
    **{"OR": np.logical_or, "NOT": np.logical_not, "SELECT": lambda c, a, b: np.where(c != 0.0, a, b)},
    **{"IF_ELSE_ZERO": lambda c, a: np.where(c != 0.0, a, 0.0), "POW": np.power, "CONSTPOW": np.power},
    **{"ASIN": np.arcsin, "ACOS": np.arccos, "ATAN": np.arctan, "ASINH": np.arcsinh, "ACOSH": np.arccosh},
    **{"ATANH": np.arctanh, "ATAN2": np.arctan2, "FABS": np.fabs, "REMAINDER": lambda a, b: a - b * np.rint(a / b)},
}
_EXACT = {*COMPARE, *LOGIC, "NOT", "SELECT", "IF_ELSE_ZERO", "NEG", "TWICE", "SIGN", "FMIN", "FMAX", "FABS", "FLOOR"}
_EXACT |= {"CEIL", "INPUT", "COPYSIGN"}
_JUMPS = {*COMPARE, "SIGN", "FLOOR", "CEIL"}


class Rounding:
    """Samples of a law whose operations are rounded at random."""

    def __init__(self, export: Export) -> None:
        """Read the operations."""
        self.nodes, self._results = graph(export.law.function)
        self._outputs = len(export.law.select(Kind.OUTPUT))
        labels = [variable for variable in export.law.given for _ in variable.starts]
        self._states = [i for i, variable in enumerate(labels) if variable.kind in STATES]
        self._random = np.random.default_rng(0)
        self._functions = [
            _FUNCTIONS.get(node.operation) or getattr(np, node.operation.lower(), None) for node in self.nodes
        ]
        unit = 2.0**-53 if export.real is DOUBLE else 2.0**-24
        self._units = [
            (2.0**-46 if wide else 2.0 * unit if node.operation in CALLS else unit) * _is_rounded(node, export)
            for node, wide in zip(self.nodes, export.wide_nodes, strict=True)
        ]

    def sample(self, given: np.ndarray) -> tuple[np.ndarray, bool]:
        """Return the results of a sample, and whether rounding makes a decision that matters."""
        values = self._values(given, {}, self._units, _other)
        found = values[self._results]
        near = [i for i, node in enumerate(self.nodes) if node.operation in _JUMPS and self._is_near(node, values)]
        if not near:
            return found, False
        each = dict(zip(near, np.eye(len(near), dtype=bool), strict=True))
        others = self.exact(np.repeat(given[:, :1], len(near), axis=1), each, _other)
        size = np.abs(others) + np.abs(found[:, :1])
        alike = (values[near] == values[near][:, :1]).all(axis=0)  # runs with the decisions of the exact one
        spread = np.max(np.abs(found - found[:, :1])[:, alike], axis=1, keepdims=True)
        matters = ~(np.abs(others - found[:, :1]) <= _SAME * size + _MARGIN * spread).all(axis=0)
        decided = {number: np.arange(RUNS) % 2 == 1 for number, counts in zip(near, matters, strict=True) if counts}
        return (self._values(given, decided, self._units, _other)[self._results], True) if decided else (found, False)

    def exact(self, given: np.ndarray, flipped: Mapping[int, np.ndarray], other: Other) -> np.ndarray:
        """Return the results without rounding, with another result of the operations that are flipped."""
        return self._values(given, flipped, [0.0] * len(self.nodes), other)[self._results]

    def after(self, given: np.ndarray, results: np.ndarray) -> np.ndarray:
        """Return the arguments of the next sample, with the same inputs."""
        following = given.copy()
        following[self._states] = results[self._outputs :]
        return following

    def _values(
        self, given: np.ndarray, flipped: Mapping[int, np.ndarray], units: Sequence[float], other: Other
    ) -> np.ndarray:
        """Return the values of all operations, with the other result where it is flipped."""
        values = np.empty((len(self.nodes), given.shape[1]))
        rows = list(values)
        with np.errstate(all="ignore"):
            for i, (row, node, function) in enumerate(zip(rows, self.nodes, self._functions, strict=True)):
                if isinstance(function, np.ufunc):
                    function(*[rows[argument] for argument in node.arguments], out=row)
                elif function:
                    row[:] = function(*[rows[argument] for argument in node.arguments])
                else:
                    row[:] = given[int(node.value)] if node.operation == "INPUT" else node.value
                if i in flipped:
                    np.copyto(row, other(node, values, i), where=flipped[i])
                if units[i]:
                    noise = units[i] * self._random.uniform(-1.0, 1.0, given.shape[1] - 1)
                    # integers such as counts have no rounding errors
                    row[1:] *= 1.0 + np.where(row[1:] == np.round(row[1:]), 0.0, noise)
        return values

    def _is_near(self, node: Node, values: np.ndarray) -> bool:
        """Return whether the sides of a decision are as close as rounding."""
        first = values[node.arguments[0]]
        if node.operation in COMPARE:
            gap = first - values[node.arguments[1]]
        else:
            gap = first if node.operation == "SIGN" else first - np.round(first)
        spread = np.max(np.abs(gap - gap[0]))
        return bool(spread > 0.0 and abs(gap[0]) <= _MARGIN * spread)


def _is_rounded(node: Node, export: Export) -> bool:
    if node.operation == "CONST":
        return export.real is not DOUBLE and float(np.float32(node.value)) != node.value
    return node.operation not in _EXACT


def _other(node: Node, values: np.ndarray, number: int) -> np.ndarray:
    """Return the other side of a decision."""
    value: np.ndarray = values[number]
    first: np.ndarray = values[node.arguments[0]]
    if node.operation in COMPARE:
        return 1.0 - value
    return -value if node.operation == "SIGN" else value + np.where(first > np.round(first), -1.0, 1.0)
