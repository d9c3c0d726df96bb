"""Where values are computed, used and assigned."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from friction_fmus.lawkit.emit.branches import Block, Decision, Loop
from friction_fmus.lawkit.emit.expressions import REPEATS
from friction_fmus.lawkit.emit.graph import Node

RESULT, SIDE, IF = -1, -2, -3  # users of a value that are not nodes


class Store(NamedTuple):
    """Assignment to elements of vectors."""

    node: int
    """A vector, or a select of vectors."""
    places: Sequence[str]
    """Places of an element."""
    side: int | None
    """Side of the select that is assigned; None for the value of the node."""

    def values(self, nodes: Sequence[Node]) -> tuple[int, ...]:
        """Return the node that is assigned; none for a zero."""
        if self.side is None:
            return (self.node,)
        return nodes[self.node].arguments[self.side : self.side + 1]

    @property
    def uses(self) -> int:
        """Number of uses of the node in the count of users."""
        return len(self.places) if self.side is None else 1


def numbers(item: int | Decision | Loop) -> Iterator[int]:
    """Yield the nodes of an item."""
    if isinstance(item, int):
        yield item
    elif isinstance(item, Loop):
        for inner in item.items:
            yield from numbers(inner)
    else:
        yield from item.selects
        for side in item.sides:
            for part in side:
                yield from numbers(part)


def computed(item: int | Decision | Loop) -> tuple[int, ...]:
    """Return the nodes with the values of an item that is not a loop."""
    return item.selects if isinstance(item, Decision) else (item,) if isinstance(item, int) else ()


def is_in(user: int, place: int, inside: Collection[int]) -> bool:
    """Return whether a user of a value is among these nodes."""
    return (place if user in (SIDE, IF) else user) in inside


def last_values(nodes: Sequence[Node], block: Block, targets: Mapping[int, Sequence[str]]) -> Iterator[tuple[int, str]]:
    """Yield the values that are assigned after other results may have been, with their places."""
    yield from ((number, place) for number, places in targets.items() for place in places)
    last = block[-1] if block else None
    if isinstance(last, Decision):
        for side, inner in enumerate(last.sides, start=1):
            values: dict[int, list[str]] = {}
            for select in last.selects:
                for argument in nodes[select].arguments[side : side + 1]:
                    values.setdefault(argument, []).extend(targets.get(select, ()))
            yield from last_values(nodes, inner, values)


def count_users(nodes: Sequence[Node], block: Block, users: dict[int, list[tuple[int, int]]]) -> None:
    """Add the users of each node as they appear in the text, and the place among their arguments."""

    def add(argument: int, user: int, place: int, times: int = 1) -> None:
        users.setdefault(argument, []).extend([(user, place)] * times)

    def times(argument: int, user: int) -> int:
        return 2 if nodes[user].lanes and not nodes[argument].lanes else 1  # once for each element

    for item in block:
        if isinstance(item, Loop):
            count_users(nodes, item.items, users)
        elif isinstance(item, Decision):
            add(item.condition, IF, item.selects[0])
            for select in item.selects:
                for argument in nodes[select].arguments[1:]:
                    add(argument, SIDE, select, times(argument, select))
            for side in item.sides:
                count_users(nodes, side, users)
        else:
            for place, argument in enumerate(nodes[item].arguments):
                add(argument, item, place, REPEATS.get(nodes[item].operation, 1) * times(argument, item))
