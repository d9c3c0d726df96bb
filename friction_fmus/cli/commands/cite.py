"""Print the BibTeX entries of the literature of models."""

import argparse

from friction_fmus.cli.arguments import completed
from friction_fmus.errors import FrictionError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = "name of a model, or its .c or .py file; without a name, the entries of all models are printed"
    completed(parser.add_argument("names", metavar="NAME", nargs="*", help=text))


def run(options: argparse.Namespace) -> None:
    """Print the entries, each once."""
    from friction_fmus.blocks.block_declarations import bibliography
    from friction_fmus.blocks.catalogue import find

    entries = [] if options.names else list(bibliography().values())
    for name in options.names:
        block = find(name)
        if not block.bibtex:
            raise FrictionError(f"{block.name} has no BibTeX entry; its source is: {block.source}")
        entries += block.bibtex
    print("\n\n".join(dict.fromkeys(entries)))
