"""The command ``study``: from a record to the recommended compensator."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from friction_fmus.terminal import RunBar, console, progress_bar, styled

if TYPE_CHECKING:
    from friction_fmus.study.result import StudyResult
    from friction_fmus.study.rows import CompensatorRow, Fit, ModelRow


def add_study_options(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("config", metavar="CONFIG", help="a configuration (.toml), or emps, tribometer, demo")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder; a study that was broken off goes on"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=int, metavar="N", help="processes; as many as processors")
    where.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="run on this dask cluster")
    parser.add_argument("--fresh", action="store_true", help="do everything again")


def study(options: argparse.Namespace) -> None:
    """The study of a measured axis: friction models, co-simulated compensators, and the one that pays."""
    from friction_fmus.study.jobs import forget
    from friction_fmus.study.study import run_study

    if options.fresh:
        forget(options.output)
    with ExitStack() as stack:
        executor: Any = None
        if options.scheduler:
            from friction_fmus.sweep_command import connect

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
            raise KeyboardInterrupt("interrupted; the same command goes on from here") from error
    show(result)
    for name in ("report.html", "recommended"):
        path = options.output / name
        if path.exists():
            what = "Report" if name == "report.html" else "Files to use"
            console.print(f"{what}: {path}", soft_wrap=True)


def show(result: StudyResult) -> None:
    """Print what was found: models, compensators, recommendation, findings."""
    console.print(model_table(result))
    failed = [f"{row.name} ({row.reason})" for row in result.models if row.rank is None]
    if failed:
        console.print(f"Not identified: {'; '.join(failed)}")
    for model in result.models:
        known = [f"{p.name} {p.value:.6g} ({p.published:.6g})" for p in model.parameters if p.published is not None]
        if known:
            console.print(f"{model.name}, and what is known: {', '.join(known)}")
    console.print()
    if result.compensators:
        console.print(compensator_table(result))
        left = sum(not row.applies for row in result.compensators)
        console.print(
            "Errors are root mean squares of reference minus position; the worst corner is that of friction and mass "
            "off by the mismatch; fast force is what of the drive force lies above the bandwidth of the loop."
        )
        if left:
            console.print(f"{left} more do not apply to this axis; the report says why.")
        console.print()
    console.print(styled((_headline(result), "bold")))
    console.print(result.recommendation.reason)
    if result.recommendation.runner_up:
        console.print(f"Runner-up: {result.recommendation.runner_up_reason}")
    wrong = [row for row in result.doctor if not row.ok]
    for row in wrong:
        console.print(styled("Doctor: ", (row.name, "bold red"), f", {row.wrong}; {row.change}"))
    if result.doctor and not wrong:
        console.print(f"Doctor: all {len(result.doctor)} conditions of this loop hold.")
    console.print()


def model_table(result: StudyResult) -> Table:
    """Friction models in order."""
    from friction_fmus.study.ranking import shown

    table = Table(title=f"Friction models of {result.name}", title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    table.add_column("model", no_wrap=True)
    loop = any(row.closed_loop for row in result.models)
    predicted = next((row.validation for row in result.models if row.validation is not None), None)
    table.add_column(f"{predicted.signal + ' of the rest' if predicted else 'fit'}\nerror", justify="right")
    if loop:
        table.add_column("position\nerror", justify="right")
        table.add_column("force\nerror", justify="right")
    table.add_column("weakly determined")
    for row in result.models:
        if row.rank is None:
            continue
        cells = [str(row.rank), row.name, _percent(row.validation or row.train)]
        if loop:
            by_signal = {fit.signal: fit for fit in row.closed_loop}
            position = by_signal.get("position")
            cells += [shown(position.rms, position.unit) if position else "–", _percent(by_signal.get("force"))]
        table.add_row(*cells, _weak(row))
    return table


def compensator_table(result: StudyResult) -> Table:
    """Compensators in order, the servo without one first."""
    from friction_fmus.study.ranking import shown

    unit, force = result.units.position, result.units.force
    title = f"Compensators on the axis with {result.plant} friction, all with the same feedback gains"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    table.add_column("compensator", no_wrap=True)
    table.add_column("gain", justify="right")
    table.add_column("tracking\nerror", justify="right")
    table.add_column("worst\ncorner", justify="right")
    table.add_column(f"fast\nforce [{force}]", justify="right")
    table.add_column("ns a\nsample", justify="right")
    for row in result.compensators:
        if row.metrics is None:
            continue
        table.add_row(
            "" if row.rank is None else str(row.rank),
            "none" if row.name == "none" else f"{row.name}{_mark(row)}",
            "" if row.name == "none" else f"{row.gain:g}",
            shown(row.metrics.rms, unit),
            "fails" if row.worst is None else shown(row.worst, unit),
            f"{row.metrics.effort_high:.3g}",
            "" if row.name == "none" else f"{row.cost_ns:.0f}",
        )
    return table


def _headline(result: StudyResult) -> str:
    name = result.recommendation.name
    if not name:
        return "No recommendation"
    return "Recommendation: no compensation" if name == "none" else f"Recommendation: {name}"


def _mark(row: CompensatorRow) -> str:
    """What keeps a compensator from being recommended."""
    return "" if row.pays and not row.noisy else " (noisy)" if row.pays else " (does not pay)"


def _percent(fit: Fit | None) -> str:
    return "–" if fit is None else f"{fit.percent:.3g} %"


def _weak(row: ModelRow) -> str:
    return ", ".join(p.name for p in row.parameters if p.weak)
