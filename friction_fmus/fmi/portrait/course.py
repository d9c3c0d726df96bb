"""Curves of a block, and the bench that runs its binary for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from numpy.typing import NDArray

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import BOOLEAN, INPUT, OUTPUT, REAL, STATE_OUTPUT, Description, Variable

Vector = NDArray[np.floating[Any]]

SILENT = fmi2CallbackFunctions(
    logger=fmi2CallbackLoggerTYPE(lambda *_: None),
    allocateMemory=defaultCallbacks.allocateMemory,
    freeMemory=defaultCallbacks.freeMemory,
)
"""Callbacks of a run that may be refused: then there is no picture, and nobody wants to read of it."""


@dataclass(frozen=True)
class Curve:
    """A line in a panel.

    Attributes
    ----------
    x, y : array, shape (n,)
        Its points, in the units of the panel.
    label : str
        What it is, for a panel with several; empty for the only one.
    aside : bool
        Whether it is there for comparison: what goes into the block.
    detail : bool
        Whether it is left out of the icon.
    """

    x: Vector
    y: Vector
    label: str = ""
    aside: bool = False
    detail: bool = False


@dataclass(frozen=True)
class Panel:
    """A plot: its curves, its axes and a sentence that says what they are.

    Attributes
    ----------
    curves : tuple of Curve
        At least one.
    x, y : tuple of str
        Name and unit of each axis.
    caption : str
        What was done to the block, for the documentation.
    equal : bool
        Whether both axes have one scale.
    """

    curves: tuple[Curve, ...]
    x: tuple[str, str]
    y: tuple[str, str]
    caption: str
    equal: bool = False


class Bench:
    """Runs a compiled block with its start values.

    Parameters
    ----------
    block : Block
        Which one.
    description : Description
        Read from its binary.
    folder : Path
        Unzipped FMU with a binary for this platform.
    """

    def __init__(self, block: Block, description: Description, folder: Path) -> None:
        """Sort the variables."""
        self._block = block
        self.portrait = block.about.portrait
        self._description = description
        self._folder = folder
        self.variables: dict[str, Variable] = {v.name: v for v in description.variables}
        self.inputs = tuple(v.name for v in description.variables if v.role == INPUT and v.type == REAL)
        self.outputs = tuple(
            v.name for v in description.variables if v.role in (OUTPUT, STATE_OUTPUT) and v.type == REAL
        )

    def has(self, *names: str) -> bool:
        """Whether these are all inputs or outputs."""
        return set(names) <= {*self.inputs, *self.outputs}

    def start(self, name: str, otherwise: float) -> float:
        """Start value of a parameter, if there is one and it is positive."""
        value = self.variables[name].start if name in self.variables else otherwise
        return value if value > 0.0 else otherwise

    def axis(self, name: str) -> tuple[str, str]:
        """Name and unit of a variable, as a panel takes them."""
        return name, self.variables[name].unit

    @contextmanager
    def session(self, outputs: Sequence[str], start: float = 0.0) -> Iterator[Session]:
        """A run step by step, of an instance of its own.

        Raises
        ------
        FMICallException
            If the block refuses its start values.
        """
        fmu = FMU2Slave(
            guid=self._description.guid,
            unzipDirectory=str(self._folder),
            modelIdentifier=self._block.name,
            instanceName=self._block.name,
        )
        fmu.instantiate(callbacks=SILENT)
        try:
            fmu.setupExperiment(startTime=start)
            fmu.enterInitializationMode()
            yield Session(fmu, self.variables, outputs)
        finally:
            fmu.freeInstance()

    def run(self, times: Vector, inputs: Mapping[str, Vector], outputs: Sequence[str]) -> tuple[Vector, ...]:
        """Steps from each time to the next.

        Parameters
        ----------
        times : array, shape (n,)
            Increasing, in s.
        inputs : mapping of str to array, shape (n,)
            Value of each input from a time to the next; names that the block lacks are left out.
        outputs : sequence of str
            What to record.

        Returns
        -------
        tuple of array, shape (n,)
            Each output at the times.

        Raises
        ------
        FMICallException
            If the block refuses its start values or a step.
        """
        rows = [dict(zip(inputs, row, strict=True)) for row in zip(*inputs.values(), strict=True)] or [{}] * times.size
        with self.session(outputs, float(times[0])) as session:
            session.begin(rows[0])
            values = [session.values()]
            for row, (begin, end) in zip(rows, pairwise(times), strict=False):
                session.put(row)
                values.append(session.step(float(begin), float(end - begin)))
        return tuple(np.array(values).T)


class Session:
    """An instance in initialization mode, then stepped. Inputs that the block lacks are left out.

    Parameters
    ----------
    fmu : FMU2Slave
        The instance.
    variables : mapping of str to Variable
        Of the block, by name.
    outputs : sequence of str
        What `step` and `values` return.
    """

    def __init__(self, fmu: FMU2Slave, variables: Mapping[str, Variable], outputs: Sequence[str]) -> None:
        """Find the value references."""
        self._fmu = fmu
        self._inputs = {name: v for name, v in variables.items() if v.role == INPUT}
        self._outputs = [variables[name].reference for name in outputs]

    def begin(self, inputs: Mapping[str, float]) -> None:
        """Ends the initialization with these inputs."""
        self.put(inputs)
        self._fmu.exitInitializationMode()

    def put(self, inputs: Mapping[str, float]) -> None:
        """Sets inputs; those that are Boolean are true if not zero."""
        given = [(self._inputs[name], value) for name, value in inputs.items() if name in self._inputs]
        for type_, write, converted in ((REAL, self._fmu.setReal, float), (BOOLEAN, self._fmu.setBoolean, bool)):
            chosen = {v.reference: converted(value) for v, value in given if v.type == type_}
            if chosen:
                write(list(chosen), list(chosen.values()))

    def step(self, time: float, length: float) -> list[float]:
        """One communication step, and the outputs behind it."""
        self._fmu.doStep(time, length)
        return self.values()

    def values(self) -> list[float]:
        """The outputs as they are."""
        return list(self._fmu.getReal(self._outputs))
