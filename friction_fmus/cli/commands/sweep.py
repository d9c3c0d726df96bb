"""Run a system of FMUs with many parameter sets.

With -o, the results are written to a folder of Parquet files, or to one .csv file, with a row for each run. The exit
status is 1 if no run succeeds, or if a result is reported as wrong, unless --allow-inaccurate is given.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import harness
from friction_fmus.cli.arguments import (
    add_allow_inaccurate,
    add_experiment,
    add_json,
    add_scheduler,
    add_system,
    print_json,
)
from friction_fmus.errors import FrictionError
from harness.notebook import counted
from harness.processors import available
from harness.results import FORMATS
from harness.storage.files import atomic_path, make_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_system(parser)
    text = "output folder, in which an interrupted sweep resumes, or a .csv file"
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help=text)
    add_json(parser)
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUES",
        help="part.port=0.5,1,2 or =0.5:2:4 (first:last:count) or =0.5:2 (range of random points); :log for a "
        "logarithmic scale, a unit at the end: ='0.5:2:4 N'; also step, stop, master; repeat it for all combinations",
    )
    random = parser.add_mutually_exclusive_group()
    random.add_argument("--latin-hypercube", type=int, metavar="N", help="N random points in the ranges")
    random.add_argument("--sobol", type=int, metavar="N", help="N points of a Sobol sequence, a power of 2")
    random.add_argument(
        "--samples",
        type=Path,
        nargs="+",
        metavar="FILE",
        help=".csv with names in the heading and a row for each run, or a .ssv for each run",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random points")
    parser.add_argument(
        "--measure",
        action="append",
        metavar="MEASURE",
        help="final, min, max, max_abs, mean or rms of variables: rms(part.port), final(*); may be repeated",
    )
    parser.add_argument("--keep", action="append", default=[], metavar="NAME", help="trajectory to store")
    add_experiment(parser)
    parser.add_argument(
        "--workers", type=int, metavar="N", help="number of processes or threads; default: number of processors"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--executor", choices=["processes", "threads", "serial"], default="processes")
    add_scheduler(where)
    parser.add_argument("--accuracy", action="store_true", help="estimate the error of each measure")
    add_allow_inaccurate(parser)


def run(options: argparse.Namespace) -> int:
    """Run the sweep, and print the first results and the folder."""
    from friction_fmus.cli.console import RunBar, console
    from friction_fmus.cli.inputs import connect, open_system, parameter_sets
    from friction_fmus.cli.result_tables import show_sweep, sweep_progress
    from harness.engine.defect import WRONG

    samples = parameter_sets(options)
    folder = options.output
    if folder and folder.suffix.lower() in FORMATS:
        if folder.suffix.lower() != ".csv":
            raise FrictionError(f"-o {folder} would be a folder; give a folder, or a .csv file")
        folder = None
    workers = options.workers or available()
    where = options.scheduler or (options.executor if options.executor == "serial" else f"{workers} {options.executor}")
    with ExitStack() as stack:
        executor: Any = stack.enter_context(connect(options.scheduler)) if options.scheduler else options.executor
        system = stack.enter_context(open_system(options.system))
        bar = stack.enter_context(sweep_progress())
        result = harness.sweep(
            system,
            samples,
            measure=options.measure or "final(*)",
            output=folder,
            executor=executor,
            workers=workers,
            experiment=_experiment(system, options),
            keep=options.keep,
            progress=RunBar(bar, "sweep", {0.0: f"{counted(len(samples), 'run')}, workers: {where}"}),
            accuracy=options.accuracy,
            engine=options.engine,
        )
    errors = [str(error) for error in result["error"].to_numpy() if error]
    warnings = [str(text) for text in result["warnings"].to_numpy()[result["error"].to_numpy() == ""] if text]
    wrong = sum(WRONG in text for text in warnings)
    notes = f", {len(warnings)} with warnings" * bool(warnings)
    notes += f", {wrong} of them reported as wrong" * bool(wrong)
    notes += f", {len(errors)} failed; first error: {errors[0]}" if errors else ""
    if options.output and folder is None:
        make_folder(options.output.parent)
        with atomic_path(options.output) as temporary:
            result.to_dataframe().to_csv(temporary)
    if options.json:
        print_json(options, result.to_dataframe().reset_index().to_dict("records"))
    else:
        show_sweep(console, result)
    target = f"{options.output}: " if options.output else ""
    console.print(f"{target}{counted(result.sizes['run'], 'run')}{notes}", soft_wrap=True)
    return int(len(errors) == result.sizes["run"] or (wrong > 0 and not options.allow_inaccurate))


def _experiment(system: harness.System, options: argparse.Namespace) -> harness.Experiment | None:
    given = {key: getattr(options, key) for key in ("step", "stop", "master") if getattr(options, key) is not None}
    if system.experiment is not None:
        return replace(system.experiment, **given)
    return harness.Experiment(**given) if "step" in given and "stop" in given else None
