"""Generate C code of a compensator, or of a position loop, for an embedded target, with its cost.

The code has a struct of parameters and allocates no memory. A unit test and the cost on three microcontrollers are
included. The file of a loop, such as recommended/loop.toml of a study, joins servo, feedforward and compensator to one
function call per sample. The target st is Structured Text for a PLC instead: a function block, without a cost.
"""

import argparse
import re
from pathlib import Path

from friction_fmus.cli.arguments import add_set, add_target, completed, parse_assignments, target_options
from friction_fmus.export.targets import choose_target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    completed(
        parser.add_argument("law", metavar="LAW", help="name of a law, its .py file, or the .toml file of a loop")
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder for the files; default: NAME")
    add_set(parser)
    parser.add_argument(
        "--prefix", default="", metavar="NAME", help="prefix of files, types and functions; default: as the law's file"
    )
    add_target(parser, "law")


def run(options: argparse.Namespace) -> None:
    """Write the files and print their paths."""
    from friction_fmus.blocks.catalogue import find
    from friction_fmus.cli.console import console

    target, given = choose_target("law", options.target, target_options(options, "law"))
    start = parse_assignments(options.set)
    folder = options.output or Path(Path(options.law).stem)
    file = Path(options.law) if options.law.endswith(".toml") else find(options.law).path
    prefix = options.prefix or re.sub(r"\W", "_", file.stem)
    for path in target.write(options.law, folder, start=start, prefix=prefix, **given):
        console.print(str(path), soft_wrap=True)
    if remark := target.remark():
        console.print(remark, soft_wrap=True)
