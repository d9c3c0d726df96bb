"""The dependency graph of a system: algebraic loops and the stepping order of parts.

The nodes are variables, not parts: an output depends on the outputs that drive the inputs on which it depends directly.
A mass and a friction model drive each other, yet there is no algebraic loop, because the velocity of the mass is a
state.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from harness.errors import AlgebraicLoopError
from harness.parts.part import Part
from harness.parts.series import SeriesPart
from harness.system.wire import Wire

Node = tuple[str, str]  # (part, output)
Edges = Mapping[Node, Sequence[tuple[Node, Wire]]]


def direct_edges(parts: Mapping[str, Part], wires: Iterable[Wire]) -> dict[Node, list[tuple[Node, Wire]]]:
    """Return for each output the outputs on which it depends directly, with the connection in between."""
    drivers: dict[Node, tuple[Node, Wire]] = {wire.ends[1]: (wire.ends[0], wire) for wire in wires}
    return {
        (name, output.name): [
            drivers[name, port.name]
            for port in part.inputs
            if port.name in part.dependencies[output.name] and (name, port.name) in drivers
        ]
        for name, part in parts.items()
        for output in part.outputs
    }


def find_loop(edges: Edges) -> list[Wire] | None:
    """Return the connections of one algebraic loop in signal direction, or None if there is none."""
    done: set[Node] = set()
    for root in edges:
        path: list[tuple[Node, Wire | None]] = [(root, None)]
        pending = [iter(edges[root])]
        while path:
            step = next(pending[-1], None)
            if step is None:
                done.add(path.pop()[0])
                pending.pop()
                continue
            node, wire = step
            on_path = [visited for visited, _ in path]
            if node in on_path:
                loop = [taken for _, taken in path[on_path.index(node) + 1 :] if taken] + [wire]
                return loop[::-1]  # the search runs against the signal direction
            if node not in done:
                path.append((node, wire))
                pending.append(iter(edges[node]))
    return None


def instantaneous(parts: Mapping[str, Part], wires: Iterable[Wire]) -> list[Wire]:
    """Return the connections that can close an algebraic loop.

    A sampled part reads the value of a continuous part just before the sample (the limit from the left). Connections
    from continuous to sampled parts therefore close no loop; neither do connections with a delay.
    """
    return [
        wire
        for wire in wires
        if not wire.delay and (parts[wire.ends[0][0]].sampled or not parts[wire.ends[1][0]].sampled)
    ]


def check_loops(parts: Mapping[str, Part], wires: Sequence[Wire], *, implicit: bool) -> None:
    """Raise an error if there is an algebraic loop that the master cannot solve."""
    closing = instantaneous(parts, wires)
    if implicit:
        closing = [wire for wire in closing if not _solved(parts, wire)]
    loop = find_loop(direct_edges(parts, closing))
    if loop:
        flow = [name for wire in loop for name in (wire.source, wire.target)] + [loop[0].source]
        solvable = all(parts[wire.ends[0][0]].moves for wire in loop) and any(_solved(parts, wire) for wire in loop)
        remedy = ", or use the master newton" if solvable and not implicit else ""
        raise AlgebraicLoopError(
            f"algebraic loop {' -> '.join(flow)}: add a part with a state, a sampled part or a connection with a "
            f"delay to it{remedy}"
        )


def _solved(parts: Mapping[str, Part], wire: Wire) -> bool:
    """Return whether an implicit master iterates on a connection: a Real one between continuous parts."""
    target, name = wire.ends[1]
    real = any(port.name == name and port.type == "Real" for port in parts[target].inputs)
    return real and all(parts[part].moves for part, _ in wire.ends)


def stepping_order(parts: Mapping[str, Part], wires: Sequence[Wire]) -> list[str]:
    """Return the names of the parts in the order in which a sequential master steps them.

    Sampled parts come first, as they take their sample at the beginning of the step, an estimator before the controller
    that reads it. Continuous parts follow: a part whose outputs are states (a plant) comes before the sensors and
    friction models with direct feedthrough from it, so that their outputs are correct at the end of the step. A part
    without inputs (a reference, a series of held values) comes last, so that plants read its value at the beginning of
    the step, unless an output depends on it directly. A series of linear values comes first, as its values at both
    ends of the step are used.
    """
    sampled = [name for name, part in parts.items() if part.sampled]
    continuous = [name for name, part in parts.items() if not part.sampled]
    return _sort(parts, wires, sampled) + _sort(parts, wires, continuous)


def propagation_order(parts: Mapping[str, Part], wires: Sequence[Wire]) -> list[str]:
    """Return the names of the parts in the order in which start values propagate."""
    return _sort(parts, wires, list(parts))


def _sort(parts: Mapping[str, Part], wires: Sequence[Wire], group: list[str]) -> list[str]:
    """Return a topological order of a group; independent parts keep their declared order."""
    inner = [wire for wire in wires if wire.ends[0][0] in group and wire.ends[1][0] in group]
    depth = _depths(_opened(parts, instantaneous(parts, inner)))
    before: dict[str, set[str]] = {name: set() for name in group}  # direct feedthrough: must come before
    wished: dict[str, set[str]] = {name: set() for name in group}  # any connection: preferred before, if sampled
    for wire in inner:
        (source, _), (target, port) = wire.ends
        if source == target or wire.delay:
            continue
        wished[target].add(source)
        if any(port in parts[target].dependencies[output] for output in _used(parts[target], wires)):
            before[target].add(source)

    def urgency(name: str) -> tuple[bool, bool, int]:
        part = parts[name]
        waits = bool(wished[name] & set(remaining)) if part.sampled else not part.inputs
        recorded = isinstance(part, SeriesPart) and part.moves
        return not recorded, waits, group.index(name)

    order: list[str] = []
    remaining = list(group)
    while remaining:
        free = [name for name in remaining if not before[name] & set(remaining)]
        if free:
            chosen = min(free, key=urgency)
        else:
            # the parts form a cycle although their variables do not: begin nearest to a state
            chosen = min(
                remaining,
                key=lambda name: (
                    min(depth[name, output] for output in _used(parts[name], wires)),
                    group.index(name),
                ),
            )
        order.append(chosen)
        remaining.remove(chosen)
    return order


def _used(part: Part, wires: Sequence[Wire]) -> list[str]:
    """Return the connected outputs of a part, or all of them if none is connected (the part is only recorded)."""
    wired = {wire.ends[0][1] for wire in wires if wire.ends[0][0] == part.name}
    return [port.name for port in part.outputs if port.name in wired] or [port.name for port in part.outputs]


def _opened(parts: Mapping[str, Part], wires: Sequence[Wire]) -> Edges:
    """Return the direct dependencies without the connections that close algebraic loops."""
    kept = list(wires)
    while loop := find_loop(direct_edges(parts, kept)):
        kept.remove(loop[-1])
    return direct_edges(parts, kept)


def _depths(edges: Edges) -> dict[Node, int]:
    """Return the number of connections from each output to the farthest state on which it depends; no loops."""
    depth: dict[Node, int] = {}
    for root in edges:
        stack = [root]
        while stack:
            node = stack[-1]
            missing = [source for source, _ in edges[node] if source not in depth]
            if missing:
                stack.extend(missing)
                continue
            depth[node] = max((depth[source] + 1 for source, _ in edges[node]), default=0)
            stack.pop()
    return depth
