"""Identify friction models from a log file.

The models are ranked. Their parameters with standard errors are written as TOML, SSV and FMU, with figures.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.cli.arguments import add_column_options, add_json, add_workers, parse_assignment, print_json
from friction_fmus.errors import FrictionError
from friction_fmus.identification.methods import method_names
from harness.processors import available

if TYPE_CHECKING:
    from friction_fmus.identification import Measurement

LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")
SHOWN = 3  # most models whose parameters are all printed; with more models, only those of the best are


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "data",
        type=Path,
        nargs="+",
        metavar="DATA",
        help="data file (.csv, .parquet, .mat, ...), several of one axis, or a mapping or configuration (.toml)",
    )
    add_column_options(parser)
    parser.add_argument("--mapping", type=Path, metavar="FILE", help="mapping of the columns of DATA (.toml)")
    parser.add_argument(
        "--model", action="append", metavar="NAME", help="friction model, or all (default); may be repeated"
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("identified"), metavar="DIR", help="folder; default: identified"
    )
    add_json(parser)
    window = {"nargs": 2, "type": float, "metavar": ("A", "B")}
    parser.add_argument("--train", help="training data from A to B seconds", **window)  # type: ignore[arg-type]
    parser.add_argument("--validation", help="validation data from A to B seconds", **window)  # type: ignore[arg-type]
    parser.add_argument("--fixed", action="append", metavar="NAME=VALUE", help="known parameter; may be repeated")
    methods = ("auto", *method_names())
    parser.add_argument("--method", choices=methods, default="auto", help="method; auto selects it by the model")
    parser.add_argument(
        "--loss", choices=LOSSES, default="linear", help="loss function; all except linear are robust against outliers"
    )
    parser.add_argument(
        "--position-map",
        action="store_true",
        help="identify cogging and position-dependent friction with each model, if this improves the prediction",
    )
    parser.add_argument(
        "--force", action="store_true", help="write FMUs although the drive force contradicts the motion"
    )
    parser.add_argument(
        "--terms",
        metavar="LIST",
        help="what acts beside the models: auto, or a list such as gravity,load (also sides, direction, drift, "
        "temperature, gain)",
    )
    parser.add_argument("--viscous", action="store_true", help="add viscous friction (Fv) to models that have none")
    add_workers(parser)


def run(options: argparse.Namespace) -> int:
    """Identify the models, write the files and print the ranking."""
    from friction_fmus.cli import axis_tables as tables
    from friction_fmus.cli.axis_tables import read_asking
    from friction_fmus.cli.console import RunBar, console, progress_bar, styled
    from friction_fmus.identification import DataMapping
    from friction_fmus.identification.data.excitation import examine_segments
    from friction_fmus.identification.data.reading import default_windows
    from friction_fmus.identification.fit.contact_model import contact_model
    from friction_fmus.identification.force_findings import FORBIDDING, contradictions, stuck
    from friction_fmus.identification.model_comparison import IdentificationTask, compare_models, long_enough
    from friction_fmus.identification.plant_candidates import plant_findings
    from friction_fmus.identification.result_files import write_results

    data = options.data[0]
    models = _models(options.model or _configured(data))
    if options.output.exists() and not options.output.is_dir():
        raise FrictionError(f"{options.output} is a file; choose a folder for the results")
    if options.mapping and (options.columns or options.gain or len(options.data) > 1):
        raise FrictionError("--mapping describes one file by itself; omit --columns, --gain and further files")
    given = options.mapping or DataMapping(
        data, option=options.columns, gain=options.gain, more=tuple(options.data[1:])
    )
    measurement = read_asking(data, None if data.suffix.lower() == ".toml" else given)
    tables.show_understood(measurement)
    tables.show_first_look(measurement.records)  # before anything takes time
    windows = _windows(options, measurement) or default_windows(measurement.records)
    train = long_enough(measurement.window(*windows["train"]))
    validation = long_enough(measurement.window(*windows["validation"])) if "validation" in windows else ()
    if measurement.static:
        models = [name for name in models if contact_model(name, train[0].units).static]
        if not models:
            raise FrictionError(f"{data} shows friction over velocity only; choose static models, such as Stribeck")
    about = () if measurement.static else (*examine_segments(train), *contradictions(train), stuck(train))
    findings = (*measurement.findings, *(finding for finding in about if finding is not None))
    if not measurement.static and not any(finding.name in FORBIDDING for finding in findings):
        findings += plant_findings(measurement.records)[0]
    wrong = [finding.name for finding in findings if finding.name in FORBIDDING]
    tables.show_data(train, validation, findings)
    task = IdentificationTask(
        train,
        validation,
        {name: float(value) for name, value in map(parse_fixed, options.fixed or ())},
        {
            "method": options.method,
            "loss": options.loss,
            "position_map": options.position_map,
            "viscous": options.viscous,
            "terms": "auto"
            if options.terms == "auto"
            else tuple(options.terms.replace(" ", "").split(","))
            if options.terms
            else (),
        },
    )
    workers = available() if options.workers is None else max(1, options.workers)
    with progress_bar() as bar:
        progress = RunBar(bar, "identifying").update
        found = compare_models(models, task, workers, progress, lambda each: tables.show_ready(bar, each))
    known = train[0].units.known
    fmus = known and (options.force or not wrong)
    files = write_results(found, measurement, findings, windows, options.output, fmus=fmus)
    tables.show_ranking(found)
    for result in found.results if len(found.results) <= SHOWN else found.results[:1]:
        tables.show_parameters(result)
    if len(found.results) > SHOWN:
        console.print(
            f"\nThe parameters of the other models are in {options.output / 'parameters.toml'}.", soft_wrap=True
        )
    for name, reason in found.failed.items():
        console.print(styled((name, "bold red"), f" was not identified: {reason}"), soft_wrap=True)
    console.print(f"{options.output}: {_listed(files)}", soft_wrap=True)
    if not known:
        own = train[0].units.results
        text = f"No FMU was written, as the results are in {own}; give the scales with --gain and --columns."
        console.print(text, soft_wrap=True)
    if wrong:
        less = "" if options.force else " No FMU was written; --force writes them."
        console.print(styled((f"The parameters cannot be used: {', '.join(wrong)}.", "bold red"), less), soft_wrap=True)
    if options.json:
        print_json(options, json.loads((options.output / "identification.json").read_text(encoding="utf-8")))
    return 1 if wrong else 0


def parse_fixed(text: str) -> tuple[str, float | bool]:
    """Return name and value of ``--fixed NAME=VALUE``."""
    try:
        name, value = parse_assignment(text)
    except FrictionError as error:
        raise FrictionError(f"--fixed {text!r} is not NAME=VALUE; use a number as VALUE") from error
    if isinstance(value, str) or not math.isfinite(value):
        raise FrictionError(f"--fixed {text!r} is not finite; use a finite number")
    return name, value


def _configured(path: Path) -> list[str]:
    """Return the models in the table ``[identify]`` of a configuration; all without one."""
    if path.suffix.lower() != ".toml" or not path.is_file():
        return ["all"]
    from friction_fmus.study.config import read_models

    return read_models(path)


def _models(names: Sequence[str]) -> list[str]:
    """Return the requested models without duplicates."""
    from friction_fmus.blocks.catalogue import find
    from friction_fmus.identification import identifiable

    if "all" in names:
        if len(names) > 1:
            raise FrictionError("--model all selects every model; remove the other names")
        return list(identifiable())
    for name in names:
        find(name)
    return list(dict.fromkeys(names))


def _windows(options: argparse.Namespace, measurement: Measurement) -> dict[str, tuple[float, float]]:
    """Return the windows of the command line, and those of the mapping that it does not replace."""
    from friction_fmus.identification.data.mapping import read_windows

    asked = {name: getattr(options, name) for name in ("train", "validation")}
    given = {name: pair for name, pair in asked.items() if pair is not None}
    return read_windows({**measurement.mapping.windows, **given}, "The command line")


def _listed(files: Sequence[Path]) -> str:
    kinds: Mapping[str, list[str]] = {"fmu": [], "ssv": [], "png": []}
    others: list[str] = []
    for file in files:
        kinds.get(file.suffix[1:], others).append(file.name)
    counted = [f"{len(names)} {kind}" if len(names) > 2 else ", ".join(names) for kind, names in kinds.items() if names]
    return ", ".join([*others, *counted])
