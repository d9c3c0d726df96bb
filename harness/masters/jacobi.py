"""Jacobi: every part steps on the outputs of the beginning of the step, then all outputs are exchanged."""

from __future__ import annotations

from harness.system.experiment import Experiment
from harness.system.plan import GET, SET, STEP, Plan, Schedule


def master(plan: Plan, experiment: Experiment) -> Schedule:
    """All parts set, then all stepped, then all read; the order of the parts does not matter.

    With an extrapolation the inputs from continuous parts are polynomials instead, see ``engine/extrapolate.h``.
    """
    if experiment.extrapolation:
        return Schedule((), extrapolation=experiment.extrapolation)
    parts = range(len(plan.parts))
    return Schedule(tuple((operation, part) for operation in (SET, STEP, GET) for part in parts))
