"""Connections: the energy that a force and a velocity transfer, and how much of each value the coupling misses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from harness.accuracy.convergence import converge
from harness.accuracy.estimate import NOTHING, REMEMBERED, Track, size_of
from harness.engine.defect import are_power, unit_of
from harness.parts.part import Part, Values
from harness.system.layout import find_port
from harness.system.wire import Wire, wire_map


@dataclass(frozen=True)
class Energy:
    """Energy that a pair of connections transfers over a run."""

    pair: tuple[Wire, Wire]
    """The connection of the force and that of the velocity, in opposite directions between two parts."""
    net: float
    passed: float
    """Integral of the power and of its magnitude [J]."""
    error: float
    """Bound of the error of the net energy at any time [J]."""

    @property
    def relative(self) -> float:
        """Error over the energy passed on."""
        return self.error / self.passed if self.passed > 0.0 else 0.0


def power_pairs(parts: Mapping[str, Part], wires: Sequence[Wire]) -> list[tuple[Wire, Wire]]:
    """Return the pairs of opposite connections between two parts whose values multiply to a power."""
    found = []
    for force in wires:
        for speed in wires:
            (source, _), (target, _) = force.ends
            if [speed.ends[0][0], speed.ends[1][0]] == [target, source] and are_power(
                *(find_port(parts, wire.source, "connection") for wire in (force, speed))
            ):
                found.append((force, speed))
    return found


def energy(
    parts: Mapping[str, Part],
    pair: tuple[Wire, Wire],
    forces: Sequence[Track],
    speeds: Sequence[Track],
    most: float,
    noise: float,
) -> Energy:
    """Return the energy that a pair transfers, with its error."""
    wire = pair[0]
    ports = [find_port(parts, name, "connection") for name in (wire.source, wire.target, pair[1].source)]
    gain, offset = wire_map(wire, ports[0], ports[1])
    units = [unit_of(port) for port in ports]
    scale = math.prod(unit.factor for unit in units[1:] if unit is not None)
    works: list[Track] = []
    passed = rows = 0.0
    for force, speed in zip(forces, speeds, strict=True):
        power = (scale * gain) * force.values
        power += scale * offset
        power *= speed.values
        work = _integral(force.row, power)
        if not works:
            rows = float(np.max(np.abs(_integral(2.0 * force.row, power[::2]) - work[::2])))  # of the integral itself
            passed = float(_integral(force.row, np.abs(power, out=power))[-1])
        works.append(replace(force, values=work))
    own = works[0]
    near, *further = (np.abs(np.subtract(*a.together(b)[1:])) for a, b in pairwise(works))
    far = further[0] if further else None
    how = converge(near, far, most, passed, noise * passed, finer=works[1].ratio < 1)
    largest = max(float(np.max(each)) for each in (near, *further))
    bound = how.factor * max(float(np.max(near)), REMEMBERED * largest) if how.resolved else 3.0 * largest
    return Energy(pair, float(own.values[-1]), passed, bound + rows)


def missed(track: Track, lines: bool, nominal: float) -> float:
    """Return how much of a value a connection misses between rows, over the range of the value (rms).

    A held value misses what changes within a step, a value on a line what it is bent.
    """
    change = np.diff(track.values, 2 if lines else 1)
    size = max(size_of(track.values), NOTHING * nominal)
    return math.sqrt(np.mean(np.square(change, out=change))) / size if size > 0.0 and len(change) else 0.0


def _integral(row: float, values: Values) -> Values:
    """Return the integral up to each row, where rows are ``row`` seconds apart."""
    found = np.zeros(len(values))
    np.add(values[1:], values[:-1], out=found[1:])
    found *= 0.5 * row
    return np.cumsum(found, out=found)
