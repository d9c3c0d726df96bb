"""Identify a measured axis, co-simulate it, and recommend a compensator.

The study ranks friction models and compensators. It writes a report, and the recommended compensator as FMU and C code.
The exit status is 1 if the result cannot be trusted: then no compensator is ranked and no FMU is written.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from friction_fmus.cli.arguments import add_scheduler, add_workers
from harness.extras import require


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("config", metavar="CONFIG", help="configuration (.toml), or one of emps, tribometer, demo")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="output folder; resumes an interrupted study"
    )
    where = parser.add_mutually_exclusive_group()
    add_workers(where)
    add_scheduler(where)
    parser.add_argument(
        "--force", action="store_true", help="simulate and write FMUs although the result cannot be trusted"
    )
    parser.add_argument("--fresh", action="store_true", help="ignore cached steps and start from the beginning")


def run(options: argparse.Namespace) -> int:
    """Run the study and print its results.

    Returns
    -------
    int
        1 if a finding forbids to use the result, otherwise 0.

    Raises
    ------
    KeyboardInterrupt
        If the study is interrupted; the message states that it can be resumed.
    """
    require("plotly")
    from friction_fmus.cli.cluster import connect
    from friction_fmus.cli.console import RunBar, console, progress_bar
    from friction_fmus.cli.study_tables import show_study
    from friction_fmus.study.steps import clear_cache
    from friction_fmus.study.study import run_study

    if options.fresh:
        clear_cache(options.output)
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
                force=options.force,
            )
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt("interrupted; run the same command again to resume") from error
    show_study(console, result)
    console.print(f"Report: {options.output / 'report.html'}", soft_wrap=True)
    if any(file.path.startswith("recommended/") for file in result.files):
        console.print(f"Recommended compensator: {options.output / 'recommended'}", soft_wrap=True)
    return 0 if result.trusted else 1
