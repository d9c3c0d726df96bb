"""Absolute positions in single precision as pairs of floats, so that small motions far from zero keep their accuracy.

A float has a resolution of 60 nm at 1 m, which limits the difference of two positions. Values that contain an absolute
position are therefore computed as the sum of two floats, ``high`` and ``low``, by exact sums and products (Dekker,
Numerische Mathematik 18, 1971; Knuth, The Art of Computer Programming 2, 4.2.2). The difference of two positions is a
single float again. `positions` finds the values that must be pairs; `split` replaces pairs by operations on floats.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from friction_fmus.lawkit.emit.graph import COMPARE, Node

SUMS = {"ADD": 1.0, "SUB": -1.0}
SUMMED = "SUMMED"
"""Factor of a sum of small increments, which is not a position."""

Pair = tuple[int, int | None]
"""Nodes of the upper and of the lower part; None for a lower part of 0."""


class Weight(NamedTuple):
    """Factor with which a value contains the distance of the axis from zero.

    A reference has the factor 1; the difference of two references has none and is a small number. The factors are
    operations on values that are only known at run time.
    """

    number: float
    factors: tuple[tuple[str, int], ...] = ()


def positions(
    nodes: Sequence[Node],
    results: Sequence[int],
    inputs: Iterable[int],
    parameters: Iterable[int],
    states: Mapping[int, int],
    outputs: Iterable[int],
    sums: Mapping[int, int],
) -> tuple[dict[int, Weight], set[int]]:
    """Find the arguments and results that must be pairs."""
    allowed, wide = set(parameters), dict.fromkeys(inputs, Weight(1.0))
    # first the states that store a position: until they are known, any difference from them appears to be absolute
    for kept in ((Weight(1.0),), None):
        while True:
            weights = _weights(nodes, wide)
            found = {states[i]: Weight(1.0) for i in states if _among(weights[results[i]], kept)}
            if not kept:
                found |= {i: _of_parameter(i) for i in _operands(nodes, weights, allowed)}
            if found.keys() <= wide.keys():
                break
            wide |= found
    wide |= {argument: Weight(1.0, ((SUMMED, argument),)) for argument in sums.values()}
    weights = _weights(nodes, wide)
    written = {i for i in states if states[i] in wide} | {i for i in outputs if weights[results[i]]} | {*sums}
    needed = _needed(nodes, weights, {results[i] for i in written})
    read = {_argument(node) for node, weight in zip(nodes, needed, strict=True) if weight}
    return {argument: weight for argument, weight in wide.items() if argument in read}, written


def _needed(nodes: Sequence[Node], weights: Sequence[Weight | None], written: set[int]) -> list[Weight | None]:
    """Return the weights of the nodes that need full accuracy: for a difference of positions, or as a position."""
    needed = set(written)
    for number in range(len(nodes) - 1, -1, -1):
        operation = nodes[number].operation
        wide = [argument for argument in nodes[number].arguments if weights[argument]]
        differs = operation == "FLOOR" or (operation in (*SUMS, *COMPARE) and len(wide) == 2)
        if differs or (weights[number] and number in needed):
            needed.update(wide)
    return [weight if number in needed else None for number, weight in enumerate(weights)]


def in_pairs(nodes: Sequence[Node], wide: Mapping[int, Weight], written: set[int]) -> list[bool]:
    """Return which nodes are pairs; arguments as for `split`, with the nodes of the results that are pairs."""
    return [weight is not None for weight in _needed(nodes, _weights(nodes, wide), written)]


def _of_parameter(argument: int) -> Weight:
    """Return the weight of a parameter, which does not cancel against a position."""
    return Weight(1.0, (("PARAMETER", argument),))


def _among(weight: Weight | None, kept: tuple[Weight, ...] | None) -> bool:
    return weight is not None if kept is None else weight in kept


def _operands(nodes: Sequence[Node], weights: Sequence[Weight | None], allowed: set[int]) -> set[int]:
    """Return the allowed arguments with which a pair is added, multiplied or divided."""
    found = set()
    for node in nodes:
        if node.operation in (*SUMS, "MUL", "DIV"):
            one, two = node.arguments
            found |= {_argument(nodes[a]) for a, b in ((one, two), (two, one)) if weights[b] and not weights[a]}
    return found & allowed


def _argument(node: Node) -> int:
    return int(node.value) if node.operation == "INPUT" else -1


def _weights(nodes: Sequence[Node], wide: Mapping[int, Weight]) -> list[Weight | None]:
    """Return the weight of every node, or None for a value that is a single float."""
    found: list[Weight | None] = []
    for number, node in enumerate(nodes):
        if node.operation == "INPUT":
            found.append(wide.get(int(node.value)))
        else:
            found.append(_weight(number, node, nodes, [found[argument] for argument in node.arguments]))
    return found


def _weight(number: int, node: Node, nodes: Sequence[Node], given: list[Weight | None]) -> Weight | None:
    operation = node.operation
    if operation in SUMS:
        return _sum(number, SUMS[operation], *given)
    if operation in ("MUL", "DIV", "NEG", "TWICE", "FLOOR") and any(map(_is_summed, given)):
        return None  # a sum is needed to full accuracy as a sum only
    if operation in ("MUL", "DIV") and (given[0] or (given[1] and operation == "MUL")):
        return _product(number, node, nodes, given)
    if operation in ("NEG", "TWICE") and given[0]:
        return given[0]._replace(number=given[0].number * (2.0 if operation == "TWICE" else -1.0))
    if operation == "FLOOR":
        return given[0]
    return next(filter(None, given[1:]), None) if operation in ("SELECT", "IF_ELSE_ZERO") else None


def _is_summed(weight: Weight | None) -> bool:
    return weight is not None and any(name == SUMMED for name, _ in weight.factors)


def _sum(number: int, sign: float, one: Weight | None, two: Weight | None) -> Weight | None:
    if one is None or two is None:
        return one or (two and two._replace(number=sign * two.number))
    if one.factors != two.factors:
        return Weight(1.0, (("SUM", number),))
    total = one.number + sign * two.number
    return one._replace(number=total) if total else None


def _product(number: int, node: Node, nodes: Sequence[Node], given: list[Weight | None]) -> Weight | None:
    place = 0 if given[0] else 1
    weight, other = given[place] or Weight(1.0), node.arguments[1 - place]
    if nodes[other].operation == "CONST":
        constant = nodes[other].value
        total = weight.number * constant if node.operation == "MUL" else weight.number / constant
        return weight._replace(number=total) if total else None
    if node.operation == "MUL" and given[1 - place]:
        return Weight(1.0, (("PRODUCT", number),))
    return weight._replace(factors=tuple(sorted((*weight.factors, (node.operation, other)))))


def rounded(nodes: Sequence[Node], wide: Mapping[int, Weight]) -> set[str]:
    """Return the operations that receive a pair rounded to one float; arguments as for `split`."""
    weights = _weights(nodes, wide)
    return {
        node.operation
        for number, node in enumerate(nodes)
        if node.operation not in (*SUMS, *COMPARE)
        and not weights[number]
        and any(weights[argument] for argument in node.arguments)
    }


def split(
    nodes: Sequence[Node],
    results: Sequence[int],
    wide: Mapping[int, Weight],
    reads: Mapping[int, int],
    writes: Iterable[int],
) -> tuple[list[Node], list[int], list[Pair]]:
    """Replace pairs by operations on floats."""
    written = list(writes)
    weights = _needed(nodes, _weights(nodes, wide), {results[i] for i in written})
    writer = _Splitter(nodes, weights, reads)
    for number in range(len(nodes)):
        writer.write(number)
    highs = [writer.pairs[number][0] for number in results]
    results = highs + [writer.low(results[i]) for i in written]
    return writer.nodes, results, writer.pairs


class _Splitter:
    """Splitter that processes one node after the other."""

    def __init__(self, given: Sequence[Node], weights: Sequence[Weight | None], reads: Mapping[int, int]) -> None:
        self.nodes: list[Node] = []
        self.pairs: list[Pair] = []
        self._given = given
        self._weights = weights
        self._reads = reads
        self._numbers: dict[tuple[str, tuple[int, ...], bytes], int] = {}

    def write(self, number: int) -> None:
        """Process the next node."""
        node = self._given[number]
        parts = [self.pairs[argument] for argument in node.arguments]
        wide = [self._weights[argument] is not None for argument in node.arguments]
        if node.operation == "INPUT" and int(node.value) in self._reads:
            low = self._node("INPUT", value=float(self._reads[int(node.value)]))
            self.pairs.append((self._node("INPUT", value=node.value), low))
        elif not any(wide):
            self.pairs.append((self._node(node.operation, *(high for high, _ in parts), value=node.value), None))
        elif self._weights[number]:
            self.pairs.append(self._pair(node, parts))
        else:
            self.pairs.append((self._float(node, parts), None))

    def low(self, number: int) -> int:
        """Return the lower part of a given node."""
        low = self.pairs[number][1]
        return self._node("CONST", value=0.0) if low is None else low

    def _float(self, node: Node, parts: Sequence[Pair]) -> int:
        """Return a float from pairs: sums and decisions use both parts, all other operations the upper part."""
        if node.operation in SUMS:
            return self._difference(node.operation, *parts)
        if node.operation in COMPARE:
            return self._node(node.operation, self._difference("SUB", *parts), self._node("CONST", value=0.0))
        return self._node(node.operation, *(high for high, _ in parts))

    def _difference(self, operation: str, one: Pair, two: Pair) -> int:
        """Return the difference of two pairs; for close values, the difference of the upper parts is exact."""
        return self._plus(self._node(operation, one[0], two[0]), self._lower(operation, one[1], two[1]))

    def _pair(self, node: Node, parts: Sequence[Pair]) -> Pair:
        """Return a pair from pairs."""
        operation, one = node.operation, parts[0]
        if operation == "ADD" and parts[1][1] is None and _is_summed(self._weights[node.arguments[0]]):
            return self._accumulated(one, parts[1][0])
        if operation in SUMS:
            return self._sum(operation, self._exact(node.arguments[0]), self._exact(node.arguments[1]))
        if operation in ("NEG", "TWICE"):
            return self._node(operation, one[0]), None if one[1] is None else self._node(operation, one[1])
        if operation == "MUL":
            return self._product(*parts)
        if operation == "DIV":
            return self._quotient(*parts)
        if operation == "FLOOR":
            return self._floor(one)
        return self._select(operation, parts)

    def _exact(self, number: int) -> Pair:
        """Return a node as a pair; for a constant, the lower part holds the digits that a float cannot."""
        node = self._given[number]
        if node.operation != "CONST":
            return self.pairs[number]
        high = struct.unpack("f", struct.pack("f", node.value))[0]
        rest = node.value - high
        return self._node("CONST", value=high), self._node("CONST", value=rest) if rest else None

    def _select(self, operation: str, parts: Sequence[Pair]) -> Pair:
        condition = parts[0][0]
        lows = [self._node("CONST", value=0.0) if low is None else low for _, low in parts[1:]]
        return (
            self._node(operation, condition, *(high for high, _ in parts[1:])),
            self._node(operation, condition, *lows),
        )

    def _sum(self, operation: str, one: Pair, two: Pair) -> Pair:
        """Return Knuth's exact sum of the upper parts plus the lower parts."""
        a, b = one[0], two[0]
        total = self._node(operation, a, b)
        part = self._node("SUB", total, a)  # share of b, or of -b, in the total
        left = self._node("SUB", a, self._node("SUB", total, part))
        opposite = "SUB" if operation == "ADD" else "ADD"
        rest = self._node(operation, left, self._node(opposite, b, part))
        return self._joined(total, self._plus(rest, self._lower(operation, one[1], two[1])))

    def _accumulated(self, one: Pair, increment: int) -> Pair:
        """Return Kahan's sum, for an increment below the sum."""
        added = self._plus(increment, one[1])
        total = self._node("ADD", one[0], added)
        return total, self._node("SUB", added, self._node("SUB", total, one[0]))

    def _product(self, one: Pair, two: Pair) -> Pair:
        """Return the pair of a product; the product of the two lower parts is negligible."""
        total = self._node("MUL", one[0], two[0])
        rest = self._node("FMA", one[0], two[0], self._node("NEG", total))
        for high, low in ((two[0], one[1]), (one[0], two[1])):
            if low is not None:
                rest = self._node("ADD", rest, self._node("MUL", high, low))
        return self._joined(total, rest)

    def _quotient(self, one: Pair, two: Pair) -> Pair:
        total = self._node("DIV", one[0], two[0])
        minus = self._node("NEG", total)
        rest = self._plus(self._node("FMA", minus, two[0], one[0]), one[1])
        if two[1] is not None:
            rest = self._node("ADD", rest, self._node("MUL", minus, two[1]))
        return self._joined(total, self._node("DIV", rest, two[0]))

    def _floor(self, one: Pair) -> Pair:
        """Return the floor of a pair; the lower part matters if the upper part is an integer."""
        whole = self._node("FLOOR", one[0])
        if one[1] is None:
            return whole, None
        below = self._node("IF_ELSE_ZERO", self._node("EQ", whole, one[0]), self._node("FLOOR", one[1]))
        return self._joined(whole, below)

    def _joined(self, high: int, low: int) -> Pair:
        """Return the same sum with a lower part below the rounding error of the upper part."""
        total = self._node("ADD", high, low)
        return total, self._node("SUB", low, self._node("SUB", total, high))

    def _plus(self, value: int, low: int | None) -> int:
        return value if low is None else self._node("ADD", value, low)

    def _lower(self, operation: str, one: int | None, two: int | None) -> int | None:
        if one is None or two is None:
            return one if two is None else self._node("NEG", two) if operation == "SUB" else two
        return self._node(operation, one, two)

    def _node(self, operation: str, *arguments: int, value: float = 0.0) -> int:
        """Return the index of an operation; equal operations are written once."""
        key = (operation, arguments, struct.pack("d", value))
        number = self._numbers.setdefault(key, len(self.nodes))
        if number == len(self.nodes):
            self.nodes.append(Node(operation, arguments, value))
        return number
