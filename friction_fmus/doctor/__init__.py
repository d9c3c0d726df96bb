"""Looks for what makes a control loop with friction unstable, hunt, or be simulated wrongly, before it is run.

``examine`` finds the plants, the friction and the laws of a system and evaluates the conditions of
`friction_fmus.conditions` that apply; the files of the blocks say what each of them is in a loop.
"""

from __future__ import annotations

from friction_fmus.doctor.axis import Finding
from friction_fmus.doctor.find import axes, unknown_parts
from friction_fmus.doctor.rules import examine_axis
from friction_fmus.doctor.sampling import examine_steps
from harness import Experiment, System

__all__ = ["Finding", "axes", "examine", "unknown_parts"]


def examine(system: System, experiment: Experiment | None = None) -> list[Finding]:
    """All conditions that apply to a system, those that hold included; nothing is run.

    Parameters
    ----------
    system : System
        The system.
    experiment : Experiment or None
        How it is to be run; None: its own. Without any, what depends on the communication step is left out.

    Returns
    -------
    list of Finding
        Each with its parts and its `Condition`, whose ``ok`` says whether it holds.

    Raises
    ------
    HarnessError
        If an FMU can no longer be read.
    """
    found = axes(system)
    results = [finding for axis in found for finding in examine_axis(axis)]
    plan = experiment or system.experiment
    return [*results, *examine_steps(system, plan, found)] if plan is not None else results
