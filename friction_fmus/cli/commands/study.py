"""Identify a measured axis, co-simulate it, and recommend a compensator.

The study ranks the friction models and the compensators, and writes a report and the files to use.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from friction_fmus.cli.arguments import add_scheduler, add_workers


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("config", metavar="CONFIG", help="a configuration (.toml), or emps, tribometer, demo")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder; an interrupted study resumes there"
    )
    where = parser.add_mutually_exclusive_group()
    add_workers(where)
    add_scheduler(where)
    parser.add_argument("--fresh", action="store_true", help="start again, without the cached steps")


def run(options: argparse.Namespace) -> None:
    """Do the study and print its results.

    Raises
    ------
    KeyboardInterrupt
        With a message that the study can be resumed.
    """
    from friction_fmus.cli.cluster import connect
    from friction_fmus.cli.console import RunBar, console, progress_bar
    from friction_fmus.cli.study_tables import show_study
    from friction_fmus.study.steps import forget
    from friction_fmus.study.study import run_study

    if options.fresh:
        forget(options.output)
    with ExitStack() as stack:
        executor: Any = None
        if options.scheduler:
            executor = stack.enter_context(connect(options.scheduler)).get_executor(pure=False)
        bar = stack.enter_context(progress_bar())
        try:
            result = run_study(
                options.config,
                options.output,
                executor=executor,
                processes=options.workers,
                progress=RunBar(bar, "study"),
            )
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt("interrupted; the same command resumes here") from error
    show_study(console, result)
    for name in ("report.html", "recommended"):
        path = options.output / name
        if path.exists():
            what = "Report" if name == "report.html" else "Files to use"
            console.print(f"{what}: {path}", soft_wrap=True)
