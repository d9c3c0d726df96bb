"""Assignment of operations to branches: an operation that only one side of a decision needs is computed there."""

from __future__ import annotations

import heapq
import struct
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import NamedTuple, TypeVar

from friction_fmus.lawkit.emit.operations import CALLS, COMPARE, Node, needed_for

# Absolute positions in single precision as pairs of floats, so that small motions far from zero keep their accuracy.
#
# A float has a resolution of 60 nm at 1 m, which limits the difference of two positions. Values that contain an
# absolute position are therefore computed as the sum of two floats, ``high`` and ``low``, by exact sums and products
# (Dekker, Numerische Mathematik 18, 1971; Knuth, The Art of Computer Programming 2, 4.2.2). The difference of two
# positions is a single float again. `positions` finds the values that must be pairs; `split` replaces pairs by
# operations on floats.

SUMS = {"ADD": 1.0, "SUB": -1.0}
SUMMED = "SUMMED"  # factor of a sum of small increments, which is not a position
Pair = tuple[int, int | None]  # nodes of the upper and of the lower part; None for a lower part of 0


class Weight(NamedTuple):
    """Factor with which a value contains the distance of the axis from zero."""

    # A reference has the factor 1; the difference of two references has none and is a small number. The factors are
    # operations on values that are only known at run time.

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
                # the weight of a parameter does not cancel against a position
                found |= {i: Weight(1.0, (("PARAMETER", i),)) for i in _operands(nodes, weights, allowed)}
            if found.keys() <= wide.keys():
                break
            wide |= found
    wide |= {argument: Weight(1.0, ((SUMMED, argument),)) for argument in sums.values()}
    weights = _weights(nodes, wide)
    written = {i for i in states if states[i] in wide} | {i for i in outputs if weights[results[i]]} | {*sums}
    needed = _needed_pairs(nodes, weights, {results[i] for i in written})
    read = {_argument(node) for node, weight in zip(nodes, needed, strict=True) if weight}
    return {argument: weight for argument, weight in wide.items() if argument in read}, written


def _needed_pairs(nodes: Sequence[Node], weights: Sequence[Weight | None], written: set[int]) -> list[Weight | None]:
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
    return [weight is not None for weight in _needed_pairs(nodes, _weights(nodes, wide), written)]


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
    weights = _needed_pairs(nodes, _weights(nodes, wide), {results[i] for i in written})
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


Key = TypeVar("Key")


def in_loops(
    ordered: Sequence[Key], waits: Mapping[Key, set[Key]], lanes: Mapping[Key, int], sums: Collection[Key]
) -> list[list[Key]]:
    """Return steps, each of one unit outside loops or of the units of one loop."""
    # A loop contains what the units after it need, and what needs its elements; other operations on elements wait for a
    # later loop, so that their results need not be stored.
    steps: list[list[Key]] = []
    left = list(ordered)
    while left:
        for key in [key for key in left if not lanes[key]]:
            if not waits[key] & {*left}:
                steps.append([key])
                left.remove(key)
        if not left:
            break
        loop = _next_loop(left, waits, lanes, sums)
        steps.append(loop)
        left = [key for key in left if key not in loop]
    return steps


def _next_loop(
    left: Sequence[Key], waits: Mapping[Key, set[Key]], lanes: Mapping[Key, int], sums: Collection[Key]
) -> list[Key]:
    """Return the units of the next loop."""
    possible: list[Key] = []
    for key in left:
        missing = waits[key] & {*left}
        same = not possible or lanes[key] == lanes[possible[0]]
        if lanes[key] and same and missing <= {*possible} - {*sums}:
            possible.append(key)
    wanted = [key for key in possible if key in sums]
    if not wanted:
        after = [key for key in left if not lanes[key]]
        wanted = [key for key in possible if any(key in waits[other] for other in after)] or possible
    found = _with_arguments(wanted, possible, waits)
    return _with_arguments(_with_users(found, possible, waits), possible, waits)


def _with_arguments(wanted: Collection[Key], possible: Sequence[Key], waits: Mapping[Key, set[Key]]) -> list[Key]:
    """Return the wanted units and those of the same loop for which they wait."""
    found = {*wanted}
    for key in reversed(possible):
        if key in found:
            found |= waits[key] & {*possible}
    return [key for key in possible if key in found]


