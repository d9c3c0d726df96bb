"""Curves of a block, and the bench that runs its binary to compute them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import INPUT, OUTPUT, REAL, STATE_OUTPUT, BlockVariable, BlockVariables
from harness.parts.fmu import FmuPart

Vector = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Curve:
    """A line in a panel."""

    x: Vector
    y: Vector
    """Points in the units of the panel."""
    label: str = ""  # label, if the panel has several curves; else empty
    aside: bool = False  # whether the curve is an input of the block, shown for comparison
    detail: bool = False  # whether the icon omits the curve


@dataclass(frozen=True)
class Panel:
    """A plot with its curves, axes and caption."""

    curves: tuple[Curve, ...]  # at least one
    x: tuple[str, str]
    y: tuple[str, str]
    """Name and unit of each axis."""
    caption: str  # description of the experiment, for the documentation
    equal: bool = False  # whether both axes have the same scale


class Bench:
    """Test bench that runs a compiled block with its start values.

    Attributes
    ----------
    values : mapping of str to float
        Parameters that differ from the start values.
    """

    def __init__(self, block: Block, description: BlockVariables, part: FmuPart) -> None:
        """Sort the variables."""
        self.block = block
        self._part = part
        self.kind: Callable[..., BenchRun] = BenchRun
        self.values: Mapping[str, float] = {}
        self.variables: dict[str, BlockVariable] = {v.name: v for v in description.variables}
        inputs = sorted((v for v in description.variables if v.role == INPUT), key=lambda v: v.type)
        self._starts = {v.name: v.start for v in inputs}
        self.inputs = tuple(v.name for v in description.variables if v.role == INPUT and v.type == REAL)
        self.outputs = tuple(
            v.name for v in description.variables if v.role in (OUTPUT, STATE_OUTPUT) and v.type == REAL
        )

    def has(self, *names: str) -> bool:
        """Return whether these are all inputs or outputs."""
        return set(names) <= {*self.inputs, *self.outputs}

    def start(self, name: str, otherwise: float) -> float:
        """Return the value of a parameter at the start, if it exists and is positive."""
        value = self.values.get(name, self.variables[name].start) if name in self.variables else otherwise
        return value if value > 0.0 else otherwise

    def axis(self, name: str) -> tuple[str, str]:
        """Return name and unit of a variable for the axis of a panel."""
        return name, self.variables[name].unit

    @contextmanager
    def session(self, outputs: Sequence[str], start: float = 0.0) -> Iterator[BenchRun]:
        """Open a run of a new instance, step by step."""
        self._part.enter_initialisation(start, math.inf, None, self.values)
        try:
            yield self.kind(self._part, self._starts, outputs)
        finally:
            self._part.terminate()

    def run(self, times: Vector, inputs: Mapping[str, Vector], outputs: Sequence[str]) -> tuple[Vector, ...]:
        """Step from each time to the next."""
        rows = [dict(zip(inputs, row, strict=True)) for row in zip(*inputs.values(), strict=True)] or [{}] * times.size
        with self.session(outputs, float(times[0])) as session:
            session.begin(rows[0])
            values = [session.values()]
            for row, (begin, end) in zip(rows, pairwise(times), strict=False):
                session.put(row)
                values.append(session.step(float(begin), float(end - begin)))
        return tuple(np.array(values).T)


class BenchRun:
    """A run of one instance. Inputs that the block does not have are ignored."""

    def __init__(self, part: FmuPart, starts: Mapping[str, float], outputs: Sequence[str]) -> None:
        """Bind the inputs, which have start values, and the outputs."""
        self._part = part
        self._places = {name: place for place, name in enumerate(starts)}
        self._inputs, self._outputs = np.array([*starts.values()], dtype=float), np.zeros(len(outputs))
        self._calls = part.bind([*starts], outputs, self._inputs, self._outputs)

    def begin(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs and leave initialization mode."""
        self.put(inputs)
        self._part.exit_initialisation()

    def put(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs; a Boolean is true if its value is not zero."""
        for name, value in inputs.items():
            if name in self._places:
                self._inputs[self._places[name]] = value
        self._calls.set()

    def step(self, time: float, length: float) -> list[float]:
        """Perform one communication step and return the outputs after it."""
        self._calls.step(time, length)
        return self.values()

    def values(self) -> list[float]:
        """Return the current outputs."""
        self._calls.get()
        return list(map(float, self._outputs))
