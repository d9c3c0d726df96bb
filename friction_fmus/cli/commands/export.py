"""Write all friction models as one library."""

import argparse
from pathlib import Path

from friction_fmus.export.targets import targets


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    known = targets("library")
    listing = "; ".join(f"{name}: {target.summary}" for name, target in known.items())
    parser.add_argument("--to", choices=known, required=True, help=f"what is written; {listing}")
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR", help="folder for the library")


def run(options: argparse.Namespace) -> None:
    """Write the library and print its path."""
    print(targets("library")[options.to].write(options.output))
