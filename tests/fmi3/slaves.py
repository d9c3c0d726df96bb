"""FMUs of FMI 3.0 called through fmpy."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Model, FMU3Slave
from shell.selection import built


@cache
def three(name: str, full: bool = True) -> Path:
    """The FMU of a block, or of a system of examples/, in FMI 3.0; a block with arrays and clocks if it is `full`."""
    return built(name, mkdtemp(prefix="fmi3-"), fmi=3, full=full)


class Slave(FMU3Slave):  # type: ignore[misc]
    """An instance for co-simulation, with its variables by name and its messages."""

    kind = "coSimulation"

    def __init__(self, path: Path, **options: Any) -> None:
        """Load and instantiate it."""
        self.description = fmpy.read_model_description(str(path))
        self.folder = Path(fmpy.extract(str(path)))
        super().__init__(
            guid=self.description.guid,
            unzipDirectory=str(self.folder),
            modelIdentifier=getattr(self.description, self.kind).modelIdentifier,
            instanceName="one",
        )
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.messages: list[str] = []
        self.instantiate(loggingOn=True, logMessage=self._keep, **options)

    def _keep(self, environment: object, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode())

    def __enter__(self) -> Slave:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the instance."""
        self.freeInstance()

    def reference(self, name: str) -> int:
        """Value reference of a variable."""
        return int(self.variables[name].valueReference)

    def get(self, name: str, size: int = 1) -> list[float]:
        """All elements of a variable of type Float64."""
        return list(self.getFloat64([self.reference(name)], nValues=size))

    def set(self, name: str, *values: float) -> None:
        """Set all elements of a variable of type Float64."""
        self.setFloat64([self.reference(name)], list(values))

    def initialise(self, **values: float) -> None:
        """Go through initialization mode, in which scalars are set."""
        self.enterInitializationMode()
        for name, value in values.items():
            self.set(name, value)
        self.exitInitializationMode()

    def refuses(self, call: Callable[[], object], word: str) -> None:
        """Insist that the call fails with a message, and changes nothing."""
        state = self.getFMUState()
        before = self.serializeFMUState(state)
        self.messages.clear()
        try:
            call()
        except fmpy.fmi1.FMICallException as error:
            assert error.status in (2, 3)
        else:
            raise AssertionError("the call was accepted")
        assert len(self.messages) == 1
        assert word in self.messages[0], self.messages
        self.fmi3GetFMUState(self.component, state)
        assert self.serializeFMUState(state) == before
        self.freeFMUState(state)


class Model(Slave, FMU3Model):  # type: ignore[misc]
    """An instance for model exchange."""

    kind = "modelExchange"
    instantiate = FMU3Model.instantiate


def check_adjoint(name: str) -> None:
    """For all outputs and inputs of type Float64 at once: w (J s) = (w J) s, each column by itself."""
    with Slave(three(name)) as one:
        real = [v for v in one.description.modelVariables if v.type == "Float64" and not v.dimensions]
        unknowns = [v.valueReference for v in real if v.causality == "output"]
        knowns = [v.valueReference for v in real if v.causality == "input"]
        one.initialise()
        for v in real:
            if v.causality == "input":
                one.set(v.name, 0.3e-3 + (1.0 if v.name == "Fn" else 0.0))
        draw = np.random.default_rng(1)
        weights = draw.uniform(-1.0, 1.0, len(unknowns))
        jacobian = np.array([one.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]).reshape(
            len(knowns), len(unknowns)
        )
        adjoint = one.getAdjointDerivative(unknowns, knowns, weights, nSensitivity=len(knowns))
        expected = jacobian @ weights
        assert adjoint == pytest.approx(expected, rel=1e-12, abs=1e-12 * (np.abs(jacobian).max(initial=0.0) + 1e-300))
