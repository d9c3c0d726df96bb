"""Newton: an implicit master that iterates on the values in loops of continuous parts.

The coupling is the generalised-alpha method, which is of second order and damps components that are too stiff for the
step, see ``engine/newton.h``. Sampled parts take their sample first. Parts that drive a loop are stepped once before
it; parts that read from it are stepped after it.
"""

from __future__ import annotations

from harness.system.experiment import LOOP_TOLERANCE, Experiment
from harness.system.plan import Plan, Schedule


def master(plan: Plan, experiment: Experiment) -> Schedule:
    """Solve every loop once per communication step, or in shorter inner steps where the step check requires it."""
    return Schedule((), tolerance=experiment.loop_tolerance or LOOP_TOLERANCE)
