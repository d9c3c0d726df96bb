"""Places of the parts of a system in a block diagram: in columns along the signals, with feedback drawn backwards.

The steps are those of Sugiyama, Tagawa, Toda: IEEE Transactions on Systems, Man, and Cybernetics 11(2), 1981.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

Pair: TypeAlias = tuple[str, str]
Point: TypeAlias = tuple[float, float]

SWEEPS = 8


@dataclass(frozen=True)
class Layout:
    """A block diagram on a grid."""

    places: Mapping[str, Point]
    """Column and row of each part; row 0 is the middle."""
    routes: Mapping[Pair, tuple[Point, ...]]
    """Columns and rows that the connection between two parts passes, from its source to its target."""
    columns: int
    rows: int
    """Size of the grid."""


def arrange(parts: Sequence[str], pairs: Iterable[Pair]) -> Layout:
    """Return the layout of a system."""
    edges = [pair for pair in dict.fromkeys(pairs) if pair[0] != pair[1]]
    back = _feedback(parts, edges)
    forward = [(b, a) if (a, b) in back else (a, b) for a, b in edges]
    depth = _depths(parts, forward)
    chains = {edge: _chain(*way, depth) for edge, way in zip(edges, forward, strict=True)}
    links = [link for chain in chains.values() for link in itertools.pairwise(chain)]
    columns: list[list[str]] = [[] for _ in range(max(depth.values(), default=0) + 1)]
    for part in parts:
        columns[depth[part]].append(part)
    for chain in chains.values():
        for node in chain[1:-1]:
            column = columns[depth[chain[0]] + chain.index(node)]
            column += [] if node in column else [node]
    _untangle(columns, links)
    rows = max(map(len, columns), default=1)
    places = {
        node: (float(x), y - (len(column) - 1) / 2.0)
        for x, column in enumerate(columns)
        for y, node in enumerate(column)
    }
    routes = {
        edge: tuple(places[node] for node in (chain if edge not in back else chain[::-1]))
        for edge, chain in chains.items()
    }
    return Layout({part: places[part] for part in parts}, routes, len(columns), rows)


def _feedback(parts: Sequence[str], edges: Sequence[Pair]) -> set[Pair]:
    """Return connections without which there is no loop: those that lead back in a search from the sources."""
    driven = {target for _, target in edges}
    found: set[Pair] = set()
    done: set[str] = set()

    def visit(part: str, above: tuple[str, ...]) -> None:
        if part in done:
            return
        for source, target in edges:
            if source == part:
                if target in (*above, part):
                    found.add((source, target))
                else:
                    visit(target, (*above, part))
        done.add(part)

    for part in sorted(parts, key=driven.__contains__):
        visit(part, ())
    return found


def _depths(parts: Sequence[str], edges: Sequence[Pair]) -> dict[str, int]:
    """Return the column of each part: the longest way to it."""
    depth = dict.fromkeys(parts, 0)
    for _ in parts:
        for source, target in edges:
            depth[target] = max(depth[target], depth[source] + 1)
    return depth


def _chain(source: str, target: str, depth: Mapping[str, int]) -> list[str]:
    """Return the nodes of a connection: its ends and a place in each column between them."""
    between = [f"{source} {target} {k}" for k in range(depth[source] + 1, depth[target])]
    return [source, *between, target]


def _untangle(columns: Sequence[list[str]], links: Sequence[Pair]) -> None:
    """Sort each column by the mean place of the neighbours, from left to right and back."""
    neighbours: dict[str, list[str]] = {}
    for a, b in links:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    for sweep in range(SWEEPS):
        order = range(len(columns)) if sweep % 2 == 0 else range(len(columns) - 1, -1, -1)
        for x in order:
            beside = columns[x - 1 if sweep % 2 == 0 else x + 1] if 0 <= x + (-1) ** (sweep + 1) < len(columns) else []
            places = {node: y - (len(beside) - 1) / 2.0 for y, node in enumerate(beside)}
            means = {}
            for y, node in enumerate(columns[x]):
                seen = [places[other] for other in neighbours.get(node, []) if other in places]
                means[node] = sum(seen) / len(seen) if seen else y - (len(columns[x]) - 1) / 2.0
            columns[x].sort(key=means.__getitem__)
