"""Newton: the values inside a loop of continuous parts are those at the end of the step, found by iteration.

The coupling is that of the generalised-alpha method, of second order and damping what is stiff against the step, see
``engine/newton.h``. Sampled parts take their sample first; what drives a loop is stepped before it, once, and what
reads it after it.
"""

from __future__ import annotations

from harness.system.experiment import LOOP_TOLERANCE, Experiment
from harness.system.plan import Plan, Schedule


def master(plan: Plan, experiment: Experiment) -> Schedule:
    """Solve every loop once for every tick, in shorter inner steps where the guard finds that this is not enough."""
    return Schedule((), tolerance=experiment.loop_tolerance or LOOP_TOLERANCE)
