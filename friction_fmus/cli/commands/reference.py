"""Build the reference set for tools that import FMUs, or run it in a tool.

The exit status of `reference run` is 1 if a case is failed or inaccurate.
"""

import argparse
from pathlib import Path

from friction_fmus.errors import FrictionError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("action", choices=("build", "run"), metavar="ACTION", help="build or run")
    parser.add_argument("folder", nargs="?", type=Path, metavar="DIR", help="run: the folder of the set")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="build: folder for the set")
    parser.add_argument("--case", action="append", metavar="NAME", help="only this case; may be repeated")
    text = "build: native (default), all, or FMI platform names such as win64"
    parser.add_argument("--platform", nargs="+", default=["native"], metavar="PLATFORM", help=text)
    text = "run: fmpy, harness, or a command with {fmu} {case} {inputs} {output} {start} {stop} {step} {tolerance}"
    parser.add_argument("--tool", metavar="TOOL", help=text)
    parser.add_argument("--results", type=Path, metavar="DIR", help="run: folder with NAME.csv that a tool has written")
    parser.add_argument("--name", metavar="NAME", help="run: name of the tool in the tables; default: its first word")
    text = "run: a need of cases that the tool does not meet, such as me or fmi3 (needs in case.toml); may be repeated"
    parser.add_argument("--lacks", action="append", default=[], metavar="NEED", help=text)
    text = "run: time limit for each case [s]; default: that of the case, 10 s or 60 s"
    parser.add_argument("--timeout", type=float, metavar="S", help=text)


def run(options: argparse.Namespace) -> int:
    """Build or run the set."""
    if options.action == "run":
        return _run(options)
    from friction_fmus.cli.console import progress_bar
    from friction_fmus.reference.case import CASES, read_cases
    from friction_fmus.reference.set_builder import build_case

    if options.output is None or options.folder or options.tool or options.results:
        raise FrictionError("give `reference build` a folder for the set with -o, and no options of `reference run`")
    with progress_bar() as bar:
        for case in bar.track(read_cases(CASES, options.case), description="building"):
            print(build_case(case, options.output, options.platform))
    return 0


def _run(options: argparse.Namespace) -> int:
    from friction_fmus.cli.console import progress_bar
    from friction_fmus.reference.case import read_cases
    from friction_fmus.reference.tool_runs import FAILED, INACCURATE, run_case, write_junit, write_page
    from harness.storage.files import make_folder

    if not options.folder or options.output or bool(options.tool) == bool(options.results):
        raise FrictionError("give `reference run` the folder of a set, and either --tool or --results")
    name = Path(options.name or (options.tool.split()[0] if options.tool else options.results)).name
    given = {"results": options.results, "lacks": options.lacks, "time_limit": options.timeout}
    cases, folder, verdicts = read_cases(options.folder, options.case), options.folder / "results" / name, []
    make_folder(folder)
    with progress_bar() as bar:
        for case in bar.track(cases, description=name):
            verdicts.append(verdict := run_case(case, options.tool or "", folder, **given))
            bar.console.print(f"{case.name}: {verdict.state} ({verdict.detail})", soft_wrap=True)
    write_junit(verdicts, name, folder)
    print(write_page(read_cases(options.folder), options.folder))
    return 1 if any(verdict.state in (FAILED, INACCURATE) for verdict in verdicts) else 0