def _with_users(wanted: Collection[Key], possible: Sequence[Key], waits: Mapping[Key, set[Key]]) -> set[Key]:
    """Return the wanted units and those of the same loop that wait for them."""
    found = {*wanted}
    for key in possible:
        if waits[key] & found:
            found.add(key)
    return found


DECIDES = ("SELECT", "IF_ELSE_ZERO")
PAYS = 6  # smallest number of operations saved by a branch; for fewer, both sides are computed
_ITSELF = -1  # stands for a node outside all groups of selects
_CALL = 10  # cost of a call of the C library in operations


@dataclass(frozen=True)
class Decision:
    """An ``if`` with the selects of its condition."""

    condition: int  # the tested node
    selects: tuple[int, ...]  # nodes that take one of two values depending on the condition
    sides: tuple[Block, Block]  # operations computed only for the first, and only for the second value


@dataclass(frozen=True)
class CountedLoop:
    """A loop over the elements of vectors."""

    lanes: int  # number of elements
    items: tuple[int | Decision, ...]  # operations on one element, and sums over the elements


Block = tuple["int | Decision | CountedLoop", ...]  # nodes, decisions and loops in the order of computation


class _Edge(NamedTuple):
    """One side of a decision, and the group of selects of its condition that takes it."""

    condition: int
    side: int
    group: int


_Path = tuple[_Edge, ...]


class _CircleError(Exception):
    """Selects of the same condition depend on each other, so that they cannot all be joined."""

    def __init__(self, conditions: Sequence[int]) -> None:
        self.conditions = conditions


def plan(nodes: Sequence[Node], results: Iterable[int]) -> Block:
    """Return the operations needed for the results, in an order of computation."""
    wanted = tuple(results)
    order = sorted(needed_for(nodes, wanted))
    groups: dict[int, int] = {}
    tried: dict[int, int] = {}  # condition -> number of times its selects were split
    while True:
        try:
            return _Scheduler(nodes, _paths(nodes, order, wanted, groups), groups).block(())
        except _CircleError as circle:
            condition = min(circle.conditions, key=lambda condition: tried.get(condition, 0))
            tried[condition] = tried.get(condition, 0) + 1
            groups |= _parted(nodes, order, condition, singly=tried[condition] > 1)


def _parted(nodes: Sequence[Node], order: Sequence[int], condition: int, *, singly: bool) -> dict[int, int]:
    """Return groups of the selects of a condition: by their depth of mutual dependence, or one group for each."""
    depth: dict[int, int] = {}
    groups: dict[int, int] = {}
    for number in order:
        depth[number] = max((depth[argument] for argument in nodes[number].arguments), default=0)
        if nodes[number].operation in DECIDES and nodes[number].arguments[0] == condition:
            groups[number] = number if singly else depth[number]
            depth[number] += 1
    return groups


def _edge(nodes: Sequence[Node], number: int, side: int, groups: Mapping[int, int]) -> _Edge:
    return _Edge(nodes[number].arguments[0], side, groups.get(number, 0))


def _paths(
    nodes: Sequence[Node], order: Sequence[int], results: Sequence[int], groups: Mapping[int, int]
) -> dict[int, _Path]:
    """Return the decisions, outermost first, under which each node is needed."""
    paths: dict[int, _Path] = dict.fromkeys(results, ())
    for number in reversed(order):
        node = nodes[number]
        for position, argument in enumerate(node.arguments):
            path = paths[number]
            if node.operation in DECIDES and position > 0:
                path = (*path, _edge(nodes, number, position, groups))
            if not nodes[argument].lanes:
                path = _outside_loops(nodes, path)
            paths[argument] = _common(paths.get(argument, path), path)
    spared: dict[tuple[int, int], int] = {}
    for number in order:
        if not nodes[number].is_leaf:
            for condition, _, group in paths[number]:
                weight = _CALL if nodes[number].operation in CALLS else 1
                if not nodes[condition].lanes:
                    weight *= max(nodes[number].lanes, 1)
                spared[condition, group] = spared.get((condition, group), 0) + weight
    return {
        number: tuple(edge for edge in paths[number] if spared.get((edge.condition, edge.group), 0) >= PAYS)
        for number in order
        if not nodes[number].is_leaf
    }


