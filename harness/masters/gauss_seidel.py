"""Gauss-Seidel: steps one part after the other with the newest outputs: sampled parts, plants, friction and sensors.

Use it for loops that are slow compared with the step; it is the default.
"""

from __future__ import annotations

from harness.masters import Master
from harness.parts.fmu import FmuPart
from harness.parts.series import SeriesPart
from harness.system.experiment import Experiment
from harness.system.plan import GET, SET, STEP, Plan, Schedule


def _schedule(plan: Plan, experiment: Experiment) -> Schedule:
    """Set, step and read part by part in the order of the plan: sampled parts, then plants, then sensors.

    Inputs from a recorded series follow its line, as a held value would shift the record by half a step.
    """
    parts = range(len(plan.parts))
    changed = {manipulator.input for manipulator in experiment.manipulators}
    lines = tuple(
        wire
        for wire in plan.moving_wires
        if isinstance(plan.parts[wire.source], SeriesPart)
        and isinstance(plan.parts[wire.target], FmuPart)
        and wire.source < wire.target
        and plan.delays[wire.input] == 0
        and plan.names[wire.input] not in changed
    )
    return Schedule(tuple((operation, part) for part in parts for operation in (SET, STEP, GET)), lines=lines)


master = Master(_schedule)
