"""Check a closed loop with friction without running it.

For each violated condition, print the problem, its cause, and what to change. The exit status is 1 if there is a
problem, and 0 if there are only notes, such as stick-slip of a system that may be meant to show it.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import harness
from friction_fmus.cli.arguments import add_json, add_set, add_system, parse_assignments, print_json
from harness.errors import ExperimentError
from harness.masters import master_names
from harness.notebook import counted

if TYPE_CHECKING:
    from friction_fmus.doctor import LoopFinding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_system(parser)
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s]")
    parser.add_argument("--master", choices=master_names(), help="master algorithm")
    add_set(parser, "PART.NAME")
    parser.add_argument("--all", action="store_true", help="also show the conditions that hold")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Examine the system and print the findings."""
    from friction_fmus.cli.console import console
    from friction_fmus.cli.inputs import open_system
    from friction_fmus.doctor import axes, examine, unknown_parts

    with open_system(options.system) as opened:
        system = opened.with_start(parse_assignments(options.set))
        results = examine(system, _experiment(system, options))
        masses, unknown = axes(system), unknown_parts(system)
    violated = [finding for finding in results if not finding.condition.ok]
    notes = [finding for finding in violated if finding.condition.note]
    shown = results if options.all else violated
    if options.json:
        print_json(options, [{"parts": finding.parts, **asdict(finding.condition)} for finding in shown])
    else:
        for finding in shown:
            _show(finding)
        _print_ignored(len(masses), unknown)
        problems = counted(len(violated) - len(notes), "problem") if len(violated) > len(notes) else "no problem"
        summary = f"{counted(len(results), 'condition')} evaluated, {problems}"
        summary += f", {counted(len(notes), 'note')}" if notes else ""
        console.print(f"{options.system}: {summary}", soft_wrap=True)
    return int(len(violated) > len(notes))


def _experiment(system: harness.System, options: argparse.Namespace) -> harness.Experiment | None:
    """Return the experiment of the system with the requested step and master."""
    own, step = system.experiment, options.step
    if step is not None and not (step > 0.0 and math.isfinite(step)):
        raise ExperimentError(f"the step is {step} s: give a positive number of seconds")
    if own is None and step is None:
        return None
    # only step and master matter; one step avoids a span that is no multiple of the requested step
    step = own.step if step is None and own is not None else step
    experiment = (
        harness.Experiment(stop=step, step=step) if own is None else replace(own, start=0.0, stop=step, step=step)
    )
    return replace(experiment, master=options.master) if options.master else experiment


def _show(finding: LoopFinding) -> None:
    from friction_fmus.cli.console import console, styled

    condition, parts = finding.condition, ", ".join(finding.parts)
    if condition.ok:
        numbers = f"{condition.value:.4g} against {condition.bound:.4g}"
        console.print(styled(("holds", "green"), f" {condition.name} ({parts}): {numbers}"))
        return
    note = ", may be intended" if condition.note else ""
    console.print(styled((condition.name, "bold yellow" if note else "bold red"), f" ({parts}){note}"))
    for title, text in (("problem", "wrong"), ("cause", "why"), ("fix", "change"), ("reference", "source")):
        console.print(f"  {title:<10}{getattr(condition, text)}", soft_wrap=True)


def _print_ignored(masses: int, unknown: list[str]) -> None:
    """Name the ignored parts: without this, a system of unknown blocks would appear to be without faults."""
    from friction_fmus.cli.console import console

    if unknown:
        console.print(f"ignored, unknown blocks: {', '.join(unknown)}", soft_wrap=True)
    if not masses:
        text = "no known mass found: only sample times and the stepping order were checked"
        console.print(text, soft_wrap=True)
