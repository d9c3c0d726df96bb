"""The results of ``identify`` as text for the terminal, and its question about columns that several guesses fit."""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

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
from friction_fmus.identification.fit.idim import first_look
from friction_fmus.identification.fit.position import PositionFit
from friction_fmus.identification.identification_result import name_of
from friction_fmus.identification.model_comparison import ModelComparison
from friction_fmus.listings import parameter_listing, ranking_listing


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
        console.print(styled(("first look", "bold"), f" (least squares over sliding): {values}"), soft_wrap=True)


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
