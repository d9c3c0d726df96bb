"""Checks of a control loop with friction for instability, hunting and simulation errors, before it is run.

``examine`` finds the plants, the friction and the laws of a system and evaluates the conditions of
`friction_fmus.conditions` that apply. The file of each block states its role in a loop.
"""

from dataclasses import replace

from friction_fmus.doctor.examined_axis import LoopFinding
from friction_fmus.doctor.find import axes, examine_steps, unknown_parts
from friction_fmus.doctor.rules import examine_axis
from harness import Experiment, System

__all__ = ["LoopFinding", "axes", "examine", "unknown_parts"]


def examine(system: System, experiment: Experiment | None = None) -> list[LoopFinding]:
    """Evaluate all conditions that apply to a system, without running it.

    Parameters
    ----------
    system : System
        System to examine.
    experiment : Experiment or None
        Communication step and master; None uses the experiment of the system. Without an experiment, the conditions
        that depend on the communication step are skipped.

    Returns
    -------
    list of LoopFinding
        One finding for each condition, including those that hold; see `Condition.ok`.

    Raises
    ------
    HarnessError
        If an FMU cannot be read.
    """
    found = axes(system)
    results = [
        replace(finding, condition=finding.condition.in_words(axis.words))
        for axis in found
        for finding in examine_axis(axis)
    ]
    plan = experiment or system.experiment
    if plan is not None:
        results += examine_steps(system, plan, found)
    return results
