"""Print the BibTeX entries of a model's sources."""

from __future__ import annotations

import argparse

from friction_fmus.cli.arguments import add_block
from friction_fmus.errors import FrictionError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_block(parser)


def run(options: argparse.Namespace) -> None:
    """Print the entries.

    Raises
    ------
    FrictionError
        If the block has no BibTeX entry.
    """
    from friction_fmus.blocks.catalogue import find

    block = find(options.name)
    if not block.bibtex:
        raise FrictionError(f"{block.name} has no BibTeX entry; its source is: {block.source}")
    print("\n\n".join(block.bibtex))
