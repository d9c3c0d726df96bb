"""Connections whose values vary during a step, and their lines in the compiled engine."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.engine.native import Engine, bytes_of
from harness.system.plan import GET, SET, Plan, Schedule

_POINTER, _INT, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


@dataclass(frozen=True)
class MovingWire:
    """A connection whose value varies during a step: between two continuous parts that are both stepped at every tick.

    Parameters
    ----------
    input, output : int
        Indices of the signals at its ends.
    source, target : int
        Indices of the parts at its ends.
    """

    input: int
    output: int
    source: int
    target: int


class Line(ctypes.Structure):
    """``Line`` of line.h."""

    _fields_ = (("input", _INT), *((name, _REAL) for name in ("mean", "end")))


class Extrapolation(ctypes.Structure):
    """``Extrapolation`` of extrapolate.h."""

    _fields_ = (*((name, _INT) for name in ("order", "known")), *((name, _POINTER) for name in ("before", "earlier")))


def owners(plan: Plan) -> dict[int, int]:
    """Return the part of each exchanged output."""
    return {signal: part for part in range(len(plan.parts)) for signal in range(*plan.outputs[part])}


def moves(plan: Plan, part: int) -> bool:
    """Return whether the outputs of a part vary continuously from tick to tick."""
    return plan.parts[part].moves


def moving_wires(plan: Plan) -> list[MovingWire]:
    """Return the Real connections between continuous parts stepped at every tick, part by part."""
    owner = owners(plan)
    names = list(plan.ports)
    wires = []
    for target in range(len(plan.parts)):
        for signal in range(*(int(index) for index in plan.inputs[target])):
            output = int(plan.sources[signal])
            source = owner[output]
            real = plan.ports[names[signal]].type == "Real" and not plan.ports[names[output]].held
            if real and moves(plan, source) and moves(plan, target):
                wires.append(MovingWire(signal, output, source, target))
    return wires


def fresh_inputs(plan: Plan, schedule: Schedule) -> dict[int, bool]:
    """Return for each connected input whether it gets its source's value from the end of the step."""
    owner = owners(plan)
    place = {operation: index for index, operation in enumerate(schedule.operations)}
    moving = {wire.input for wire in moving_wires(plan)}

    def rank(part: int) -> tuple[int, int]:  # implicit master: sampled, continuous, slow parts
        return (0 if plan.parts[part].sampled else 1 if moves(plan, part) else 2), part

    found = {}
    for target in range(len(plan.parts)):
        for signal in range(*plan.inputs[target]):
            source = owner[int(plan.sources[signal])]
            if schedule.operations:
                found[signal] = place[GET, source] < place[SET, target]
            else:
                found[signal] = not schedule.extrapolation and (signal in moving or rank(source) < rank(target))
    return found


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
        """Allocate the arrays."""
        wires = moving_wires(engine.plan)
        attach_lines(engine, wires)
        self.before, self.earlier = np.zeros(len(wires)), np.zeros(len(wires))
        self._data = Extrapolation(order, 0, engine.keep(self.before), engine.keep(self.earlier))
        engine.data.extrapolation = ctypes.addressof(self._data)

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""
        known = bytes_of(self._data)[8:16]
        return {"extrapolation known": known, "extrapolation": self.before, "extrapolation earlier": self.earlier}
