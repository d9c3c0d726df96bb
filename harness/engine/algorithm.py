"""A master that is more than a list of operations, as the engine sees it."""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.engine.library import mirrors
from harness.engine.native import Engine
from harness.errors import HarnessError
from harness.system.plan import MovingWire

_POINTER, _INT, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


@mirrors("Line")
class Line(ctypes.Structure):
    """``Line`` of line.h."""

    _fields_ = (("input", _INT), *((name, _REAL) for name in ("mean", "end")))


def attach_lines(engine: Engine, wires: Sequence[MovingWire]) -> None:
    """Add a line for each of these connections to the engine."""
    lines = (Line * max(1, len(wires)))(*(Line(wire.input) for wire in wires))
    begins = np.searchsorted([wire.target for wire in wires], range(len(engine.plan.parts) + 1)).astype(np.int64)
    engine.data.lines, engine.data.lines_from = engine.keep_struct(lines), engine.keep(begins)


class Algorithm(ABC):
    """Data of a master in C, attached to an engine."""

    @abstractmethod
    def begin(self) -> None:
        """Begin a run at the start values of the plan; attach the data to the engine."""

    @abstractmethod
    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""

    def report(self) -> dict[str, str | float]:
        """Log warnings about the run that has ended, and return its attributes."""
        return {}

    def failure(self, number: int, time: float) -> HarnessError:
        """Return the error for a tick that has no solution."""
        return HarnessError(f"the master found no solution at t = {time:.12g} s; use a shorter step")
