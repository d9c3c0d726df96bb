"""The command line: ``friction-fmus`` or ``python -m friction_fmus``."""

from __future__ import annotations

import argparse
import io
import json
import logging
import sys
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.table import Table

from friction_fmus import sweep_command
from friction_fmus.check_command import add_check_options, check_files
from friction_fmus.codegen.command import add_codegen_options, codegen
from friction_fmus.doctor_command import add_doctor_options, examine_system
from friction_fmus.errors import FrictionError
from friction_fmus.identify_command import add_identify_options, identify_models
from friction_fmus.run_command import add_run_options, run_system
from friction_fmus.study_command import add_study_options, study
from friction_fmus.terminal import console, parse_assignment, progress_bar
from friction_fmus.version import VERSION
from harness import HarnessError


def list_blocks(options: argparse.Namespace) -> None:
    """All blocks that can be built."""
    from friction_fmus.catalogue import catalogue

    blocks = catalogue().values()
    if options.json:
        fields = ("name", "kind", "summary", "source")
        print(json.dumps([{field: getattr(block, field) for field in fields} for block in blocks], indent=2))
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("name", "kind", "what it is"):
        table.add_column(heading)
    for block in blocks:
        table.add_row(block.name, block.kind, block.summary)
    console.print(table)


def show(options: argparse.Namespace) -> None:
    """What a block is, when to use it, what it cannot do, its equations and variables."""
    from friction_fmus.catalogue import find
    from friction_fmus.package import describe_block
    from friction_fmus.show import show_block

    block = find(options.name)
    show_block(console, block, describe_block(block))


def cite(options: argparse.Namespace) -> None:
    """BibTeX entries of a block's sources."""
    from friction_fmus.catalogue import find

    block = find(options.name)
    if not block.bibtex:
        raise FrictionError(f"{block.name} has no BibTeX entry; its source is: {block.source}")
    print("\n\n".join(block.bibtex))


def build_blocks(options: argparse.Namespace) -> None:
    """FMUs of the named blocks, or of all."""
    from friction_fmus.catalogue import catalogue
    from friction_fmus.package import build

    if options.all == bool(options.names):
        raise FrictionError("Say what to build: names of models (`friction-fmus list` shows them) or --all")
    names = list(catalogue()) if options.all else options.names
    start = dict(parse_assignment(text) for text in options.set or ())
    if start and len(names) != 1:
        raise FrictionError(f"--set goes with one model, not with {len(names)}; build them one by one")
    with progress_bar() as bar:
        for name in bar.track(names, description="building"):
            path = build(name, options.output, start, options.name, domain=options.domain, platforms=options.platform)
            bar.console.print(str(path), soft_wrap=True) if bar.console.is_terminal else print(path)


def parser() -> argparse.ArgumentParser:
    """All commands and options."""
    top = argparse.ArgumentParser(
        prog="friction-fmus",
        description="Friction models and friction compensators as FMI 2.0 co-simulation FMUs.",
    )
    top.add_argument("--version", action="version", version=f"friction-fmus {VERSION}")
    top.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def command(name: str, action: Callable[[argparse.Namespace], int | None], text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=text, description=textwrap.dedent(action.__doc__ or text))
        added.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
        added.set_defaults(action=action)
        return added

    listing = command("list", list_blocks, "show all models, laws, plants and signals")
    listing.add_argument("--json", action="store_true", help="as JSON: name, kind, summary, source")
    showing = command("show", show, "show when to use a model, its limits, equations and variables")
    showing.add_argument("name", metavar="NAME", help="name of a model, or its .c or .py file")
    citing = command("cite", cite, "print the BibTeX entries of a model's sources")
    citing.add_argument("name", metavar="NAME", help="name of a model, or its .c or .py file")
    building = command("build", build_blocks, "build FMUs")
    building.add_argument("names", nargs="*", metavar="NAME", help="name of a model, or its .c or .py file")
    building.add_argument("--all", action="store_true", help="build all")
    building.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="folder for the FMUs")
    building.add_argument("--set", action="append", metavar="NAME=VALUE", help="other start value; may be repeated")
    domains = ("translational", "rotational")
    building.add_argument("--domain", choices=domains, default=domains[0], help="rotational: N.m, rad, kg.m2")
    building.add_argument(
        "--platform",
        nargs="+",
        default=["native"],
        metavar="PLATFORM",
        help="native (default), all, or folders of an FMU such as win64",
    )
    building.add_argument("--name", metavar="IDENTIFIER", help="other model identifier and file name")
    checking = command("check", check_files, "look for faults in FMUs, also other people's")
    add_check_options(checking)
    examining = command("doctor", examine_system, "look for what makes a closed loop with friction fail")
    add_doctor_options(examining)
    running = command("run", run_system, "run a system of FMUs")
    add_run_options(running)
    generating = command("codegen", codegen, "write a law as C for an embedded target, with its cost")
    add_codegen_options(generating)
    sweeping = command("sweep", sweep_command.sweep_system, "run a system of FMUs with many parameter sets")
    sweep_command.add_arguments(sweeping)
    identifying = command("identify", identify_models, "find the friction models that fit a log file")
    add_identify_options(identifying)
    studying = command("study", study, "identify a measured axis, co-simulate it, and find the compensator that pays")
    add_study_options(studying)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Returns
    -------
    int
        0, 1 if `check` or `doctor` has findings, all runs of `sweep` fail or a result is reported as wrong, 2 if the
        command could not be done, 130 if it was interrupted.
    """
    options = parser().parse_args(arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # for names of files that are no UTF-8
    logging.basicConfig(level=logging.WARNING, format="%(name)s: %(message)s")
    try:
        return options.action(options) or 0
    except (FrictionError, HarnessError, OSError) as error:
        if options.debug:
            raise
        # what a library says of a damaged file may have several lines
        print(f"friction-fmus: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        print(f"friction-fmus: {str(error) or 'interrupted'}", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
