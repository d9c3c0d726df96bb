"""Results of ``identify`` and ``study`` for the terminal, and the question which guess of columns is right."""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from friction_fmus.cli.console import console, drawn, styled
from friction_fmus.errors import AmbiguousColumnsError
from friction_fmus.identification import (
    AxisUnits,
    DataMapping,
    Identification,
    Measurement,
    Record,
    RecordFinding,
    read_measurement,
)
from friction_fmus.identification.fit.first_look import first_look
from friction_fmus.identification.fit.position import PositionFit
from friction_fmus.identification.identification_result import name_of
from friction_fmus.identification.model_comparison import ModelComparison
from friction_fmus.listings import (
    compensator_listing,
    ladder_listing,
    model_listing,
    parameter_listing,
    percent,
    ranking_listing,
    shown,
)
from friction_fmus.study.study_result import StudyResult
from friction_fmus.study.verification import Verification


def show_data(train: Sequence[Record], validation: Sequence[Record], findings: Sequence[RecordFinding]) -> None:
    """Print training data, validation data and findings."""

    def span(records: Sequence[Record]) -> str:
        samples = sum(map(len, records))
        return f"{records[0].t[0]:.4g} to {records[-1].t[-1]:.4g} s, {samples} samples"

    text = f"training data {span(train)} at {1e3 * train[0].Ts:.4g} ms; "
    text = f"training data {sum(map(len, train))} steady speeds; " if train[0].steady else text
    text += f"validation data {span(validation)}" if validation else "no validation data, so models are ranked by BIC"
    console.print(text, soft_wrap=True)
    for finding in findings:
        console.print(styled((finding.name, "yellow"), f" {finding.what}"), soft_wrap=True)
        console.print(f"  {finding.measure}", soft_wrap=True)


def show_understood(measurement: Measurement) -> None:
    """Print what was read and why."""
    for subject, text in measurement.understood:
        console.print(styled((f"{subject:<8} ", "bold"), text), soft_wrap=True)


def show_first_look(records: Sequence[Record]) -> None:
    """Print inertia, Coulomb and viscous friction by least squares, before any model is fitted."""
    found = first_look(records)
    if found:
        values = ", ".join(
            f"{name} {e.value:.4g} ± {e.standard_error:.2g}{'' if e.unit == '1' else f' {e.unit}'}"
            for name, e in found.items()
        )
        Fv = found["Fv"]
        doubt = "" if Fv.value > -2.0 * Fv.standard_error else "; Fv < 0: do not use Fv and Fc at other speeds"
        console.print(styled(("first look", "bold"), f" (least squares over sliding): {values}{doubt}"), soft_wrap=True)


def show_ready(bar: Progress, found: Identification | str) -> None:
    """Print a line about a model on stderr as soon as it is identified."""
    if isinstance(found, Identification):
        score = found.validation or found.train
        what = "validation" if found.validation else "training"
        bar.console.print(f"{found.model}: {what} error {score.relative_percent:.3g} %, {found.seconds:.2g} s")


def show_ranking(found: ModelComparison) -> None:
    """Print the ranked models as a table."""
    signal = name_of(found.results[0])
    text = f"\nModels by {found.ranked_by}; errors are rms values, also in % of the rms of the {signal}"
    console.print(text, soft_wrap=True)
    console.print(drawn(ranking_listing(found), title=False, padding=(0, 1, 0, 0)))


def show_parameters(result: Identification) -> None:
    """Print the parameters of a model with their standard errors."""
    console.print(styled("\n", (result.model, "bold")))
    console.print(drawn(parameter_listing(result), title=False))
    if result.position is not None:
        console.print(_position_text(result.position, result.records[0].units), soft_wrap=True)
    for name, reason in result.weak.items():
        console.print(styled((name, "yellow"), f" is poorly identifiable: {reason}"), soft_wrap=True)
    for warning in result.warnings:
        console.print(styled(("warning", "yellow"), f" {warning}"), soft_wrap=True)


def _position_text(found: PositionFit, units: AxisUnits) -> str:
    grid = found.table.grid
    cogging, friction = (
        math.sqrt(sum(value**2 for value in column) / grid.nodes)
        for column in (found.table.cogging, found.table.friction)
    )
    u = units.words
    return (
        f"{u.force} over position: {grid.nodes} nodes every {grid.spacing:.3g} {u.m}, cogging {cogging:.3g} and "
        f"friction {friction:.3g} {u.N} rms; error in cross-validation {found.crossed:.4g} {u.N}, without it "
        f"{found.crossed_without:.4g} {u.N}"
    )


