"""Gauss-Seidel: parts are stepped one after the other, each with the latest outputs of those before it."""

from __future__ import annotations

from harness.system.experiment import Experiment
from harness.system.plan import GET, SET, STEP, Plan, Schedule


def master(plan: Plan, experiment: Experiment) -> Schedule:
    """Set, step and read part by part in the order of the plan: sampled parts, then plants, then sensors."""
    parts = range(len(plan.parts))
    return Schedule(tuple((operation, part) for part in parts for operation in (SET, STEP, GET)))
