"""Connections whose values vary during a step, and their lines in the compiled engine."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np

from harness.engine.library import mirrors
from harness.engine.native import Engine
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
