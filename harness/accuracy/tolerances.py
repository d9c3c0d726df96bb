"""What a master promises: its order, and what its tolerances leave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from harness.system.assembly import Assembly
from harness.system.experiment import LOOP_TOLERANCE, Experiment

LOOP_SOLVERS: Final = frozenset({"newton", "adaptive"})
"""Masters that solve loops."""

ROUNDING: Final = 1e-9
"""Relative error that rounding leaves in a long run."""

OF_LOOPS: Final = 10.0
"""Relative error of a variable over the tolerance of the loops."""


@dataclass(frozen=True)
class Floor:
    """The relative error that no shorter step reduces."""

    error: float
    """Its size, relative to the range of a variable."""
    source: str
    """The setting or the part that leaves it: ``rounding``, ``loop_tolerance`` or ``tolerance of NAME``."""


def order_of(experiment: Experiment) -> float:
    """Return the order with which the master converges at best.

    The inner steps of adaptive follow from a tolerance, to which their error is not quite proportional: it counts as of
    first order.
    """
    return 2.0 if experiment.master == "newton" or experiment.extrapolation else 1.0


def has_lines(experiment: Experiment) -> bool:
    """Return whether the master passes values as lines instead of held values."""
    return experiment.master in LOOP_SOLVERS or experiment.extrapolation > 0


def floor_of(system: Assembly, experiment: Experiment) -> Floor:
    """Return the error that loops, rounding and solvers inside the parts leave, whichever is largest."""
    found = [Floor(ROUNDING, "rounding")]
    if experiment.master in LOOP_SOLVERS:
        found.append(Floor(OF_LOOPS * (experiment.loop_tolerance or LOOP_TOLERANCE), "loop_tolerance"))
    for name, part in system.parts.items():
        found.append(Floor(part.inner_tolerance(experiment.tolerance), f"tolerance of {name}"))
    return max(found, key=lambda floor: floor.error)
