"""How far an explicit master can be trusted: what its held values miss, wire by wire and pair by pair."""

from __future__ import annotations

import ctypes
import logging
import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from harness.engine.native import Engine, bytes_of, mirrors
from harness.parts.part import Port
from harness.system.plan import MovingWire, Schedule, map_of
from harness.units import parse_unit

_LOG = logging.getLogger("harness")
_INT, _REAL = ctypes.c_int64, ctypes.c_double

LASTING: Final = 0.05
"""Defect over value, of the root mean squares, that lasts from step to step. Mass and LuGre friction with steps of
10 to 100 % of the stability limit have 0.0005 to 0.02, above the limit 0.1 to 0.8."""

ALTERNATING: Final = 2e-3
"""Part of the values, of the means, that alternates in sign from step to step: 1e-9 to 8e-4 and 5e-3 to 0.4."""

FEEDING: Final = 0.08
"""Share of the windows of 2000 steps in which the coupling feeds more than friction takes: 0 for Gauss-Seidel, 0.1 and
more for Jacobi where a mass on a contact without damping (GMS) breaks away too early."""

MADE: Final = 0.05
"""Energy that the coupling makes over the energy that passes."""

UNRESOLVED: Final = 0.05
"""Sum of the errors that remained in a solved loop over the size of the value: 1e-9 to 0.03 in runs that are right, 0.3
and more in others."""

WRONG: Final = "the result is wrong"
"""In every warning of a run that is not to be trusted."""


def inaccurate(attributes: Mapping[str, object]) -> bool:
    """Return whether the attributes of a result are those of a run that was reported as wrong."""
    limits = {"lasting_defect": LASTING, "alternating_defect": ALTERNATING, "energy_defect": MADE, "feeding": FEEDING}
    limits["unresolved_error"] = UNRESOLVED
    return any(float(str(attributes.get(name, 0.0))) > limit for name, limit in limits.items())


@mirrors("Defect")
class Defect(ctypes.Structure):
    """``Defect`` of engine.h."""

    _fields_ = (
        ("input", _INT),
        *((name, _REAL) for name in ("before", "flips", "squares", "value", "mean", "values", "value_squares")),
    )


@mirrors("Pair")
class Pair(ctypes.Structure):
    """``Pair`` of engine.h."""

    _fields_ = (
        *((name, _INT) for name in ("force", "velocity")),
        *((name, _REAL) for name in ("made", "passed", "fed", "net", "flow")),
        *((name, _INT) for name in ("ticks", "windows", "unstable")),
    )


class Coupling:
    """Measures the coupling defects of an explicit master.

    Parameters
    ----------
    engine : Engine
        The engine that will run it.
    schedule : Schedule
        What the master does.
    """

    def __init__(self, engine: Engine, schedule: Schedule) -> None:
        """Find the wires that hand over old values, and the force-velocity pairs."""
        plan = engine.plan
        self.plan = plan
        self._engine = engine
        self.wires = list(plan.moving_wires)
        paired = {number for pair in self._find_pairs() for number in pair}
        fresh = plan.fresh_inputs(schedule)
        self.wires = [wire for number, wire in enumerate(self.wires) if number in paired or not fresh[wire.input]]
        self._pairs = self._find_pairs()

    def begin(self) -> None:
        """Begin a run with nothing measured."""
        plan, pairs = self.plan, self._pairs
        start = [
            map_of(float(plan.gains[wire.input]), float(plan.offsets[wire.input]), float(plan.signals[wire.output]))
            for wire in self.wires
        ]
        self._defects = (Defect * len(self.wires))(
            *(Defect(wire.input, value=value) for wire, value in zip(self.wires, start, strict=True))
        )
        self._pair_data = (Pair * len(pairs))(*(Pair(force, velocity) for force, velocity in pairs))
        data = self._engine.data
        data.defects, data.defect_count = ctypes.addressof(self._defects), len(self.wires)
        data.pairs, data.pair_count = ctypes.addressof(self._pair_data), len(pairs)

    def report(self) -> dict[str, str | float]:
        """Warn of the wires whose values cannot be trusted.

        Returns
        -------
        dict
            The largest of each measure, for the attributes of the result.
        """
        worst = {"lasting_defect": 0.0, "alternating_defect": 0.0, "energy_defect": 0.0, "feeding": 0.0}
        for wire, defect in zip(self.wires, self._defects, strict=True):
            lasting = math.sqrt(defect.squares / defect.value_squares) if defect.value_squares > 0.0 else 0.0
            alternating = defect.flips / defect.values if defect.values > 0.0 else 0.0
            worst["lasting_defect"] = max(worst["lasting_defect"], lasting)
            worst["alternating_defect"] = max(worst["alternating_defect"], alternating)
            if lasting > LASTING or alternating > ALTERNATING:
                _LOG.warning(
                    "%s was handed over with an error of %.2g of its size that lasts and of %.2g that alternates from "
                    "step to step: the result is wrong; use the master newton or a shorter step",
                    self._shown(wire),
                    lasting,
                    alternating,
                )
        for pair in self._pair_data:
            passed = pair.passed + pair.flow
            made = pair.made / passed if passed > 0.0 else 0.0
            worst["energy_defect"] = max(worst["energy_defect"], made)
            fed = pair.unstable / pair.windows if pair.windows else 0.0
            worst["feeding"] = max(worst["feeding"], fed)
            if made > MADE:
                _LOG.warning(
                    "the wires %s and %s make %.2g of the energy that passes through them: the result is wrong; use "
                    "the master newton or a shorter step",
                    self._shown(self.wires[pair.force]),
                    self._shown(self.wires[pair.velocity]),
                    made,
                )
            if fed > FEEDING:
                _LOG.warning(
                    "the wires %s and %s feed an oscillation that nothing damps in %.2g of the time: it grows and the "
                    "result is wrong; use the master newton or gauss-seidel",
                    self._shown(self.wires[pair.force]),
                    self._shown(self.wires[pair.velocity]),
                    fed,
                )
        return dict(worst)

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """What has been measured, for a checkpoint: views of the data, all but the places in other tables."""
        defects = bytes_of(self._defects).reshape(-1, ctypes.sizeof(Defect))
        pairs = bytes_of(self._pair_data).reshape(-1, ctypes.sizeof(Pair))
        return {"defects": defects[:, 8:], "pairs": pairs[:, Pair.made.offset :]}

    def _shown(self, wire: MovingWire) -> str:
        return f"{self.plan.names[wire.output]} -> {self.plan.names[wire.input]}"

    def _find_pairs(self) -> list[tuple[int, int]]:
        """Wires in opposite directions between two parts whose units make a power."""
        found = []
        for i, force in enumerate(self.wires):
            for k, velocity in enumerate(self.wires):
                if (force.source, force.target) != (velocity.target, velocity.source):
                    continue
                if [_exponents(self.plan.ports[self.plan.names[wire.output]]) for wire in (force, velocity)] in _POWER:
                    found.append((i, k))
        return found


def _exponents(port: Port) -> tuple[int, ...] | None:
    unit = port.base or parse_unit(port.unit or "")
    return unit.exponents if unit else None


_POWER = [
    [_exponents(Port("", force)), _exponents(Port("", speed))] for force, speed in (("N", "m/s"), ("N.m", "rad/s"))
]
