"""The dependency graph of a system: algebraic loops and the stepping order of parts.

The nodes are variables, not parts: an output depends on the outputs that drive the inputs on which it depends directly.
A mass and a friction model drive each other, yet there is no algebraic loop, because the velocity of the mass is a
state.
"""

import logging
from collections.abc import Iterable, Mapping, Sequence
from graphlib import TopologicalSorter
from typing import Final

import numpy as np

from harness.errors import AlgebraicLoopError, ExperimentError, HarnessError, UnknownNameError, nearest
from harness.parts.part import TYPE_ORDER, Part, Port, Values
from harness.parts.series import SeriesPart
from harness.system.assembly import Assembly, start_values
from harness.system.experiment import Experiment
from harness.system.plan import Plan
from harness.system.wire import Wire, find_part, split_name, wire_map
from harness.values import matching

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
    """Return the connections that can close an algebraic loop."""
    # A sampled part reads the value of a continuous part just before the sample (the limit from the left). Connections
    # from continuous to sampled parts therefore close no loop; neither do connections with a delay.
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
    """Return the names of the parts in the order in which a sequential master steps them."""
    # Sampled parts come first, as they take their sample at the beginning of the step, an estimator before the
    # controller that reads it. Continuous parts follow: a part whose outputs are states (a plant) comes before the
    # sensors and friction models with direct feedthrough from it, so that their outputs are correct at the end of the
    # step. A part without inputs (a reference) comes last, so that plants read its value at the beginning of the step,
    # unless an output depends on it directly; one of held values only if all outputs do, as they jump at the end of the
    # step and a state does not. A series of linear values comes first, as its values at both ends of the step are used.
    fed = {name: [parts[wire.ends[1][0]] for wire in wires if wire.ends[0][0] == name] for name in parts}
    lines = [name for name, part in parts.items() if isinstance(part, SeriesPart) and part.moves]
    first = [name for name in lines if all(part.sampled and part.follows for part in fed[name])]
    sampled = [name for name, part in parts.items() if part.sampled]
    continuous = [name for name, part in parts.items() if not part.sampled and name not in first]
    last = _sort(parts, [wire for wire in wires if not _jumps(parts, wire)], continuous)
    return first + _sort(parts, wires, sampled) + last


def is_held_source(part: Part) -> bool:
    """Return whether the values of a part come from outside and jump at the end of a step."""
    return not (part.inputs or part.sampled or part.moves)


def _jumps(parts: Mapping[str, Part], wire: Wire) -> bool:
    """Return whether a part of which not all outputs depend directly on it gets a held value from outside."""
    target, port = wire.ends[1]
    directly = parts[target].dependencies.values()
    return is_held_source(parts[wire.ends[0][0]]) and any(port not in names for names in directly)


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
                key=lambda name: (min(depth[name, output] for output in _used(parts[name], wires)), group.index(name)),
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
    sources = {node: [source for source, _ in found] for node, found in edges.items()}
    for node in TopologicalSorter(sources).static_order():
        depth[node] = max((depth[source] + 1 for source in sources[node]), default=0)
    return depth


def recorded_names(parts: Mapping[str, Part], patterns: Iterable[str], context: str = "record") -> list[str]:
    """Return the names of the variables that match patterns."""
    outputs = [f"{name}.{port.name}" for name, part in parts.items() for port in part.outputs]
    found: dict[str, None] = {}
    for pattern in patterns:
        if "*" in pattern or "?" in pattern:
            meant = matching(pattern, outputs)
            if not meant and pattern != "*":
                raise UnknownNameError(f"no output matches '{pattern}' (in {context}): {nearest(pattern, outputs)}")
            found.update(dict.fromkeys(meant))
        else:
            find_port(parts, pattern, context)
            found[pattern] = None
    return list(found)


def find_port(parts: Mapping[str, Part], dotted: str, context: str) -> Port:
    """Return a readable variable by its full name."""
    part_name, port_name = split_name(dotted)
    part = find_part(parts, part_name, context)
    ports = {port.name: port for port in (*part.inputs, *part.outputs, *part.observables)}
    if port_name not in ports:
        raise UnknownNameError(
            f"'{part_name}' has no variable '{port_name}' (in {context}): {part.hint(port_name, ports)}"
        )
    return ports[port_name]


