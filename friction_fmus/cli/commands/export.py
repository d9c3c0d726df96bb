"""Write an identified axis for a drive or a simulator, or all friction models as one library.

RESULT is the folder that `friction-fmus study` or `friction-fmus identify` wrote, or a file in it. The sheet of a drive
states the parameters, where they are entered, and the tracking error that they reach in the simulation of the study.
"""

import argparse
from pathlib import Path

from friction_fmus.cli.arguments import add_target, target_options
from friction_fmus.errors import FrictionError
from friction_fmus.export.targets import choose_target, targets


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("result", nargs="?", type=Path, metavar="RESULT", help="result of a study or identification")
    add_target(parser, "axis", "library", flag="--to")
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="folder for the files")
    parser.add_argument("--model", default="", metavar="NAME", help="friction model; default: the best of the result")


def run(options: argparse.Namespace) -> None:
    """Write the files and print their paths."""
    from friction_fmus.cli.console import console
    from friction_fmus.export.identified_axis import read_axis

    if options.to in targets("library"):
        if options.result is not None or options.model:
            raise FrictionError(f"{options.to} contains all models, not one result; leave out RESULT and --model")
        console.print(str(targets("library")[options.to].write(options.output)), soft_wrap=True)
        return
    if options.result is None:
        raise FrictionError(f"{options.to} needs RESULT, the folder that friction-fmus study or identify wrote with -o")
    target, given = choose_target("axis", options.to, target_options(options, "axis"))
    for path in target.write(read_axis(options.result, options.model), options.output, **given):
        console.print(str(path), soft_wrap=True)
