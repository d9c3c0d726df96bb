"""Dependencies of the outputs and derivatives of a composite FMU, through the connections of its parts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from harness.composite.interface import Variable, states
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.system.assembly import Assembly
from harness.system.graph import instantaneous
from harness.system.wire import Wire, split_name


def step_dependencies(system: Assembly, variables: Sequence[Variable]) -> dict[str, list[int]]:
    """Return for each output and derivative the indices of the inputs and states on which it depends directly.

    States count if the FMU is for model exchange too.
    """
    inside = [wire for wire in system.wires if wire.ends[0][0] in system.parts]
    outside = [wire for wire in system.wires if wire not in inside and not wire.delay]
    prompt = [wire for wire in outside if not system.parts[wire.ends[1][0]].sampled]
    drivers = _drivers([*instantaneous(system.parts, inside), *prompt])
    held = {v.state for v in variables if v.state}
    knowns = {v.inner: i for i, v in enumerate(variables, start=1) if v.causality == "input" or v.name in held}
    stated = {name: _direct(part, exchanges=bool(held)) for name, part in system.parts.items()}

    def direct(name: str) -> Iterable[str]:
        owner, own = split_name(name)
        return (f"{owner}.{port}" for port in stated.get(owner, {}).get(own, ()))

    return {
        v.name: sorted(knowns[name] for name in _reached(v.inner, direct, drivers) if name in knowns)
        for v in variables
        if v.causality == "output" or v.state
    }


def _direct(part: Part, *, exchanges: bool) -> Mapping[str, Iterable[str]]:
    """Return the inputs on which each output depends, and for model exchange also the states, and the derivatives."""
    if part.sampled:
        return {}
    if not exchanges or not isinstance(part, FmuPart):
        return part.dependencies
    description = part.archive.description
    everything = [port.name for port in part.inputs] + list(states(part).values())
    return {
        unknown.variable.name: everything if unknown.dependencies is None else [v.name for v in unknown.dependencies]
        for unknown in (*description.outputs, *description.derivatives)
    }


def start_dependencies(system: Assembly, variables: Sequence[Variable]) -> dict[str, list[int] | None]:
    """Return for each calculated variable the indices of those on which its start value depends; None: on all."""
    drivers = _drivers(system.wires)
    knowns = {v.inner: i for i, v in enumerate(variables, start=1) if v.causality == "input" or v.initial == "exact"}
    stated = {name: _stated(part) for name, part in system.parts.items() if isinstance(part, FmuPart)}
    if any(found is None for found in stated.values()):
        return {v.name: None for v in variables}

    def direct(name: str) -> Iterable[str]:
        owner, own = split_name(name)
        return (f"{owner}.{port}" for port in (stated.get(owner) or {}).get(own, ()))

    return {
        v.name: sorted(knowns[name] for name in _reached(v.inner, direct, drivers) if name in knowns)
        for v in variables
        if v.initial == "calculated"
    }


def _stated(part: FmuPart) -> dict[str, list[str]] | None:
    """Return the initial dependencies that an FMU declares; None if it does not declare all of them."""
    unknowns = part.archive.description.initialUnknowns
    if any(unknown.dependencies is None for unknown in unknowns):
        return None
    return {unknown.variable.name: [known.name for known in unknown.dependencies] for unknown in unknowns}


def _drivers(wires: Iterable[Wire]) -> Mapping[str, str]:
    return {wire.target: wire.source for wire in wires}


def _reached(output: str, direct: Callable[[str], Iterable[str]], drivers: Mapping[str, str]) -> set[str]:
    """Return all variables on which an output depends: directly, or through connections."""
    found: set[str] = set()
    pending = [output]
    while pending:
        for name in direct(pending.pop()):
            if name not in found:
                found.add(name)
                if name in drivers:
                    found.add(drivers[name])  # an input of the FMU, or an output of a part
                    pending.append(drivers[name])
    return found
