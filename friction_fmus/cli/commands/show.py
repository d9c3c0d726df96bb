"""Show use, limits, equations and variables of a model."""

import argparse
from dataclasses import asdict

from friction_fmus.cli.arguments import add_block, add_json, print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_block(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> None:
    """Print the page."""
    from friction_fmus.blocks.catalogue import find
    from friction_fmus.blocks.probe import variable_groups
    from friction_fmus.export.block_fmu import describe_block

    block = find(options.name)
    variables = describe_block(block)
    if options.json:
        fields = ("name", "kind", "family", "summary", "notes", "source", "features", "bibtex")
        groups = {title: [asdict(each) for each in rows] for title, rows in variable_groups(variables).items()}
        print_json(options, {field: getattr(block, field) for field in fields} | {"variables": groups})
        return
    from friction_fmus.cli.block_page import show_block
    from friction_fmus.cli.console import console

    show_block(console, block, variables)
