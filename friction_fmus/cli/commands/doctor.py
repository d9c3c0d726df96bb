"""Check a closed loop with friction without running it.

For each violated condition, print what is wrong, why, and what to change. The exit status is 1 if a condition is
violated.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import harness
from friction_fmus.cli.arguments import add_system, parse_assignments
from harness.errors import ExperimentError
from harness.masters import master_names

if TYPE_CHECKING:
    from friction_fmus.doctor import LoopFinding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_system(parser)
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s]")
    parser.add_argument("--master", choices=master_names(), help="master algorithm")
    parser.add_argument("--set", action="append", metavar="PART.NAME=VALUE", help="start value; may be repeated")
    parser.add_argument("--all", action="store_true", help="also show the conditions that hold")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(options: argparse.Namespace) -> int:
    """Examine the system and print the findings."""
    from friction_fmus.cli.console import console
    from friction_fmus.cli.inputs import open_system
    from friction_fmus.doctor import axes, examine, unknown_parts

    with open_system(options.system) as opened:
        system = opened.with_start(parse_assignments(options.set))
        results = examine(system, _experiment(system, options))
        masses, unknown = axes(system), unknown_parts(system)
    wrong = [finding for finding in results if not finding.condition.ok]
    shown = results if options.all else wrong
    if options.json:
        text = json.dumps([_plain(finding) for finding in shown], indent=2)
        console.print(text, soft_wrap=True)
    else:
        for finding in shown:
            _show(finding)
        _print_ignored(len(masses), unknown)
        summary = f"{_counted(len(results), 'condition')} evaluated, {_counted(len(wrong), 'finding')}"
        console.print(f"{options.system}: {summary}", soft_wrap=True)
    return 1 if wrong else 0


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


def _plain(finding: LoopFinding) -> dict[str, object]:
    """Return a finding for JSON, which has no infinity: such numbers become null."""
    values = asdict(finding.condition)
    numbers = {key: values[key] if math.isfinite(values[key]) else None for key in ("value", "bound")}
    return {"parts": list(finding.parts), **values, **numbers}


def _show(finding: LoopFinding) -> None:
    from friction_fmus.cli.console import console, styled

    condition, parts = finding.condition, ", ".join(finding.parts)
    if condition.ok:
        numbers = f"{condition.value:.4g} against {condition.bound:.4g}"
        console.print(styled(("holds", "green"), f" {condition.name} ({parts}): {numbers}"))
        return
    console.print(styled((condition.name, "bold red"), f" ({parts})"))
    for title in ("wrong", "why", "change", "source"):
        console.print(f"  {title:<8}{getattr(condition, title)}", soft_wrap=True)


def _print_ignored(masses: int, unknown: list[str]) -> None:
    """Name the ignored parts: without this, a system of unknown blocks would appear to be without faults."""
    from friction_fmus.cli.console import console

    if unknown:
        console.print(f"ignored, unknown blocks: {', '.join(unknown)}", soft_wrap=True)
    if not masses:
        text = "no known mass found: only sample times and the stepping order were checked"
        console.print(text, soft_wrap=True)


def _counted(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"
