"""Adaptive: ``newton`` with inner steps controlled by the coupling error; every communication point is met exactly.

Use it for motion with fast and slow phases.
"""

from harness.masters import Master
from harness.masters.newton import implicit
from harness.system.experiment import COUPLING_TOLERANCE, Experiment
from harness.system.plan import Plan, Schedule


def _schedule(plan: Plan, experiment: Experiment) -> Schedule:
    """Divide communication steps so that the coupling error stays below a share of the magnitude of each value."""
    # The energy error of a power bond (force error times mean velocity plus velocity error times mean force) is then
    # below twice this share, by default 1e-5, times the product of both magnitudes and the step. The inner steps follow
    # from a tolerance, to which their error is not quite proportional: it counts as of first order.
    return implicit(experiment, experiment.coupling_tolerance or COUPLING_TOLERANCE)


master = Master(_schedule, implicit=True, adapts=True, composed=True)
