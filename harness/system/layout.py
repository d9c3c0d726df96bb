"""The plan of a run from a system: the index of each value."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from harness.errors import ExperimentError, UnknownNameError, nearest
from harness.parts.part import TYPE_ORDER, Part, Port
from harness.patterns import matching
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment
from harness.system.graph import stepping_order
from harness.system.plan import Plan
from harness.system.wire import find_part, split_name, wire_map


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
