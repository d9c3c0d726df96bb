"""List all models, laws, plants and signals."""

from __future__ import annotations

import argparse
import json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--json", action="store_true", help="print JSON: name, kind, summary, source")


def run(options: argparse.Namespace) -> None:
    """Print a table or JSON."""
    from friction_fmus.blocks.catalogue import listing

    if options.json:
        fields = ("name", "kind", "summary", "source")
        print(
            json.dumps([{field: getattr(entry, field) for field in fields} for entry in listing().values()], indent=2)
        )
        return

    from friction_fmus.cli.console import console, drawn
    from harness.notebook import Listing

    rows = [(entry.name, entry.kind, entry.summary) for entry in listing().values()]
    console.print(drawn(Listing("", ("name", "kind", "summary"), rows), title=False))
