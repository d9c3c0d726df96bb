"""Connections whose values vary during a step, and their lines in the compiled engine."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from harness.engine.native import Engine, bytes_of, mirrors
from harness.system.plan import MovingWire

_POINTER, _INT, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


@mirrors("Line")
class Line(ctypes.Structure):
    """``Line`` of line.h."""

    _fields_ = (("input", _INT), *((name, _REAL) for name in ("mean", "end")))


@mirrors("Extrapolation")
class Extrapolation(ctypes.Structure):
    """``Extrapolation`` of extrapolate.h."""

    _fields_ = (*((name, _INT) for name in ("order", "known")), *((name, _POINTER) for name in ("before", "earlier")))


def attach_lines(engine: Engine, wires: Sequence[MovingWire]) -> None:
    """Add a line for each of these connections to the engine."""
    lines = (Line * max(1, len(wires)))(*(Line(wire.input) for wire in wires))
    begins = np.searchsorted([wire.target for wire in wires], range(len(engine.plan.parts) + 1)).astype(np.int64)
    engine.data.lines, engine.data.lines_from = engine.keep_struct(lines), engine.keep(begins)


class Extrapolated:
    """The data of a master that extrapolates, attached to an engine.

    Parameters
    ----------
    engine : Engine
        The engine that runs the master.
    order : int
        Order of the polynomials, 1 or 2.
    """

    def __init__(self, engine: Engine, order: int) -> None:
        """Store the engine and the order, which all runs share."""
        self._engine, self._order = engine, order

    def begin(self) -> None:
        """Start a run without earlier values."""
        engine, wires = self._engine, self._engine.plan.moving_wires
        attach_lines(engine, wires)
        self.before, self.earlier = np.zeros(len(wires)), np.zeros(len(wires))
        self._data = Extrapolation(self._order, 0, engine.keep(self.before), engine.keep(self.earlier))
        engine.data.extrapolation = ctypes.addressof(self._data)

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""
        known = bytes_of(self._data)[8:16]
        return {"extrapolation known": known, "extrapolation": self.before, "extrapolation earlier": self.earlier}
