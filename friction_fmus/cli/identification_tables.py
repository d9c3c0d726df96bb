"""The results of ``identify`` as text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from friction_fmus.cli.console import console, styled
from friction_fmus.identification import (
    AxisUnits,
    Finding,
    Identification,
    LearnedResidual,
    Measurement,
    Record,
)
from friction_fmus.identification.fit.position import PositionFit
from friction_fmus.identification.result import name_of
from friction_fmus.identification.survey import ModelComparison


def show_data(
    measurement: Measurement, train: Sequence[Record], validation: Sequence[Record], findings: Sequence[Finding]
) -> None:
    """Print training data, validation data and findings."""

    def span(records: Sequence[Record]) -> str:
        samples = sum(map(len, records))
        return f"{records[0].t[0]:.4g} to {records[-1].t[-1]:.4g} s, {samples} samples"

    mapping, record = measurement.mapping, train[0]
    columns = ", ".join(f"{role} {c.column or c.period!r}" for role, c in mapping.columns.items())
    console.print(styled((mapping.name, "bold"), f": {columns}"), soft_wrap=True)
    text = f"training data {span(train)} at {1e3 * record.Ts:.4g} ms; "
    text += f"validation data {span(validation)}" if validation else "no validation data, so models are ranked by BIC"
    console.print(text, soft_wrap=True)
    for finding in findings:
        console.print(styled((finding.name, "yellow"), f" {finding.what}"), soft_wrap=True)
        console.print(f"  {finding.measure}", soft_wrap=True)


def show_ranking(found: ModelComparison) -> None:
    """Print the ranked models as a table."""
    best = found.results[0]
    signal = name_of(best)
    text = f"\nModels by {found.ranked_by}; errors are rms values, also in % of the rms of the {signal}"
    console.print(text, soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("model", no_wrap=True)
    table.add_column("method", no_wrap=True)
    unit = f"\n[{best.unit}]" if best.unit != "1" else ""
    for heading in (f"error{unit}", "training\n[%]", "validation\n[%]", "BIC", "poorly\nident.", "time"):
        table.add_column(heading, justify="right", no_wrap=True)
    for result in found.results:
        table.add_row(
            result.model,
            result.method,
            f"{(result.validation or result.train).rms:.4g}",
            f"{result.train.relative_percent:.2f}",
            f"{result.validation.relative_percent:.2f}" if result.validation else "",
            f"{result.bic:.0f}",
            f"{len(result.weak)}/{len(result.parameters)}" if result.weak else "",
            f"{result.seconds:.1f} s",
        )
    console.print(table)


def show_parameters(result: Identification) -> None:
    """Print the parameters of a model with their standard errors."""
    console.print(styled("\n", (result.model, "bold")))
    table = Table(box=None, pad_edge=False)
    for heading, justify in (("parameter", "left"), ("value", "right"), ("standard error", "right"), ("unit", "left")):
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    table.add_column("")
    for name, estimate in result.parameters.items():
        error = f"{estimate.standard_error:.2g}" if math.isfinite(estimate.standard_error) else "unknown"
        value = _digits(estimate.value, estimate.standard_error)
        mark = styled(("poorly identifiable", "yellow")) if name in result.weak else ""
        table.add_row(name, value, error, _unit(estimate.unit), mark)
    console.print(table)
    if result.position is not None:
        console.print(_position_text(result.position, result.records[0].units), soft_wrap=True)
    for name, reason in result.weak.items():
        console.print(styled((name, "yellow"), f" is poorly identifiable: {reason}"), soft_wrap=True)
    for warning in result.warnings:
        console.print(styled(("warning", "yellow"), f" {warning}"), soft_wrap=True)


def show_residual(result: Identification, learned: LearnedResidual | None) -> None:
    """Print the errors of a model with and without its learned residual."""
    if learned is None:
        console.print(f"residual of {result.model}: none, as no table reduces the error in cross-validation by 2 %")
        return
    unit = f" {_unit(result.unit)}".rstrip()
    over = "velocity, position and direction" if learned.over_position else "velocity and direction"
    windows = {
        "cross-validation": (learned.crossed, learned.crossed_without),
        "validation": (learned.validation, learned.validation_without),
    }
    errors = ", ".join(
        f"{name} {error:.4g}{unit}, without it {without:.4g}{unit}"
        for name, (error, without) in windows.items()
        if math.isfinite(error)
    )
    console.print(
        f"residual of {result.model} over {over}, at most {learned.table.R_max:.3g} "
        f"{result.records[0].units.force}: error in {errors}",
        soft_wrap=True,
    )


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


def _digits(value: float, error: float) -> str:
    """Return a value with the digits that its standard error justifies, at most 6."""
    if not (math.isfinite(error) and error > 0.0 and value):
        return f"{value:.6g}"
    return f"{value:.{min(6, max(2, math.floor(math.log10(abs(value) / error)) + 3))}g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
