"""Plain C from casadi expressions, in casadi's order of evaluation, for bit-identical results.

`kernel` translates a function for use in any C file.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from casadi import Function

from friction_fmus.lawkit.emit.branches import plan
from friction_fmus.lawkit.emit.graph import graph
from friction_fmus.lawkit.emit.loops import INDEX, Rolled, roll
from friction_fmus.lawkit.emit.names import Named, Names, place_name
from friction_fmus.lawkit.emit.pairs import Weight, split
from friction_fmus.lawkit.emit.real import DOUBLE, FLOAT, Real
from friction_fmus.lawkit.emit.signed_zeros import Zeros
from friction_fmus.lawkit.emit.writer import Writer

__all__ = ["DOUBLE", "FLOAT", "Kernel", "Lows", "Real", "kernel"]


@dataclass(frozen=True)
class Kernel:
    """The C statements of a function."""

    lines: tuple[str, ...]
    """Declarations and statements, which end with the assignments of all results. Truth values have the type ``bool``.
    """
    functions: frozenset[str]
    """Called functions of <math.h>."""


@dataclass(frozen=True)
class Lows:
    """Lower parts of pairs, see `friction_fmus.lawkit.emit.pairs`."""

    wide: Mapping[int, Weight]
    """Arguments that are pairs."""
    reads: Mapping[int, str]
    writes: Mapping[int, str]
    """C expressions of the lower parts, by index of the argument and of the result."""


def kernel(
    function: Function,
    reads: Sequence[str],
    writes: Sequence[str],
    *,
    real: Real = DOUBLE,
    conditions: Iterable[int] = (),
    positive: Iterable[int] | None = None,
    taken: Iterable[str] = (),
    lows: Lows | None = None,
    named: Collection[Named] | None = None,
    remarks: Mapping[int, Sequence[str]] | None = None,
    flags: Collection[str] = (),
    unrolls: bool = False,
) -> Kernel:
    """Translate a casadi function into C statements.

    All results are assigned after the last operation, so a result may overwrite an argument. Operations that only one
    side of a decision needs are computed on that side if this saves enough to justify a branch.
    """
    nodes, results = graph(function)
    describes, named = named is not None, named or ()
    if lows:
        low_of = {number: len(reads) + i for i, number in enumerate(lows.reads)}
        nodes, results, pairs = split(nodes, results, lows.wide, low_of, lows.writes)
        reads, writes = [*reads, *lows.reads.values()], [*writes, *lows.writes.values()]
        named = [
            entry._replace(node=node, name=f"{entry.name}{suffix}")
            for entry in named
            for node, suffix in zip(pairs[entry.node], ("", "_low"), strict=True)
            if node is not None
        ]
        remarks = {pairs[node][0]: texts for node, texts in (remarks or {}).items()}
    rolled = roll(nodes, results, reads, writes)
    truths = frozenset(conditions)
    truths |= {i for i, members in rolled.members.items() if truths >= {*members}}
    never_negative = truths | {*(positive or ())}
    never_negative |= {i for i, members in rolled.members.items() if never_negative >= {*members}}
    unsigned = truths if positive is None else range(len(rolled.reads))
    named = _moved(named, rolled)
    texts_of: dict[int, list[str]] = {}
    for node, texts in (remarks or {}).items():
        texts_of.setdefault(rolled.place[node], []).extend(texts)
    kept: dict[int, list[int]] = {}
    places = {place_name(place): i for i, place in enumerate(rolled.reads)}
    for number, targets in rolled.targets.items():
        for name in filter(places.__contains__, map(place_name, targets)):
            kept.setdefault(places[name], []).append(number)
    zeros = Zeros(rolled.nodes, kept, unsigned, never_negative)
    first = {number: targets[0] for number, targets in rolled.targets.items()}
    names = Names(rolled.nodes, named, rolled.reads, first, [INDEX, *taken], describes=describes)
    vectors = {place.rpartition("[")[0] for place in flags} - {""}
    written = {place for targets in rolled.targets.values() for place in targets}
    of_vectors = {place for place in written if place.rpartition("[")[0] in vectors}
    writer = Writer(rolled, real, truths, zeros, names, texts_of, flags={*flags, *of_vectors}, unrolls=unrolls)
    lines = writer.statements(plan(rolled.nodes, rolled.targets), rolled.targets)
    return Kernel(tuple(lines), frozenset(writer.functions))


def _moved(named: Collection[Named], rolled: Rolled) -> list[Named]:
    """Return the names of nodes in a graph with vectors, which have the names that most of their elements have."""
    nodes = rolled.nodes
    known = [entry for entry in named if entry.node in rolled.place]
    vectors = [entry._replace(node=rolled.place[entry.node], name=_INDEXED.sub("", entry.name)) for entry in known]
    counts = Counter(vectors)
    found: dict[Named, None] = {}
    for entry, vector in zip(known, vectors, strict=True):
        lanes = nodes[vector.node].lanes
        if not lanes:
            found[entry._replace(node=vector.node)] = None
        elif 2 * counts[vector] >= lanes:
            found[vector] = None
        elif entry.node in rolled.single:
            found[entry._replace(node=rolled.single[entry.node])] = None
    return [entry for entry in found if not nodes[entry.node].is_leaf]


_INDEXED = re.compile(r"_\d+$")
