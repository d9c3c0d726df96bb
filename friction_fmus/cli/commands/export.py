"""Write an identified axis for a drive or a simulator, or all friction models as one library.

RESULT is the folder that `friction-fmus study` or `friction-fmus identify` wrote, or a file in it. The sheet of a drive
states the parameters, where they are entered, and the tracking error that they reach in the simulation of the study.
"""

import argparse
from pathlib import Path
from typing import Any, Final

from friction_fmus.errors import FrictionError
from friction_fmus.export.targets import choose_target, targets

TAKES: Final = ("axis", "library")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    known = {name: target for takes in TAKES for name, target in targets(takes).items()}
    listing = "; ".join(f"{name}: {target.summary}" for name, target in known.items())
    parser.add_argument("result", nargs="?", type=Path, metavar="RESULT", help="result of a study or identification")
    parser.add_argument("--to", choices=known, required=True, help=f"what is written; {listing}")
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="folder for the files")
    parser.add_argument("--model", default="", metavar="NAME", help="friction model; default: the best of the result")
    for option in {option.name: option for target in known.values() for option in target.options}.values():
        kind: dict[str, Any] = {"metavar": option.metavar, "default": argparse.SUPPRESS}
        parser.add_argument(f"--{option.name}", dest=option.name.replace("-", "_"), help=option.help, **kind)


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
    names = {option.name for target in targets("axis").values() for option in target.options}
    target, given = choose_target(
        "axis", options.to, {name: value for name, value in vars(options).items() if name in names}
    )
    for path in target.write(read_axis(options.result, options.model), options.output, **given):
        console.print(str(path), soft_wrap=True)