def read_asking(path: Path, mapping: DataMapping | Path | None) -> Measurement:
    """Read a data file; on a terminal, ask which guess of its columns is right if more than one fits."""
    try:
        return read_measurement(path, mapping)
    except AmbiguousColumnsError as error:
        if not (error.choices and isinstance(mapping, DataMapping) and sys.stdin.isatty() and sys.stdout.isatty()):
            raise
        console.print(f"The columns of {path} can be read in {len(error.choices)} ways:", soft_wrap=True)
        for number, (columns, reasons) in enumerate(error.choices, 1):
            console.print(f"  {number}  {columns}", soft_wrap=True)
            if reasons:
                console.print(f"       {reasons}", soft_wrap=True)
        try:
            answer = input("Which one is right? Number, or Enter for none: ").strip()
        except EOFError:
            answer = ""
        if not (answer.isdigit() and 1 <= int(answer) <= len(error.choices)):
            raise
        return read_measurement(path, replace(mapping, option=error.choices[int(answer) - 1][0]))


def show_study(console: Console, result: StudyResult) -> None:
    """Print models, compensators, recommendation and violated conditions."""
    u = result.units.words
    show_servo(console, result)
    console.print(drawn(model_listing(result)))
    failed = [f"{row.name} ({row.reason})" for row in result.models if row.rank is None]
    if failed:
        console.print(f"Without a rank: {'; '.join(failed)}")
    for model in result.models:
        known = [f"{p.name} {p.value:.6g} ({p.published:.6g})" for p in model.parameters if p.published is not None]
        if known:
            console.print(f"{model.name}, identified ({result.known_as}): {', '.join(known)}")
    console.print()
    if result.ladder:
        console.print(drawn(ladder_listing(result)))
        console.print()
    if result.compensators:
        console.print(drawn(compensator_listing(result)))
        console.print(
            "Tracking error: root mean square of reference minus position over the whole run. Worst case: with "
            f"friction, {u.mass}, delay, encoder and reference changed. Drive {u.force}: only the part above the loop "
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
    for caution in result.recommendation.cautions:
        console.print(f"Note: {caution}")
    wrong = [row for row in result.conditions if not row.ok]
    for row in wrong:
        console.print(styled("Condition: ", (row.name, "bold red"), f", {row.wrong}; {row.change}"))
    if result.conditions and not wrong:
        console.print(f"All {len(result.conditions)} conditions of the recommended loop hold.")
    console.print()


def show_servo(console: Console, result: StudyResult) -> None:
    """Print how well the servo as configured reproduces the record, and the findings."""
    u = result.units.words
    check = result.servo_check
    if check.residual is not None:
        within = "reproduces" if check.residual.percent <= check.allowed else "does not reproduce"
        console.print(
            f"The servo as configured {within} the logged drive {u.force}: "
            f"residual {percent(check.residual.percent)} of its rms value, {check.allowed:.3g} % allowed."
        )
    elif check.reason:
        console.print(check.reason)
    for finding in result.findings:
        console.print(styled((finding.name, "bold red"), f": {finding.what} {finding.change}"))
    console.print()


def show_verification(console: Console, found: Verification) -> None:
    """Print claimed and measured error, and what differs."""
    console.print(
        f"{found.name}: {shown(found.claimed, found.unit)} rms claimed, {shown(found.measured, found.unit)} rms "
        f"measured ({100.0 * (found.measured / found.claimed - 1.0):+.0f} %). The claim "
        f"{'came' if found.came_true else 'did not come'} true.",
        soft_wrap=True,
    )
    for reason in found.reasons:
        console.print(reason, soft_wrap=True)
    if not found.came_true and not found.reasons:
        console.print("Mass and friction are as in the study. Compare the reference and the settings of the drive.")


def _numerical(result: StudyResult) -> str:
    """Return how far the tracking errors are off, in a sentence."""
    runs = [(row.name, row.metrics) for row in result.compensators if row.metrics is not None]
    shares = {name: run.rms_bound / run.rms for name, run in runs if run.rms_bound is not None and run.rms > 0.0}
    if not shares:
        return "Numerical error of the tracking errors: not known."
    worst = max(shares, key=lambda name: shares[name])
    return f"Numerical error of the tracking errors: at most {100.0 * shares[worst]:.2g} % ({worst})."


def _headline(result: StudyResult) -> str:
    name = result.recommendation.name
    if not name:
        return "No recommendation"
    return "Recommendation: no compensation" if name == "none" else f"Recommendation: {name}"
