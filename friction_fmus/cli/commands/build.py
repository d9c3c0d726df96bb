"""Build FMUs."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.cli.arguments import add_fmu_target, add_set, completed, parse_assignments, target_options
from friction_fmus.errors import FrictionError

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

DOMAINS = ("translational", "rotational")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    completed(parser.add_argument("names", nargs="*", metavar="NAME", help="name of a model, or its .c or .py file"))
    parser.add_argument("--all", action="store_true", help="build all models")
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="folder for the results")
    add_set(parser)
    parser.add_argument("--domain", choices=DOMAINS, default=DOMAINS[0], help="rotational: units N.m, rad, kg.m2")
    add_fmu_target(parser)
    parser.add_argument("--name", metavar="IDENTIFIER", help="model identifier and file name")


def run(options: argparse.Namespace) -> None:
    """Build the FMUs and print their paths."""
    from friction_fmus.blocks.catalogue import listing
    from friction_fmus.cli.console import progress_bar
    from friction_fmus.export.block_fmu import build
    from harness.compiling.platforms import select

    if options.all == bool(options.names):
        raise FrictionError("give either names of models (`friction-fmus list` shows them) or --all")
    names = list(listing()) if options.all else options.names
    start = parse_assignments(options.set)
    if start and len(names) != 1:
        raise FrictionError(f"--set applies to one model, but there are {len(names)}; build them one at a time")
    platforms = len(select(tuple(options.platform)))
    with progress_bar() as bar:
        task = bar.add_task("building", total=len(names) * platforms)
        for number, name in enumerate(names):
            path = build(
                name,
                options.output,
                start,
                options.name,
                domain=options.domain,
                platforms=options.platform,
                target=options.target,
                compiling=partial(_show, bar, task, name, number * platforms),
                **target_options(options, "fmu"),
            )
            if start and not options.name:
                text = f"note: {path.name} has other default values than the block; --name gives it a name of its own"
                bar.console.print(text, soft_wrap=True)
            bar.update(task, completed=(number + 1) * platforms)
            bar.console.print(str(path), soft_wrap=True) if bar.console.is_terminal else print(path)


def _show(bar: Progress, task: TaskID, name: str, before: int, platform: str, number: int) -> None:
    """Show that a model is being compiled for a platform, after ``number`` other platforms."""
    from friction_fmus.cli.console import announce

    bar.update(task, completed=before + number)
    announce(bar, task, f"compiling {name} for {platform}", foreign=platform)
