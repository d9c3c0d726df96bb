"""Gauss-Seidel: steps one part after the other with the newest outputs: sampled parts, plants, friction and sensors.

Use it for loops that are slow compared with the step; it is the default.
"""

from harness.masters import Master
from harness.parts.fmu import FmuPart
from harness.parts.series import SeriesPart
from harness.system.experiment import Experiment
from harness.system.graph import is_held_source
from harness.system.plan import GET, RENEW, SET, STEP, Plan, Schedule


def _schedule(plan: Plan, experiment: Experiment) -> Schedule:
    """Set, step and read part by part in the order of the plan: sampled parts, then plants, then sensors."""
    # Inputs from a recorded series follow its line, as a held value would shift the record by half a step. Outputs that
    # depend directly on a held value from a later part are read again with its value at the end of the step.
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
    steps = tuple((operation, part) for part in parts for operation in (SET, STEP, GET))
    again = tuple((operation, part) for part in _late(plan) for operation in (RENEW, GET))
    return Schedule(steps + again, lines=lines)


def _late(plan: Plan) -> list[int]:
    """Return the parts with outputs that depend directly on a held value from a later part without inputs."""
    late: list[int] = []
    new: set[int] = set()  # outputs
    for index, part in enumerate(plan.parts):
        jumping = {
            plan.names[signal].removeprefix(f"{part.name}.")
            for signal in range(*plan.inputs[index])
            for source in [plan.owners[plan.sources[signal]]]
            if (source > index and is_held_source(plan.parts[source])) or plan.sources[signal] in new
        }
        outputs = {
            signal
            for signal in range(*plan.outputs[index])
            if jumping & part.dependencies.get(plan.names[signal].removeprefix(f"{part.name}."), frozenset())
        }
        if outputs and not part.sampled:
            late.append(index)
            new |= outputs
    return late


master = Master(_schedule)
