"""What a master promises: its order, and what its tolerances leave."""

from __future__ import annotations

from typing import Final

from harness.system.assembly import Assembly
from harness.system.experiment import LOOP_TOLERANCE, Experiment

ROUNDING: Final = 1e-9
"""Relative error that rounding leaves in a long run."""


def order_of(experiment: Experiment) -> float:
    """Return the order with which the master converges at best."""
    return 2.0 if experiment.master in {"newton", "adaptive"} or experiment.extrapolation else 1.0


def noise_of(system: Assembly, experiment: Experiment) -> float:
    """Return the relative error that no shorter step reduces: of loops, of rounding, of solvers inside the parts."""
    loops = 10.0 * (experiment.loop_tolerance or LOOP_TOLERANCE) if order_of(experiment) > 1.0 else 0.0
    inside = [part.inner_tolerance(experiment.tolerance) for part in system.parts.values()]
    return max(ROUNDING, loops, *inside)
