"""Adaptive: Newton with inner steps whose size follows from the coupling error; ticks are points it always meets."""

from __future__ import annotations

from harness.system.experiment import LOOP_TOLERANCE, Experiment
from harness.system.plan import Plan, Schedule


def master(plan: Plan, experiment: Experiment) -> Schedule:
    """As many steps of a loop within a tick as keep the error of its values below 1e-5 of their size.

    The energy that a step makes between a force and a velocity, the error of each times the mean of the other, is then
    below 2e-5 of the product of their sizes and of the step.
    """
    return Schedule((), tolerance=experiment.loop_tolerance or LOOP_TOLERANCE, error=1e-5)
