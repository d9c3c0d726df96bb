"""Wires whose values move during a step, and their lines in the compiled engine."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.engine.native import Engine, bytes_of, mirrors
from harness.system.plan import GET, SET, Plan, Schedule

_POINTER, _INT, _REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


@dataclass(frozen=True)
class MovingWire:
    """A wire whose value moves during a step: from one continuous part to another one, both stepped at every tick.

    Parameters
    ----------
    input, output : int
        Signals at its ends.
    source, target : int
        Parts at its ends.
    """

    input: int
    output: int
    source: int
    target: int


@mirrors("Line")
class Line(ctypes.Structure):
    """``Line`` of line.h."""

    _fields_ = (("input", _INT), *((name, _REAL) for name in ("mean", "end")))


@mirrors("Extrapolation")
class Extrapolation(ctypes.Structure):
    """``Extrapolation`` of extrapolate.h."""

    _fields_ = (*((name, _INT) for name in ("order", "known")), *((name, _POINTER) for name in ("before", "earlier")))


def owners(plan: Plan) -> dict[int, int]:
    """The part that each exchanged output belongs to."""
    return {signal: part for part in range(len(plan.parts)) for signal in range(*plan.outputs[part])}


def moves(plan: Plan, part: int) -> bool:
    """Whether the outputs of a part change continuously from tick to tick."""
    return plan.parts[part].moves


def moving_wires(plan: Plan) -> list[MovingWire]:
    """Return the wires of Reals that are not held, between continuous parts stepped at every tick, part by part."""
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
    """For every wired input whether the output is already that of the end of the step when it is handed over."""
    owner = owners(plan)
    place = {operation: index for index, operation in enumerate(schedule.operations)}
    moving = {wire.input for wire in moving_wires(plan)}

    def rank(part: int) -> tuple[int, int]:  # of an implicit master: sampled, continuous, slow parts
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
    """Give the engine a line for each of these wires."""
    lines = (Line * max(1, len(wires)))(*(Line(wire.input) for wire in wires))
    begins = np.searchsorted([wire.target for wire in wires], range(len(engine.plan.parts) + 1)).astype(np.int64)
    engine.data.lines, engine.data.lines_from = engine.keep_struct(lines), engine.keep(begins)


class Extrapolated:
    """The data of a master that extrapolates, attached to an engine.

    Parameters
    ----------
    engine : Engine
        The engine that will run it.
    order : int
        Of the polynomials, 1 or 2.
    """

    def __init__(self, engine: Engine, order: int) -> None:
        """Lay it out."""
        wires = moving_wires(engine.plan)
        attach_lines(engine, wires)
        self.before, self.earlier = np.zeros(len(wires)), np.zeros(len(wires))
        self._data = Extrapolation(order, 0, engine.keep(self.before), engine.keep(self.earlier))
        engine.data.extrapolation = ctypes.addressof(self._data)

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """What it remembers from step to step, for a checkpoint: views of the data."""
        known = bytes_of(self._data)[8:16]
        return {"extrapolation known": known, "extrapolation": self.before, "extrapolation earlier": self.earlier}
