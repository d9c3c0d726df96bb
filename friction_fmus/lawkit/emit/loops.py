"""Equal operations on the elements of vectors, which generated C computes in loops.

The equations of a law are written for each element, so the graph of their operations contains equal subgraphs, which
differ in the elements that they read. `roll` replaces each set of corresponding operations by one node with `lanes`,
and the sum of its elements by the node SUM. The order of operations within an element and in sums stays, and so do the
bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from friction_fmus.lawkit.emit.chains import INDEX, Chain, Search
from friction_fmus.lawkit.emit.graph import Node

__all__ = ["INDEX", "Rolled", "roll"]


@dataclass(frozen=True)
class Rolled:
    """A graph with operations on vectors."""

    nodes: list[Node]
    """All operations, arguments before their users."""
    reads: list[str]
    """C expression of each argument: the given ones, then those of vectors, with the index `INDEX`."""
    members: dict[int, Chain] = field(default_factory=dict)
    """Given arguments by the index of each vector in `reads`."""
    targets: dict[int, list[str]] = field(default_factory=dict)
    """Places to which each result is assigned."""
    place: dict[int, int] = field(default_factory=dict)
    """New index of each given node that still exists, of an element its vector."""
    single: dict[int, int] = field(default_factory=dict)
    """New index of each given element that is also used singly."""


def roll(nodes: Sequence[Node], results: Sequence[int], reads: Sequence[str], writes: Sequence[str]) -> Rolled:
    """Find the operations on elements of vectors."""
    refused: set[str] = set()  # vectors whose elements are read or written singly
    while True:
        search = Search(nodes, results, reads, writes, refused)
        conflicts = search.conflicts() - refused
        if not conflicts:
            return _Writer(search).rolled()
        refused |= conflicts


class _Writer:
    """Writer of the graph with vectors."""

    def __init__(self, search: Search) -> None:
        self._search = search
        self._found = Rolled([], [*search.reads])
        self._owners: dict[int, int] = {}  # node -> vector of which it is an element
        self._columns: dict[Chain, int] = {}  # chains, and elements of arguments and constants -> node

    def rolled(self) -> Rolled:
        """Return the graph."""
        search, found = self._search, self._found
        ends = {max(chain): chain for chain in search.operations}
        scalars = self._scalars()
        for number, node in enumerate(search.nodes):
            if number in scalars:
                arguments = tuple(found.place[argument] for argument in node.arguments)
                found.place[number] = self._add(Node(node.operation, arguments, node.value))
            if number in ends:
                self._chain(ends[number])
            if number in search.sums:
                chain, first, additions = search.sums[number]
                terms = [self._argument(chain), *([] if first is None else [found.place[first]])]
                found.place.update(dict.fromkeys(additions, self._add(Node("SUM", tuple(terms)))))
        inside = {number for chain in search.operations for number in chain}
        for number, place in zip(search.results, search.writes, strict=True):
            if number not in inside:
                found.targets.setdefault(found.place[number], []).append(place)
        found.single.update({number: found.place[number] for number in self._owners if number in found.place})
        found.place.update(self._owners)
        return found

    def _scalars(self) -> set[int]:
        """Return the nodes that stay scalars: also elements of brief chains that are used singly."""
        search = self._search
        inside = {number for chain in search.operations for number in chain} | search.partial.keys()
        found = {number for number in search.needed if number not in inside and not search.is_leaf(number)}
        found |= {number for number in search.results if number not in inside}
        found |= {first for _, first, _ in search.sums.values() if first is not None}
        for chain in search.operations:
            columns = zip(*(search.nodes[number].arguments for number in chain), strict=True)
            found |= {column[0] for column in columns if len({*column}) == 1}
        for number in range(len(search.nodes) - 1, -1, -1):
            if number in found and number not in search.partial:
                found.update(search.nodes[number].arguments)
        return found - search.partial.keys()

    def _chain(self, chain: Chain) -> None:
        search, found = self._search, self._found
        columns = zip(*(search.nodes[number].arguments for number in chain), strict=True)
        arguments = tuple(self._argument(column) for column in columns)
        operation, brief = search.nodes[chain[0]].operation, search.is_brief(chain)
        self._columns[chain] = self._add(Node(operation, arguments, lanes=len(chain), brief=brief))
        self._owners.update(dict.fromkeys(chain, self._columns[chain]))
        if places := search.places(chain):
            found.targets[self._columns[chain]] = places

    def _argument(self, column: Chain) -> int:
        """Return the node of corresponding arguments."""
        search, found = self._search, self._found
        if len({*column}) == 1:
            return found.place[column[0]]
        if column not in self._columns:
            node = search.nodes[column[0]]
            if node.operation == "INPUT":
                found.members[len(found.reads)] = tuple(int(search.nodes[number].value) for number in column)
                self._columns[column] = self._add(Node("INPUT", (), float(len(found.reads)), lanes=len(column)))
                found.reads.append(search.place_of(column))
            else:
                self._columns[column] = self._add(Node("INDEX", (), node.value, lanes=len(column)))
        return self._columns[column]

    def _add(self, node: Node) -> int:
        self._found.nodes.append(node)
        return len(self._found.nodes) - 1
