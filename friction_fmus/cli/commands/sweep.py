"""Run a system of FMUs with many parameter sets.

The results go to a folder of Parquet files with a row for each run. The status is 1 if no run succeeds, or if the
result of one is reported as wrong, unless that is allowed.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import harness
from friction_fmus.cli.arguments import add_allow_inaccurate, add_master, add_scheduler, add_system


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_system(parser)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder; an interrupted sweep resumes there"
    )
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUES",
        help="part.port=0.5,1,2 or =0.5:2:4 (first:last:count) or =0.5:2 (for random points), :log for a logarithmic "
        "scale; also step, stop, master; may be repeated: all combinations",
    )
    random = parser.add_mutually_exclusive_group()
    random.add_argument("--latin-hypercube", type=int, metavar="N", help="N random points in the ranges")
    random.add_argument("--sobol", type=int, metavar="N", help="N points of a Sobol sequence, a power of 2")
    random.add_argument(
        "--samples",
        type=Path,
        nargs="+",
        metavar="FILE",
        help=".csv: names in the heading, a run a row; .ssv: a run",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the random points")
    parser.add_argument(
        "--measure",
        action="append",
        metavar="MEASURE",
        help="final, min, max, max_abs, mean or rms of variables: rms(part.port), final(*); may be repeated",
    )
    parser.add_argument("--keep", action="append", default=[], metavar="NAME", help="store these trajectories too")
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s]")
    parser.add_argument("--stop", type=float, metavar="T", help="end time [s]")
    add_master(parser)
    parser.add_argument(
        "--workers", type=int, metavar="N", help="number of processes or threads; default: number of processors"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--executor", choices=["processes", "threads", "serial"], default="processes")
    add_scheduler(where)
    add_allow_inaccurate(parser)


def run(options: argparse.Namespace) -> int:
    """Run the sweep, print its first results and the folder.

    Returns
    -------
    int
        1 if no run succeeds, or if the result of one is reported as wrong and that is not allowed, otherwise 0.
    """
    from friction_fmus.cli.cluster import connect
    from friction_fmus.cli.console import console
    from friction_fmus.cli.parameter_sets import parameter_sets
    from friction_fmus.cli.sweep_bar import SweepBar, sweep_progress
    from friction_fmus.cli.sweep_table import show_sweep
    from friction_fmus.cli.systems import open_system
    from harness.engine.defect import WRONG

    samples = parameter_sets(options)
    with ExitStack() as stack:
        executor: Any = stack.enter_context(connect(options.scheduler)) if options.scheduler else options.executor
        system = stack.enter_context(open_system(options.system))
        bar = stack.enter_context(sweep_progress())
        result = harness.sweep(
            system,
            samples,
            measure=options.measure or "final(*)",
            output=options.output,
            executor=executor,
            workers=options.workers,
            experiment=_experiment(system, options),
            keep=options.keep,
            progress=SweepBar(bar),
        )
    errors = [str(error) for error in result["error"].to_numpy() if error]
    warnings = [str(text) for text in result["warnings"].to_numpy()[result["error"].to_numpy() == ""] if text]
    wrong = sum(WRONG in text for text in warnings)
    notes = f", {len(warnings)} with warnings" * bool(warnings)
    notes += f", {wrong} of them reported as wrong" * bool(wrong)
    notes += f", {len(errors)} failed, the first one because {errors[0]}" if errors else ""
    show_sweep(console, result)
    console.print(f"{options.output}: {result.sizes['run']} runs{notes}", soft_wrap=True)
    return int(len(errors) == result.sizes["run"] or (wrong > 0 and not options.allow_inaccurate))


def _experiment(system: harness.System, options: argparse.Namespace) -> harness.Experiment | None:
    given = {key: getattr(options, key) for key in ("step", "stop", "master") if getattr(options, key) is not None}
    if system.experiment is not None:
        return replace(system.experiment, **given)
    return harness.Experiment(**given) if "step" in given and "stop" in given else None