def state_outputs(parts: Mapping[str, Part]) -> list[str]:
    """Return the full names of the Real outputs that depend on no input directly, of parts that move."""
    return [
        f"{name}.{port.name}"
        for name, part in parts.items()
        if part.moves and part.inputs
        for port in part.outputs
        if port.type == "Real" and not port.held and not part.dependencies[port.name]
    ]


def positions(parts: Mapping[str, Part], wires: Iterable[Wire]) -> list[str]:
    """Return the full names of the Real outputs that are integrals of outputs which are connected."""
    sources = {split_name(wire.source) for wire in wires}
    found = {(name, parts[name].integrals[port]) for name, port in sources if port in parts[name].integrals}
    return sorted(f"{name}.{x}" for name, x in found if any(port.name == x for port in parts[name].outputs))


def make_plan(system: Assembly, experiment: Experiment, read: Sequence[str]) -> Plan:
    """Return the plan of a run."""
    parts = [system.parts[name] for name in _order(system, experiment)]
    drivers = {wire.target: wire.source for wire in system.wires}
    wanted = set(read) | set(drivers.values())

    exchanged = [_by_type(p.name, (*p.outputs, *p.observables), wanted) for p in parts]
    wired = [_by_type(p.name, p.inputs, set(drivers)) for p in parts]
    constant = [_by_type(p.name, p.inputs, wanted - set(drivers)) for p in parts]

    ports: dict[str, Port] = {}
    ranges = []
    for block in (exchanged, wired, constant):
        for members in block:
            ranges.append((len(ports), len(ports) + len(members)))
            ports.update(members)
    columns = {name: index for index, name in enumerate(ports)}
    gains, offsets = np.ones(len(ports)), np.zeros(len(ports))
    delays, initials = np.zeros(len(ports), dtype=np.int64), np.full(len(ports), np.nan)
    for wire in system.wires:
        target = columns[wire.target]
        gains[target], offsets[target] = wire_map(wire, ports[wire.source], ports[wire.target])
        delays[target] = wire.delay
        initials[target] = np.nan if wire.initial is None else wire.initial
    plain = not (offsets.any() or delays.any() or experiment.manipulators) and bool((gains == 1.0).all())

    every = np.array([part.every for part in parts], dtype=np.int64).reshape(-1)
    sampled = np.array([part.sampled for part in parts], dtype=bool).reshape(-1)
    return Plan(
        parts=tuple(parts),
        calls=[],
        signals=np.zeros(len(ports)),
        outputs=np.array(ranges[: len(parts)], dtype=np.int64).reshape(-1, 2),
        inputs=np.array(ranges[len(parts) : 2 * len(parts)], dtype=np.int64).reshape(-1, 2),
        sources=np.array([columns[drivers.get(name, name)] for name in ports], dtype=np.int64),
        wire_gains=gains,
        wire_offsets=offsets,
        gains=gains.copy(),
        offsets=offsets.copy(),
        delays=delays,
        initials=initials,
        plain=plain,
        every=every,
        phase=np.where(sampled, 0, every - 1),
        columns=columns,
        ports=ports,
        start=experiment.start,
        step=experiment.step,
        ticks=experiment.ticks,
    )


def _order(system: Assembly, experiment: Experiment) -> list[str]:
    """Return the stepping order: the requested one, or the one from the dependencies."""
    if not experiment.order:
        return stepping_order(system.parts, system.wires)
    for name in experiment.order:
        find_part(system.parts, name, "order")
    if sorted(experiment.order) != sorted(system.parts):
        missing = sorted(set(system.parts) - set(experiment.order))
        fault = f"does not name {', '.join(missing)}" if missing else "names a part twice"
        raise ExperimentError(f"the order {', '.join(experiment.order)} {fault}: name every part exactly once")
    return list(experiment.order)


def _by_type(part: str, ports: Iterable[Port], wanted: set[str]) -> dict[str, Port]:
    """Return the wanted ports of a part, Reals first, so that each type is a contiguous range."""
    named = {f"{part}.{port.name}": port for port in ports if f"{part}.{port.name}" in wanted}
    return dict(sorted(named.items(), key=lambda item: TYPE_ORDER.index(item[1].type)))


_LOG = logging.getLogger("harness")

# Many exporters declare no dependencies. According to FMI, every output then depends on every input, and every loop of
# such FMUs would be algebraic; few really are. Their direct feedthrough is found by trial.

_STEPS: Final = (1e-3, -1e-3, 0.1, -0.1, 1.0, -1.0)  # trial changes of a Real input, relative to its nominal value

