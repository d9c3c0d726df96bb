"""The result of a study as text for the terminal."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from friction_fmus.cli.console import styled
from friction_fmus.study.recommendation import shown
from friction_fmus.study.result import CompensatorResult, Fit, ModelResult, StudyResult


def show_study(console: Console, result: StudyResult) -> None:
    """Print models, compensators, recommendation and violated conditions."""
    u = result.units.words
    show_servo(console, result)
    console.print(model_table(result))
    failed = [f"{row.name} ({row.reason})" for row in result.models if row.rank is None]
    if failed:
        console.print(f"Without a rank: {'; '.join(failed)}")
    for model in result.models:
        known = [f"{p.name} {p.value:.6g} ({p.published:.6g})" for p in model.parameters if p.published is not None]
        if known:
            console.print(f"{model.name}, identified (published): {', '.join(known)}")
    console.print()
    if result.ladder:
        console.print(ladder_table(result))
        console.print()
    if result.compensators:
        console.print(compensator_table(result))
        console.print(
            "Tracking error: root mean square of reference minus position over the whole run. Worst case: with "
            f"friction, {u.mass}, delay, encoder and load changed. Drive {u.force}: only the part above the loop "
            "bandwidth."
        )
        console.print(_numerical(result))
        left = sum(row.metrics is None for row in result.compensators)
        if left:
            console.print(f"{left} compensators do not apply to this axis; the report states the reasons.")
        console.print()
    console.print(styled((_headline(result), "bold")))
    console.print(result.recommendation.reason)
    if result.recommendation.runner_up:
        console.print(f"Runner-up: {result.recommendation.runner_up_reason}")
    for step in result.recommendation.next_steps:
        console.print(f"Next: {step}")
    wrong = [row for row in result.doctor if not row.ok]
    for row in wrong:
        console.print(styled("Doctor: ", (row.name, "bold red"), f", {row.wrong}; {row.change}"))
    if result.doctor and not wrong:
        console.print(f"Doctor: all {len(result.doctor)} conditions of the recommended loop hold.")
    console.print()


def show_servo(console: Console, result: StudyResult) -> None:
    """Print how well the servo as configured reproduces the record, and the findings."""
    u = result.units.words
    check = result.servo_check
    if check.residual is not None:
        within = "reproduces" if check.residual.percent <= check.allowed else "does not reproduce"
        console.print(
            f"The servo as configured {within} the recorded drive {u.force}: residual {check.residual.percent:.3g} % "
            f"of its rms value, {check.allowed:.3g} % allowed."
        )
    elif check.reason:
        console.print(check.reason)
    for finding in result.findings:
        console.print(styled((finding.name, "bold red"), f": {finding.what} {finding.change}"))
    console.print()


def model_table(result: StudyResult) -> Table:
    """Return the friction models by rank as a table."""
    table = Table(title=f"Friction models of {result.name}", title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    table.add_column("model", no_wrap=True)
    loop = any(row.closed_loop for row in result.models)
    # one kind of residual for all models: of the validation data if there are any
    validated = any(row.validation is not None for row in result.models)
    fits = {row.name: row.validation if validated else row.train for row in result.models}
    signal = next((fit.signal for fit in fits.values() if fit is not None), "")
    table.add_column(
        f"{result.units.words.signal(signal)} residual,\n{'validation' if validated else 'training'} data",
        justify="right",
    )
    if loop:
        table.add_column("closed loop:\nposition error", justify="right")
        table.add_column(f"{result.units.words.force}\nerror", justify="right")
    table.add_column("poorly\nidentifiable")
    for row in result.models:
        if row.rank is None:
            continue
        cells = [str(row.rank), row.name, _percent(fits[row.name])]
        if loop:
            by_signal = {fit.signal: fit for fit in row.closed_loop}
            position = by_signal.get("position")
            cells += [shown(position.rms, position.unit) if position else "–", _percent(by_signal.get("force"))]
        table.add_row(*cells, _weak(row))
    return table


def ladder_table(result: StudyResult) -> Table:
    """Return the rungs from the axis as measured to the best compensation as a table."""
    unit = result.units.position
    table = Table(
        title="From the axis as it is to the best compensation", title_justify="left", box=None, pad_edge=False
    )
    table.add_column("servo")
    table.add_column("compensator")
    table.add_column("tracking\nerror", justify="right")
    table.add_column("largest", justify="right")
    for rung in result.ladder:
        name = "" if rung.name in ("", "none") else rung.name
        table.add_row(rung.title, name, shown(rung.metrics.rms, unit), shown(rung.metrics.largest, unit))
    return table


def compensator_table(result: StudyResult) -> Table:
    """Return the compensators by rank as a table, after the servo without compensation."""
    unit, force = result.units.position, result.units.force
    title = f"Compensators on the axis with {result.plant} friction"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    table.add_column("compensator", overflow="fold")
    table.add_column("gain or\nbandwidth", justify="right")
    table.add_column("tracking\nerror", justify="right")
    table.add_column("worst\ncase", justify="right")
    table.add_column("Ms", justify="right")
    table.add_column(f"drive\n{result.units.words.force} [{force}]", justify="right")
    table.add_column("cycles", justify="right")
    for row in result.compensators:
        if row.metrics is None:
            continue
        table.add_row(
            "" if row.rank is None else str(row.rank),
            "none" if row.name == "none" else f"{row.name}{'' if row.improves else ' (no improvement)'}",
            _tuned(row),
            shown(row.metrics.rms, unit),
            "fails" if row.worst is None else shown(row.worst, unit),
            "" if row.margins is None or row.margins.Ms is None else f"{row.margins.Ms:.2f}",
            f"{row.metrics.effort_high:.3g}",
            "" if row.cycles is None else f"{row.cycles:.0f}",
        )
    return table


def _numerical(result: StudyResult) -> str:
    """Return how far the tracking errors are off, in a sentence."""
    runs = [(row.name, row.metrics) for row in result.compensators if row.metrics is not None]
    shares = {name: run.rms_bound / run.rms for name, run in runs if run.rms_bound is not None and run.rms > 0.0}
    if not shares:
        return "Numerical error of the tracking errors: not known."
    worst = max(shares, key=lambda name: shares[name])
    return f"Numerical error of the tracking errors: at most {100.0 * shares[worst]:.2g} % ({worst})."


def _tuned(row: CompensatorResult) -> str:
    if row.bandwidth is not None:
        return f"{row.bandwidth:.3g} Hz"
    return "" if row.gain is None else f"{row.gain:g}"


def _headline(result: StudyResult) -> str:
    name = result.recommendation.name
    if not name:
        return "No recommendation"
    return "Recommendation: no compensation" if name == "none" else f"Recommendation: {name}"


def _percent(fit: Fit | None) -> str:
    return "–" if fit is None else f"{fit.percent:.3g} %"


def _weak(row: ModelResult) -> str:
    return ", ".join(p.name for p in row.parameters if p.weak)
