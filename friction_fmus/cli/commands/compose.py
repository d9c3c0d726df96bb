"""Write a system as one FMU, which solves the loops between its parts."""

import argparse
import sys
from pathlib import Path

from friction_fmus.cli.arguments import add_fmu_target, add_system, target_options
from friction_fmus.export.targets import choose_target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_system(parser)
    text = "the FMU to write, or the folder for wasm32; default: SYSTEM.fmu or SYSTEM-wasm in this folder"
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=text)
    parser.add_argument("--name", metavar="IDENTIFIER", help="model identifier; default: the name of the file")
    parser.add_argument("--step", type=float, metavar="H", help="step inside the FMU [s]; default: the system's step")
    parser.add_argument("--master", metavar="NAME", help="master algorithm inside the FMU: newton or adaptive")
    parser.add_argument("--inputs", nargs="*", metavar="PART.PORT", help="inputs; default: all unconnected inputs")
    parser.add_argument("--outputs", nargs="*", metavar="PATTERN", help="outputs; default: all")
    add_fmu_target(parser)


def run(options: argparse.Namespace) -> None:
    """Write the FMU and print its path."""
    from friction_fmus.cli.console import announce, progress_bar
    from friction_fmus.cli.inputs import open_system
    from harness.masters import best_first

    given = target_options(options, "fmu")
    target, _ = choose_target("fmu", options.target, given, options.platform)
    output = options.output or Path(options.system.stem + target.ending)
    with open_system(options.system, open_inputs=True) as system, progress_bar() as bar:
        announce(bar, bar.add_task("", total=None), f"compiling {output}", foreign=" ".join(options.platform))
        system.to_fmu(
            output,
            name=options.name,
            step=options.step,
            master=options.master,
            inputs=options.inputs,
            outputs=options.outputs,
            platforms=options.platform,
            target=options.target,
            **given,
        )
        composed = best_first(lambda master: master.composed)
        replaced = system.experiment.master if system.experiment and not options.master else composed[0]
    print(output)
    if replaced not in composed:
        print(f"the FMU contains the master {composed[0]} in place of {replaced}; --master chooses", file=sys.stderr)