_SHIFTS: Final = (0.0, 0.37, -0.61)
"""Offsets from the start values at which inputs are tried, relative to their nominal values: a product with 0 hides its
other factor."""


def find_feedthrough(system: Assembly, experiment: Experiment) -> None:
    """Find the dependencies of parts that do not declare them, if they decide whether there is an algebraic loop."""
    # Each such part is started a second time, for the trial only, with the start values of the run.
    parts = [part for part in system.parts.values() if part.undeclared]
    for part in parts:
        every_input = frozenset(port.name for port in part.inputs)
        part.dependencies = {**part.dependencies, **dict.fromkeys(part.undeclared, every_input)}
    if parts and find_loop(direct_edges(system.parts, system.wires)) is not None:
        for part in parts:
            _find(part, system, experiment)


def _find(part: Part, system: Assembly, experiment: Experiment) -> None:
    """Try the connected inputs and outputs of one part."""
    inputs = _sorted(part.inputs, {wire.target for wire in system.wires}, part.name)
    outputs = _sorted(part.outputs, {wire.source for wire in system.wires}, part.name)
    outputs = [port for port in outputs if port.name in part.undeclared]
    if not inputs or not outputs:
        return
    try:
        part.enter_initialisation(
            experiment.start, experiment.stop, experiment.tolerance, start_values(system.start, part.name)
        )
        found = _try_inputs(part, inputs, outputs)
        _LOG.info("%s does not declare its dependencies; a trial shows that %s", part.name, _shown(found))
    except HarnessError as error:
        found = {port.name: frozenset() for port in outputs}
        _LOG.warning(
            "%s does not declare its dependencies, and a trial could not find them (%s): if one of its outputs "
            "depends directly on an input, the values in its loop are one step late; compare with a shorter step",
            part.name,
            error,
        )
    finally:
        part.terminate()
    part.dependencies = {**part.dependencies, **found}


def _try_inputs(part: Part, inputs: Sequence[Port], outputs: Sequence[Port]) -> dict[str, frozenset[str]]:
    """Return for each output the inputs that change it without a step."""
    u, y = np.zeros(len(inputs)), np.zeros(len(outputs))
    calls = part.bind([port.name for port in inputs], [port.name for port in outputs], u, y)
    part.exit_initialisation()

    def read(at: Values) -> Values:
        u[:] = at
        calls.set()
        calls.get()
        return y.copy()

    depends = np.zeros((len(outputs), len(inputs)), dtype=bool)
    for shift in _SHIFTS:
        base = np.array([_shifted(port, shift) for port in inputs])
        for i, port in enumerate(inputs):
            for value in _others(port, float(base[i])):
                before, moved = read(base), base.copy()
                moved[i] = value
                after = read(moved)
                depends[:, i] |= (before != after) & ~(np.isnan(before) & np.isnan(after))
    names = np.array([port.name for port in inputs])
    return {port.name: frozenset(names[row].tolist()) for port, row in zip(outputs, depends, strict=True)}


def _shifted(port: Port, shift: float) -> float:
    """Return the start value of an input, or a value near it."""
    start = float(port.start or 0.0)
    if port.type == "Real":
        low, high = port.limits
        return min(max(start + shift * _size(port), low), high)
    return float(shift > 0.0) if port.type == "Boolean" and shift else start


def _others(port: Port, value: float) -> list[float]:
    """Return other values of an input."""
    if port.type == "Boolean":
        return [1.0 - value]
    if port.items:
        return [float(number) for _, number in port.items if number != value]
    steps = [step * _size(port) for step in _STEPS] if port.type == "Real" else [1.0, -1.0]
    low, high = port.limits
    return [value + step for step in steps if low <= value + step <= high]


def _size(port: Port) -> float:
    return max(abs(float(port.start or 0.0)), port.nominal)


def _sorted(ports: Sequence[Port], wired: set[str], part: str) -> list[Port]:
    """Return the connected ports in the order in which ports are bound."""
    chosen = [port for port in ports if f"{part}.{port.name}" in wired]
    return sorted(chosen, key=lambda port: TYPE_ORDER.index(port.type))


def _shown(found: Mapping[str, frozenset[str]]) -> str:
    texts = (f"{name} depends on {', '.join(sorted(read)) or 'no input'}" for name, read in found.items())
    return ", ".join(texts)
