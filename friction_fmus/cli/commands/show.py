"""Show use, limits, equations and variables of a model."""

from __future__ import annotations

import argparse

from friction_fmus.cli.arguments import add_block


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_block(parser)


def run(options: argparse.Namespace) -> None:
    """Print the page."""
    from friction_fmus.blocks.catalogue import find
    from friction_fmus.cli.block_page import show_block
    from friction_fmus.cli.console import console
    from friction_fmus.export.block_fmu import describe_block

    block = find(options.name)
    show_block(console, block, describe_block(block))
