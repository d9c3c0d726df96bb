"""Corresponding operations on the elements of vectors, and loops over them."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from friction_fmus.lawkit.emit.operations import CONDITIONS, Node, needed_for

LEAST = 3  # smallest number of elements for which a loop is written
INDEX = "i"  # index of the element in generated C

_ELEMENT = re.compile(r"(.+)\[(\d+)\]")
_BRIEF = 2  # comparisons and choices that are repeated instead of being stored
_REPEATED = {*CONDITIONS, "SELECT", "IF_ELSE_ZERO"}

Chain = tuple[int, ...]  # corresponding nodes of consecutive elements


class Search:
    """Search for chains of corresponding nodes."""

    def __init__(
        self,
        nodes: Sequence[Node],
        results: Sequence[int],
        reads: Sequence[str],
        writes: Sequence[str],
        refused: Iterable[str],
    ) -> None:
        self.nodes, self.results, self.reads, self.writes = nodes, results, reads, writes
        self._refused = frozenset(refused)
        self.needed = needed_for(nodes, results)  # nodes on which the results depend
        self._by_key = {(node.operation, node.arguments): number for number, node in enumerate(nodes)}
        self._sizes = self._count_operations()
        self._users: dict[int, list[int]] = {}
        for number in self.needed:
            for argument in nodes[number].arguments:
                self._users.setdefault(argument, []).append(number)
        self._next = self._used_alike(self._successors())
        self._chain_of: dict[int, tuple[Chain, int]] = {}  # node -> its chain, and its place there
        for chain in self._chains():
            self._chain_of.update((number, (chain, lane)) for lane, number in enumerate(chain))
        # sums by their last addition: the chain, the node to which its elements are added, all additions
        self.sums: dict[int, tuple[Chain, int | None, Chain]] = {}
        self.partial: dict[int, Chain] = {}  # chains by the additions of their sums
        # chains that are computed in loops
        self.operations = {chain for chain, _ in self._chain_of.values() if not self.is_leaf(chain[0])}
        arguments = {chain for chain, _ in self._chain_of.values() if nodes[chain[0]].operation == "INPUT"}
        for chain in sorted(self.operations | arguments):
            self._find_sum(chain)
        self._reduce()

    def is_leaf(self, number: int) -> bool:
        """Return whether a node is an argument or a number."""
        return self.nodes[number].operation in ("CONST", "INPUT")

    def _element(self, number: int) -> tuple[str, int] | None:
        """Return vector and index of an argument of the function."""
        return _element(self.reads[int(self.nodes[number].value)])

    def _successors(self) -> dict[int, int]:
        """Return the node for the next element, of nodes that have one."""
        found: dict[int, int] = {}
        elements: dict[tuple[str, int], int] = {}
        constants: dict[float, int] = {}
        for number, node in enumerate(self.nodes):
            if node.operation == "INPUT" and (element := self._element(number)) and element[0] not in self._refused:
                elements[element] = number
            elif node.operation == "CONST" and node.value.is_integer() and math.copysign(1.0, node.value) > 0.0:
                constants[node.value] = number
        for (vector, index), number in elements.items():
            if (vector, index + 1) in elements:
                found[number] = elements[vector, index + 1]
        found |= {number: constants[value + 1.0] for value, number in constants.items() if value + 1.0 in constants}
        taken: set[int] = set()
        for number in sorted(self.needed):
            for arguments in _moved(self.nodes[number].arguments, found):
                after = self._by_key.get((self.nodes[number].operation, arguments))
                if after in self.needed and after not in taken:
                    found[number] = after
                    taken.add(after)
                    break
        return found

    def _used_alike(self, after: Mapping[int, int]) -> dict[int, int]:
        """Return the operations whose users also continue with the next element, so that rows of tables end there."""
        found = dict(after)
        for number in sorted(found, reverse=True):
            others = self._users.get(found[number], ())
            continues = [
                found.get(user) in others or self._is_added(user, others) for user in self._users.get(number, ())
            ]
            if not self.is_leaf(number) and not all(continues):
                del found[number]
        return found

    def _is_added(self, addition: int, others: Iterable[int]) -> bool:
        """Return whether a sum continues with another addition."""
        additions = [other for other in others if self.nodes[other].operation == "ADD"]
        return addition in additions or any(addition in self.nodes[other].arguments for other in additions)

    def _chains(self) -> Iterator[Chain]:
        after = {self._next[number] for number in self._next}
        for number in range(len(self.nodes)):
            if number in self._next and number not in after:
                chain = [number]
                while chain[-1] in self._next:
                    chain.append(self._next[chain[-1]])
                if len(chain) >= LEAST:
                    yield tuple(chain)

    def _find_sum(self, chain: Chain) -> None:
        """Find the sum of a chain in the order of its elements."""
        for start in self._users.get(chain[0], ()):
            if self.nodes[start].operation != "ADD":
                continue
            others = [argument for argument in self.nodes[start].arguments if argument != chain[0]]
            first = None if others == [chain[1]] else others[0] if others else chain[0]
            additions = [] if first is None else [start]
            total = chain[0] if first is None else start
            for term in chain[1:]:
                after = self._by_key.get(("ADD", (total, term)), self._by_key.get(("ADD", (term, total))))
                shared = additions and (len(self._users.get(total, ())) != 1 or total in self.results)
                if after not in self.needed or shared:
                    break
                additions.append(after)
                total = after
            else:
                self.sums[total] = (chain, first, tuple(additions))
                self.partial.update(dict.fromkeys(additions, chain))
                return

    def _reduce(self) -> None:
        """Remove the chains that cannot be computed in a loop."""
        while True:
            bad = {chain for chain in self.operations if not self._is_loop(chain)}
            if not bad:
                return
            self.operations -= bad
            for total, (chain, _, additions) in list(self.sums.items()):
                if chain in bad:
                    del self.sums[total]
                    for addition in additions:
                        self.partial.pop(addition, None)

    def _is_loop(self, chain: Chain) -> bool:
        """Return whether arguments and users of a chain can be in loops, and results are consecutive elements."""
        arguments = zip(*(self.nodes[number].arguments for number in chain), strict=True)
        if not all(len({*column}) == 1 or self._is_vector(column) for column in arguments):
            return False
        if not self.is_brief(chain):
            for lane, number in enumerate(chain):
                if not all(self._uses_element(user, chain, lane) for user in self._users.get(number, ())):
                    return False
        return self.places(chain) is not None

    def _is_vector(self, column: Chain) -> bool:
        """Return whether nodes are consecutive elements of a vector, or the whole of a chain that is in a loop."""
        chain, lane = self._chain_of.get(column[0], ((), 0))
        if self.is_leaf(column[0]):
            return chain[lane : lane + len(column)] == column
        return chain == column and chain in self.operations

    def is_brief(self, chain: Chain) -> bool:
        """Return whether a chain is an expression of arguments and constants that may be repeated."""
        if self._sizes[chain[0]] > _BRIEF:
            return False
        columns = zip(*(self.nodes[number].arguments for number in chain), strict=True)
        return all(
            self.is_leaf(column[0]) or (len({*column}) > 1 and self.is_brief(self._chain_of[column[0]][0]))
            for column in columns
        )

    def _count_operations(self) -> list[int]:
        """Return the number of operations in the expression of each node, at most one more than a brief one has."""
        written = {_vector(place) or place for place in self.writes}
        found: list[int] = []
        for node in self.nodes:
            place = self.reads[int(node.value)] if node.operation == "INPUT" else ""
            if node.operation == "CONST" or (place and (_vector(place) or place) not in written):
                found.append(0)
            elif node.operation not in _REPEATED:
                found.append(_BRIEF + 1)
            else:
                found.append(min(1 + sum(found[argument] for argument in node.arguments), _BRIEF + 1))
        return found

    def _uses_element(self, user: int, chain: Chain, lane: int) -> bool:
        other, place = self._chain_of.get(user, ((), -1))
        if other in self.operations:
            return place == lane and len(other) == len(chain)
        return self.partial.get(user) == chain

    def places(self, chain: Chain) -> list[str] | None:
        """Return the vectors to which a chain is assigned; None if an element is assigned to another place."""
        written = [[w for n, w in zip(self.results, self.writes, strict=True) if n == number] for number in chain]
        found = []
        for first in written[0]:
            element = _element(first)
            if element is None or element[0] in self._refused:
                return None
            vector, begin = element
            if not all(f"{vector}[{begin + lane}]" in places for lane, places in enumerate(written)):
                return None
            found.append(_indexed(vector, begin))
        return found if all(len(places) == len(found) for places in written) else None

    def conflicts(self) -> set[str]:
        """Return the written vectors of which elements are also read or written singly, or in another range."""
        inside = {number for chain in self.operations for number in chain} | self.partial.keys()
        ranges: dict[str, set[tuple[str, int]]] = {}
        single = {_vector(w) for n, w in zip(self.results, self.writes, strict=True) if n not in inside}
        for chain in self.operations:
            columns = [*zip(*(self.nodes[number].arguments for number in chain), strict=True)]
            for place in (*(self.places(chain) or ()), *filter(None, map(self.place_of, columns))):
                ranges.setdefault(_vector(place), set()).add((place, len(chain)))
            single |= {self._read(column[0]) for column in columns if len({*column}) == 1}
        for place, length in ((self.place_of(chain), len(chain)) for chain, _, _ in self.sums.values()):
            ranges.setdefault(_vector(place), set()).add((place, length))
        for number in self.needed - inside:
            single |= {self._read(argument) for argument in self.nodes[number].arguments}
        several = {vector for vector, found in ranges.items() if len(found) > 1}
        written = {_vector(place) for place in self.writes} - {""}
        return ranges.keys() & written & (single | several)

    def _read(self, number: int) -> str:
        """Return the vector of which a node is a single element; empty for other nodes."""
        return _vector(self.reads[int(self.nodes[number].value)]) if self.nodes[number].operation == "INPUT" else ""

    def place_of(self, column: Chain) -> str:
        """Return the C expression of consecutive elements of an argument; empty for other nodes."""
        if len({*column}) == 1 or self.nodes[column[0]].operation != "INPUT":
            return ""
        element = self._element(column[0])
        return _indexed(*element) if element else ""


def _moved(arguments: Chain, after: Mapping[int, int]) -> Iterator[Chain]:
    """Yield arguments of which one or more are moved to the next element, most of them first."""
    movable = [place for place, argument in enumerate(arguments) if argument in after]
    for count in range(len(movable), 0, -1):
        for places in combinations(movable, count):
            yield tuple(after[a] if place in places else a for place, a in enumerate(arguments))


def _element(place: str) -> tuple[str, int] | None:
    match = _ELEMENT.fullmatch(place)
    return (match[1], int(match[2])) if match else None


def _vector(place: str) -> str:
    """Return the vector of an element, also of one with the index of a loop; empty for scalars."""
    return place.rpartition("[")[0]


def _indexed(vector: str, begin: int) -> str:
    return f"{vector}[{INDEX} + {begin}]" if begin else f"{vector}[{INDEX}]"


@dataclass(frozen=True)
class Rolled:
    """A graph with operations on vectors."""

    nodes: list[Node]  # all operations, arguments before their users
    reads: list[str]  # C expression of each argument: the given ones, then those of vectors, with the index `INDEX`
    members: dict[int, Chain] = field(default_factory=dict)  # given arguments by the index of each vector in `reads`
    targets: dict[int, list[str]] = field(default_factory=dict)  # places to which each result is assigned
    place: dict[int, int] = field(default_factory=dict)
    """New index of each given node that still exists, of an element its vector."""
    single: dict[int, int] = field(default_factory=dict)  # new index of each given element that is also used singly


def roll(nodes: Sequence[Node], results: Sequence[int], reads: Sequence[str], writes: Sequence[str]) -> Rolled:
    """Find the operations on elements of vectors."""
    refused: set[str] = set()  # vectors whose elements are read or written singly
    while True:
        search = Search(nodes, results, reads, writes, refused)
        conflicts = search.conflicts() - refused
        if not conflicts:
            return _ChainWriter(search).rolled()
        refused |= conflicts


class _ChainWriter:
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