def _outside_loops(nodes: Sequence[Node], path: _Path) -> _Path:
    """Return the decisions before the first one on an element of a vector."""
    return tuple(takewhile(lambda edge: not nodes[edge.condition].lanes, path))


def _common(first: _Path, second: _Path) -> _Path:
    """Return the common beginning of both."""
    same = 0
    while same < min(len(first), len(second)) and first[same] == second[same]:
        same += 1
    return first[:same]


class _Scheduler:
    """Scheduler of the nodes of a block; adjacent decisions with the same condition are joined."""

    def __init__(self, nodes: Sequence[Node], paths: dict[int, _Path], groups: Mapping[int, int]) -> None:
        self._nodes = nodes
        self._paths = paths
        self._groups = groups
        self._within: dict[_Path, list[int]] = {}
        for number, path in paths.items():
            for length in range(len(path) + 1):
                self._within.setdefault(path[:length], []).append(number)

    def block(self, path: _Path) -> Block:
        """Return the block under these decisions."""
        units: dict[tuple[int, int], list[int]] = {}  # (condition, group) -> selects
        owner: dict[int, tuple[int, int]] = {}  # node -> unit that computes it; (node, -1) stands for a single node
        for number in self._within.get(path, ()):
            own = self._paths[number] == path
            key = (number, _ITSELF)
            if own and self._nodes[number].operation in DECIDES:
                edge = _edge(self._nodes, number, 1, self._groups)
                if any((*path, edge._replace(side=side)) in self._within for side in (1, 2)):
                    key = (edge.condition, edge.group)
                    units.setdefault(key, []).append(number)
            elif not own:
                edge = self._paths[number][len(path)]
                key = (edge.condition, edge.group)
            owner[number] = key

        selects = {number for members in units.values() for number in members}
        waits: dict[tuple[int, int], set[tuple[int, int]]] = {key: set() for key in owner.values()}
        last: dict[tuple[int, int], int] = {}
        for number, key in owner.items():
            arguments = [argument for argument in self._nodes[number].arguments if argument in owner]
            if any(owner[argument] == key and argument in selects for argument in arguments):
                raise _CircleError([key[0]])
            waits[key] |= {owner[argument] for argument in arguments} - {key}
            last[key] = max(last.get(key, -1), number)
        ordered = _ordered(waits, last)
        if len(ordered) < len(waits):
            raise _CircleError([key[0] for key in waits if key not in ordered and key[1] != _ITSELF])

        def item(key: tuple[int, int]) -> int | Decision:
            condition, group = key
            if group == _ITSELF:
                return condition
            first, second = (self.block((*path, _Edge(condition, side, group))) for side in (1, 2))
            return Decision(condition, tuple(units[condition, group]), (first, second))

        lanes = {key: self._lanes(key[0]) for key in ordered}
        if not any(lanes.values()) or len(_outside_loops(self._nodes, path)) < len(path):
            return tuple(map(item, ordered))
        sums = {key for key in ordered if self._nodes[key[0]].operation == "SUM"}
        return tuple(
            CountedLoop(lanes[step[0]], tuple(map(item, step))) if lanes[step[0]] else item(step[0])
            for step in in_loops(ordered, waits, lanes, sums)
        )

    def _lanes(self, number: int) -> int:
        """Return the number of elements that a node, or a decision on it, has in a loop; 0 outside loops."""
        node = self._nodes[number]
        return self._nodes[node.arguments[0]].lanes if node.operation == "SUM" else node.lanes


def _ordered(
    waits: dict[tuple[int, int], set[tuple[int, int]]], last: dict[tuple[int, int], int]
) -> list[tuple[int, int]]:
    """Return units in an order in which none waits for a later one; units in a cycle are omitted."""
    users: dict[tuple[int, int], list[tuple[int, int]]] = {key: [] for key in waits}
    for key, others in waits.items():
        for other in others:
            users[other].append(key)
    count = {key: len(others) for key, others in waits.items()}
    ready = [(last[key], key) for key in waits if count[key] == 0]
    heapq.heapify(ready)
    found = []
    while ready:
        _, key = heapq.heappop(ready)
        found.append(key)
        for user in users[key]:
            count[user] -= 1
            if count[user] == 0:
                heapq.heappush(ready, (last[user], user))
    return found
