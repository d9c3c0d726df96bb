"""Assignment of operations to branches: an operation that only one side of a decision needs is computed there."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import NamedTuple, TypeVar

from friction_fmus.lawkit.emit.graph import CALLS, Node

Key = TypeVar("Key")


def in_loops(
    ordered: Sequence[Key], waits: Mapping[Key, set[Key]], lanes: Mapping[Key, int], sums: Collection[Key]
) -> list[list[Key]]:
    """Return steps, each of one unit outside loops or of the units of one loop.

    A loop contains what the units after it need, and what needs its elements; other operations on elements wait for a
    later loop, so that their results need not be stored.
    """
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
PAYS = 6
"""Smallest number of operations saved by a branch; for fewer, both sides are computed."""

_ITSELF = -1  # stands for a node outside all groups of selects
_CALL = 10  # cost of a call of the C library in operations


@dataclass(frozen=True)
class Decision:
    """An ``if`` with the selects of its condition."""

    condition: int
    """The tested node."""
    selects: tuple[int, ...]
    """Nodes that take one of two values depending on the condition."""
    sides: tuple[Block, Block]
    """Operations computed only for the first, and only for the second value."""


@dataclass(frozen=True)
class Loop:
    """A loop over the elements of vectors."""

    lanes: int
    """Number of elements."""
    items: tuple[int | Decision, ...]
    """Operations on one element, and sums over the elements."""


Block = tuple["int | Decision | Loop", ...]
"""Nodes, decisions and loops in the order of computation."""


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
    order = _needed(nodes, wanted)
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


def _needed(nodes: Sequence[Node], results: Iterable[int]) -> list[int]:
    found = set(results)
    for number in range(len(nodes) - 1, -1, -1):
        if number in found:
            found.update(nodes[number].arguments)
    return sorted(found)


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
        return tuple(
            Loop(lanes[step[0]], tuple(map(item, step))) if lanes[step[0]] else item(step[0])
            for step in in_loops(ordered, waits, lanes, {key for key in ordered if self._is_sum(key[0])})
        )

    def _lanes(self, number: int) -> int:
        """Return the number of elements that a node, or a decision on it, has in a loop; 0 outside loops."""
        node = self._nodes[number]
        return self._nodes[node.arguments[0]].lanes if node.operation == "SUM" else node.lanes

    def _is_sum(self, number: int) -> bool:
        return self._nodes[number].operation == "SUM"


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
