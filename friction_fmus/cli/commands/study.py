"""Identify a measured axis, co-simulate it, and recommend a compensator.

The study ranks friction models and compensators. It writes a report, and the recommended compensator as FMU and C code.
The exit status is 1 if the result cannot be trusted: then no compensator is ranked and no FMU is written.
"""

import argparse
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from friction_fmus.cli.arguments import add_column_options, add_json, add_scheduler, add_workers, print_json
from friction_fmus.errors import FrictionError
from harness.extras import require


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "config",
        nargs="+",
        metavar="CONFIG",
        help="configuration (.toml), data file (.csv, .mat, ...) with units in its headings, or one of emps, "
        "tribometer, demo; several data files are fitted together",
    )
    add_column_options(parser)
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="output folder; resumes an interrupted study (default: out)"
    )
    parser.add_argument(
        "--init",
        action="store_true",
        help="only write the configuration study.toml for a data file; asks for missing information",
    )
    add_json(parser)
    where = parser.add_mutually_exclusive_group()
    add_workers(where)
    add_scheduler(where)
    parser.add_argument(
        "--force", action="store_true", help="simulate and write FMUs although the result cannot be trusted"
    )
    parser.add_argument(
        "--full",
        action="store_true",
        help="try all friction models and compensators, not only the best-known ones; takes several times longer",
    )
    parser.add_argument(
        "--verify",
        metavar="AFTER",
        type=Path,
        help="compare the study in the output folder with a record that was taken with the recommended compensator",
    )
    parser.add_argument("--fresh", action="store_true", help="ignore cached steps and start from the beginning")


def run(options: argparse.Namespace) -> int:
    """Run the study and print its results."""
    if options.init:
        from friction_fmus.cli.study_questions import write_configuration

        write_configuration(Path(options.config[0]), options.output or Path())
        return 0
    if options.verify:
        return _verify(options)
    require("plotly", "the report of a study needs it")
    from friction_fmus.cli.axis_tables import read_asking, show_first_look, show_study, show_understood
    from friction_fmus.cli.console import RunBar, console, progress_bar
    from friction_fmus.cli.inputs import connect
    from friction_fmus.identification import DataMapping
    from friction_fmus.study.config import ALL, RECORDS, StudyConfig, load_config
    from friction_fmus.study.settings_file import SETTINGS_FILE
    from friction_fmus.study.steps import clear_cache
    from friction_fmus.study.study import STAGES, run_study

    config, *more = options.config
    what = config if config in RECORDS else load_config(config)
    if isinstance(what, StudyConfig) and what.bare:
        asked = DataMapping(Path(config), option=options.columns, gain=options.gain, more=tuple(map(Path, more)))
        measurement = read_asking(Path(config), asked)
        show_understood(measurement)
        show_first_look(measurement.records)
        what = replace(what, measurement=measurement)
    elif more or options.columns or options.gain:
        raise FrictionError(f"{config} is a configuration; --columns, --gain and further files are for data files")
    if options.full:
        what = load_config(what) if isinstance(what, str) else what
        what = replace(what, models=ALL, compensation=replace(what.compensation, compensators=ALL))
    output = options.output or Path("out")
    if options.fresh:
        clear_cache(output)
    with ExitStack() as stack:
        executor: Any = None
        if options.scheduler:
            executor = stack.enter_context(connect(options.scheduler)).get_executor(pure=False)
        bar = stack.enter_context(progress_bar())
        try:
            result = run_study(
                what,
                output,
                executor=executor,
                processes=options.workers,
                progress=RunBar(bar, "study", STAGES),
                force=options.force,
            )
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt("interrupted; run the same command again to resume") from error
    show_study(console, result)
    if not options.full:
        console.print("Only the best-known models and laws were tried, or those of the settings; --full tries all.")
    what = {
        "report.html": "Report",
        "recommended": "Recommended compensator",
        SETTINGS_FILE: "Settings; correct the controller in [servo] there"
        if result.plant
        else "Settings; add the controller to [servo] there to compare compensators",
    }
    for name, text in what.items():
        if any(file.path.partition("/")[0] == name for file in result.files):
            console.print(f"{text}: {output / name}", soft_wrap=True)
    if options.json:
        names = ("recommendation", "findings", "conditions", "servo_check")
        fields = ("name", "kind", "rank", "improves", "gain", "bandwidth", "metrics", "margins", "worst", "reason")
        rows = [{field: getattr(row, field) for field in fields} for row in result.compensators]
        models = [{"name": row.name, "rank": row.rank, "parameters": row.parameters} for row in result.models]
        summary = {name: getattr(result, name) for name in names}
        print_json(options, summary | {"models": models, "compensators": rows})
    return 0 if result.trusted else 1


def _verify(options: argparse.Namespace) -> int:
    """Print claimed and measured error; the status is 1 if the claim did not come true."""
    from friction_fmus.cli.axis_tables import show_verification
    from friction_fmus.cli.console import console
    from friction_fmus.identification import DataMapping, read_measurement
    from friction_fmus.identification.data.mapping import read_mapping
    from friction_fmus.study.config import load_config
    from friction_fmus.study.settings_file import SETTINGS_FILE
    from friction_fmus.study.verification import verify

    output = options.output or Path("out")
    config = load_config(options.config[0])
    if config.bare and (output / SETTINGS_FILE).exists():  # the study wrote columns and servo of a data file there
        config = load_config(output / SETTINGS_FILE)
    if config.record or config.bare or options.columns or options.gain:
        mapping = DataMapping(options.verify, option=options.columns, gain=options.gain)
    else:
        before = read_mapping(config.data, config.folder, config.name)
        mapping = replace(before, file=options.verify, windows={}, more=())
    found = verify(output, read_measurement(mapping).records, config.servo)
    show_verification(console, found)
    if options.json:
        print_json(options, asdict(found) | {"came_true": found.came_true})
    return 0 if found.came_true else 1
