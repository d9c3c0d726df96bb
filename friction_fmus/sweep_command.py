"""The command ``friction-fmus sweep``."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from friction_fmus.errors import FrictionError
from friction_fmus.run_command import add_allow_inaccurate, open_system
from friction_fmus.terminal import console, literal_console
from harness import Experiment, System, grid, latin_hypercube, read_samples, sobol, sweep
from harness.coupling import WRONG
from harness.sweeps import WithUnits
from harness.sweeps.samples import check_runs

PATIENCE = 10.0
"""Seconds in which a scheduler must answer."""

_FORMS = "give NAME=A,B,... or NAME=FIRST:LAST:COUNT, or NAME=FIRST:LAST for random points; :log behind a range"


class _Rate(ProgressColumn):
    """Runs per second."""

    def render(self, task: Task) -> Text:
        """Empty until it is known."""
        return Text(f"{task.speed:.3g} runs/s" if task.speed else "")


class _Bar:
    """The sweep's progress on a rich bar, or nothing where the output is not a terminal."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("sweep", total=None)

    def update(self, done: int, total: int) -> None:
        """Called by the harness; what was done before counts, but not for the rate."""
        if self._bar.tasks[0].total is None:
            self._bar.reset(self._task, completed=done, total=total)
        self._bar.update(self._task, completed=done, total=total)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("system", type=Path, metavar="SYSTEM", help="system file (.toml) or archive (.ssp)")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder; an interrupted sweep goes on"
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
    parser.add_argument("--master", metavar="NAME", help="jacobi or gauss-seidel")
    parser.add_argument("--workers", type=int, metavar="N", help="processes or threads; as many as processors")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--executor", choices=["processes", "threads", "serial"], default="processes")
    where.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this dask cluster")
    add_allow_inaccurate(parser)


def sweep_system(options: argparse.Namespace) -> int:
    """Many runs of a system, into a folder of Parquet files with a row for each run.

    The status is 1 if no run succeeds, or if the result of one is reported as wrong, unless that is allowed.
    """
    samples = _samples(options)
    screen = literal_console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(),
        TimeRemainingColumn(),
    )
    with ExitStack() as stack:
        executor: Any = stack.enter_context(connect(options.scheduler)) if options.scheduler else options.executor
        system = stack.enter_context(open_system(options.system))
        bar = stack.enter_context(
            Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal, speed_estimate_period=60)
        )
        result = sweep(
            system,
            samples,
            measure=options.measure or "final(*)",
            output=options.output,
            executor=executor,
            workers=options.workers,
            experiment=_experiment(system, options),
            keep=options.keep,
            progress=_Bar(bar),
        )
    errors = [str(error) for error in result["error"].to_numpy() if error]
    warnings = [str(text) for text in result["warnings"].to_numpy()[result["error"].to_numpy() == ""] if text]
    wrong = sum(WRONG in text for text in warnings)
    notes = f", {len(warnings)} with warnings" * bool(warnings)
    notes += f", {wrong} of them reported as wrong" * bool(wrong)
    notes += f", {len(errors)} failed, the first one because {errors[0]}" if errors else ""
    console.print(f"{options.output}: {result.sizes['run']} runs{notes}", soft_wrap=True)
    return int(len(errors) == result.sizes["run"] or (wrong > 0 and not options.allow_inaccurate))


def _experiment(system: System, options: argparse.Namespace) -> Experiment | None:
    given = {key: getattr(options, key) for key in ("step", "stop", "master") if getattr(options, key) is not None}
    if system.experiment is not None:
        return replace(system.experiment, **given)
    return Experiment(**given) if "step" in given and "stop" in given else None


def _samples(options: argparse.Namespace) -> list[WithUnits]:
    """The parameter sets that the options stand for.

    Raises
    ------
    FrictionError
        If they cannot be understood.
    """
    listed: dict[str, list[Any]] = {}
    ranges: dict[str, tuple[float, float]] = {}
    logarithmic: list[str] = []
    for text in options.vary:
        name, values = _assignment(text)
        if name in listed or name in ranges:
            raise FrictionError(f"--vary names {name} twice; put all its values into one")
        if ":" not in values:
            listed[name] = [_value(value) for value in values.split(",")]
            continue
        first, last, count, log = _range(text, values)
        if count is not None:
            check_runs(count)
            listed[name] = (np.geomspace if log else np.linspace)(first, last, count).tolist()
            continue
        ranges[name] = (first, last)
        logarithmic += [name] * log
    n = options.latin_hypercube if options.latin_hypercube is not None else options.sobol
    if ranges and n is None:
        raise FrictionError(f"{', '.join(ranges)} has no count of values: {_FORMS}, with --latin-hypercube or --sobol")
    points: list[WithUnits] = [{}]
    if n is not None:
        method = sobol if options.sobol is not None else latin_hypercube
        points = list(method(ranges, n, options.seed, log=logarithmic))
    elif options.samples:
        points = read_samples(options.samples)
    elif not listed:
        raise FrictionError(f"nothing is varied: use --vary ({_FORMS}) or --samples FILE")
    rows = grid(listed)
    check_runs(len(rows) * len(points))
    return [{**others, **point} for others in rows for point in points]


def _assignment(text: str) -> tuple[str, str]:
    name, equals, values = text.partition("=")
    if not (equals and name.strip() and values.strip()):
        raise FrictionError(f"--vary {text!r} is not NAME=VALUES: {_FORMS}")
    return name.strip(), values.strip()


def _range(text: str, values: str) -> tuple[float, float, int | None, bool]:
    """``FIRST:LAST[:COUNT][:log]``."""
    pieces = values.split(":")
    log = pieces[-1] == "log"
    pieces = pieces[:-1] if log else pieces
    try:
        first, last, *rest = pieces
        count = int(*rest) if rest else None
        ends = float(first), float(last)
    except (TypeError, ValueError) as error:
        raise FrictionError(f"--vary {text!r} is not a range: {_FORMS}") from error
    if count is not None and count < 1:
        raise FrictionError(f"--vary {text!r} has {count} values: {_FORMS}")
    if log and min(ends) <= 0.0:
        raise FrictionError(f"--vary {text!r} has a logarithmic scale; give a first and last value above 0")
    return *ends, count, log


def _value(text: str) -> float | bool | str:
    """A number, a truth value, or the text itself, such as the name of a master."""
    text = text.strip()
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return float(text)
    except ValueError:
        return text


def connect(address: str) -> Any:
    """A client of the dask cluster at this address.

    Raises
    ------
    FrictionError
        If dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise FrictionError("--scheduler needs dask; install it with `pip install friction-fmus[dask]`") from error
    make: Any = Client
    try:
        return make(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise FrictionError(f"no dask scheduler answers at {address}: {error}; start `dask scheduler`") from error
