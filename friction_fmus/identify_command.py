"""The command ``identify``: a log file, and the friction models that fit it."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from friction_fmus.errors import FrictionError
from friction_fmus.terminal import RunBar, console, parse_assignment, progress_bar, styled
from harness.processors import available

if TYPE_CHECKING:
    from friction_fmus.identification import Finding, Identification, Measurement, Record
    from friction_fmus.identification.survey import Survey

METHODS = ("auto", "inverse", "output-error", "hysteresis")
LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")
SHOWN = 3
"""Up to so many models have their parameters on the screen; of more only the best one."""


def add_identify_options(parser: argparse.ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument(
        "data",
        type=Path,
        metavar="DATA",
        help="a data file (.csv, .parquet, .mat, ...), or a mapping (.toml) that names one",
    )
    parser.add_argument("--mapping", type=Path, metavar="FILE", help=".toml that says what the columns of DATA are")
    parser.add_argument(
        "--model", action="append", required=True, metavar="NAME", help="a friction model, or all; may be repeated"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder for the results")
    window = {"nargs": 2, "type": float, "metavar": ("A", "B")}
    parser.add_argument("--train", help="fit from A to B seconds", **window)  # type: ignore[arg-type]
    parser.add_argument("--validation", help="predict from A to B seconds, and rank by that", **window)  # type: ignore[arg-type]
    parser.add_argument("--fixed", action="append", metavar="NAME=VALUE", help="a known parameter; may be repeated")
    parser.add_argument("--method", choices=METHODS, default="auto", help="auto: what suits the model")
    parser.add_argument("--loss", choices=LOSSES, default="linear", help="all but linear make little of outliers")
    parser.add_argument(
        "--workers",
        type=int,
        default=available(),
        metavar="N",
        help="processes side by side, by default as many as processors",
    )


def identify_models(options: argparse.Namespace) -> None:
    """Friction models that fit a log file: parameters with standard errors, ranked, as TOML, SSV, FMU and figures."""
    from friction_fmus.identification import examine_pieces, read_measurement
    from friction_fmus.identification.outcome import write_outcome
    from friction_fmus.identification.survey import Task, compare_models

    models = _models(options.model)
    if options.output.exists() and not options.output.is_dir():
        raise FrictionError(f"{options.output} is a file; give a folder for the results")
    measurement = read_measurement(options.data, options.mapping)
    windows = _windows(options, measurement)
    train, validation = (measurement.window(*windows[w]) if w in windows else () for w in ("train", "validation"))
    train = train or measurement.records
    findings = (*measurement.findings, *examine_pieces(train))
    _show_data(measurement, train, validation, findings)
    task = Task(
        train,
        validation,
        {name: float(value) for name, value in map(parse_fixed, options.fixed or ())},
        {"method": options.method, "loss": options.loss},
    )
    with progress_bar() as bar:
        found = compare_models(models, task, max(1, options.workers), RunBar(bar, "identifying").update)
    files = write_outcome(found, measurement, findings, windows, options.output)
    _show_ranking(found)
    for result in found.results if len(found.results) <= SHOWN else found.results[:1]:
        _show_parameters(result)
    if len(found.results) > SHOWN:
        console.print(f"\nThe parameters of the others are in {options.output / 'parameters.toml'}.", soft_wrap=True)
    for name, reason in found.failed.items():
        console.print(styled((name, "bold red"), f" was not identified: {reason}"), soft_wrap=True)
    console.print(f"{options.output}: {_listed(files)}", soft_wrap=True)


def parse_fixed(text: str) -> tuple[str, float | bool]:
    """Name and number of ``--fixed NAME=VALUE``.

    Raises
    ------
    FrictionError
        If it is none.
    """
    try:
        name, value = parse_assignment(text)
    except FrictionError as error:
        raise FrictionError(f"--fixed {text!r} is not NAME=VALUE with a number as VALUE") from error
    if not math.isfinite(value):
        raise FrictionError(f"--fixed {text!r} is not finite; give a number")
    return name, value


def _models(names: Sequence[str]) -> list[str]:
    """The models that are asked for, each once."""
    from friction_fmus.catalogue import find
    from friction_fmus.identification import identifiable

    if "all" in names:
        if len(names) > 1:
            raise FrictionError("--model all is already every model; leave the other names out")
        return list(identifiable())
    for name in names:
        find(name)
    return list(dict.fromkeys(names))


def _windows(options: argparse.Namespace, measurement: Measurement) -> dict[str, tuple[float, float]]:
    """Those of the command line, else those of the mapping."""
    from friction_fmus.identification import read_windows

    asked = {name: getattr(options, name) for name in ("train", "validation")}
    given = {name: pair for name, pair in asked.items() if pair is not None}
    return read_windows({**measurement.mapping.windows, **given}, "The command line")


def _show_data(
    measurement: Measurement, train: Sequence[Record], validation: Sequence[Record], findings: Sequence[Finding]
) -> None:
    def span(records: Sequence[Record]) -> str:
        samples = sum(map(len, records))
        return f"{records[0].t[0]:.4g} to {records[-1].t[-1]:.4g} s, {samples} samples"

    mapping, record = measurement.mapping, train[0]
    columns = ", ".join(f"{role} {c.column or c.period!r}" for role, c in mapping.columns.items())
    console.print(styled((mapping.name, "bold"), f": {columns}"), soft_wrap=True)
    text = f"fitted {span(train)} at {1e3 * record.Ts:.4g} ms; "
    text += f"validation {span(validation)}" if validation else "no validation window, so models are ranked by BIC"
    console.print(text, soft_wrap=True)
    for finding in findings:
        console.print(styled((finding.name, "yellow"), f" {finding.what}"), soft_wrap=True)
        console.print(f"  {finding.measure}", soft_wrap=True)


def _show_ranking(found: Survey) -> None:
    from friction_fmus.identification.picture import NAMES

    best = found.results[0]
    signal = NAMES.get(best.signal, best.signal)
    text = f"\nModels by {found.ranked_by}; errors are rms, in % of the rms of the {signal}"
    console.print(text, soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("model", no_wrap=True)
    table.add_column("method", no_wrap=True)
    unit = f" [{best.unit}]" if best.unit != "1" else ""
    for heading in (f"error{unit}", "fitted %", "validation %", "BIC", "weak", "time"):
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


def _show_parameters(result: Identification) -> None:
    console.print(styled("\n", (result.model, "bold")))
    table = Table(box=None, pad_edge=False)
    for heading, justify in (("parameter", "left"), ("value", "right"), ("standard error", "right"), ("unit", "left")):
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    table.add_column("")
    for name, estimate in result.parameters.items():
        error = f"{estimate.standard_error:.2g}" if math.isfinite(estimate.standard_error) else "not known"
        value = _digits(estimate.value, estimate.standard_error)
        mark = styled(("weak", "yellow")) if name in result.weak else ""
        table.add_row(name, value, error, _unit(estimate.unit), mark)
    console.print(table)
    for name, reason in result.weak.items():
        console.print(styled(("weak", "yellow"), f" {name}: {reason}"), soft_wrap=True)
    for warning in result.warnings:
        console.print(styled(("warning", "yellow"), f" {warning}"), soft_wrap=True)


def _digits(value: float, error: float) -> str:
    """A value with as many digits as its standard error leaves, 6 at most."""
    if not (math.isfinite(error) and error > 0.0 and value):
        return f"{value:.6g}"
    return f"{value:.{min(6, max(2, math.floor(math.log10(abs(value) / error)) + 3))}g}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _listed(files: Sequence[Path]) -> str:
    kinds: Mapping[str, list[str]] = {"fmu": [], "ssv": [], "png": []}
    others: list[str] = []
    for file in files:
        kinds.get(file.suffix[1:], others).append(file.name)
    counted = [f"{len(names)} {kind}" if len(names) > 2 else ", ".join(names) for kind, names in kinds.items() if names]
    return ", ".join([*others, *counted])
