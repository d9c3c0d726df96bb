"""Jacobi: steps all parts with the outputs from the beginning; ``extrapolation`` uses polynomials through earlier ones.

Use it for a comparison with other tools.
"""

from functools import partial
from typing import Any

import numpy as np

from harness.compiling.engine_library import bytes_of, mirror
from harness.engine.algorithm import Algorithm, attach_lines
from harness.engine.native import Engine
from harness.masters import Master
from harness.system.experiment import Experiment
from harness.system.plan import GET, SET, STEP, Plan, Schedule


def _schedule(plan: Plan, experiment: Experiment) -> Schedule:
    """Set all parts, then step all, then read all; the order of the parts does not matter."""
    # With extrapolation, inputs from continuous parts follow polynomials, see ``jacobi.h``.
    if experiment.extrapolation:
        return Schedule(algorithm=partial(Extrapolated, order=experiment.extrapolation))
    parts = range(len(plan.parts))
    return Schedule(tuple((operation, part) for operation in (SET, STEP, GET) for part in parts))


master = Master(_schedule, together=True, extrapolates=True)

Extrapolation = mirror("Extrapolation")


class Extrapolated(Algorithm):
    """The data of a master that extrapolates, attached to an engine."""

    def __init__(self, engine: Engine, order: int) -> None:
        self._engine, self._order = engine, order

    def begin(self) -> None:
        """Start a run without earlier values."""
        engine, wires = self._engine, self._engine.plan.moving_wires
        attach_lines(engine, wires)
        self.before, self.earlier = np.zeros(len(wires)), np.zeros(len(wires))
        self._data = Extrapolation(self._order, 0, engine.keep(self.before), engine.keep(self.earlier))
        engine.advance_by("extrapolated_tick", self._data)

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the data."""
        known = bytes_of(self._data)[8:16]
        return {"extrapolation known": known, "extrapolation": self.before, "extrapolation earlier": self.earlier}
