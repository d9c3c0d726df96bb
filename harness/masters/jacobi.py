"""Jacobi: all parts are stepped with the outputs from the beginning of the step, then all outputs are exchanged."""

from __future__ import annotations

from harness.system.experiment import Experiment
from harness.system.plan import GET, SET, STEP, Plan, Schedule


def master(plan: Plan, experiment: Experiment) -> Schedule:
    """Set all parts, then step all, then read all; the order of the parts does not matter.

    With extrapolation, inputs from continuous parts follow polynomials, see ``engine/extrapolate.h``.
    """
    if experiment.extrapolation:
        return Schedule((), extrapolation=experiment.extrapolation)
    parts = range(len(plan.parts))
    return Schedule(tuple((operation, part) for operation in (SET, STEP, GET) for part in parts))
