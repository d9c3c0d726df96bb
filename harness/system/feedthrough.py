"""Direct feedthrough of FMUs that do not declare it, found by trial.

Many simple exporters declare no dependencies. According to FMI, every output then depends on every input, and every
loop of such FMUs would be algebraic. Few of these loops really are.
"""

import logging
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from harness.errors import HarnessError
from harness.parts.part import TYPE_ORDER, Part, Port, Values
from harness.system.assembly import Assembly, start_values
from harness.system.experiment import Experiment
from harness.system.graph import direct_edges, find_loop

_LOG = logging.getLogger("harness")

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
