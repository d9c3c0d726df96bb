"""List friction models, plants, compensators and signals."""

import argparse
import os
import shutil
import textwrap

from friction_fmus.blocks import FAMILIES, KINDS
from friction_fmus.cli.arguments import add_json, print_json
from friction_fmus.errors import visible

_CHOICES = tuple(dict.fromkeys((*KINDS.values(), *FAMILIES.values())))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f"only this kind, or this family of compensators: {', '.join(_CHOICES)}"
    parser.add_argument("kind", nargs="?", choices=_CHOICES, metavar="KIND", help=text)
    parser.add_argument("--search", default="", metavar="WORD", help="word in name, summary or source")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print a table for each kind, or JSON; return 1 if there is no such block."""
    from friction_fmus.blocks.catalogue import listing

    word = options.search.lower()
    entries = [
        entry
        for entry in listing().values()
        if options.kind in (None, entry.kind, entry.family)
        and word in f"{entry.name} {entry.summary} {entry.source}".lower()
    ]
    if options.json:
        fields = ("name", "kind", "family", "summary", "source")
        print_json(options, [{field: getattr(entry, field) for field in fields} for entry in entries])
        return int(not entries)

    width = max((len(entry.name) for entry in entries), default=0) + 2
    bold, plain = ("\033[1m", "\033[0m") if options.stdout.isatty() and "NO_COLOR" not in os.environ else ("", "")
    room = max(shutil.get_terminal_size().columns - width, 20)
    groups = [(kind, family) for kind in KINDS.values() for family in ("", *FAMILIES.values())]
    for group in groups:
        rows = [entry for entry in entries if (entry.kind, entry.family) == group]
        if rows:
            print(f"{bold}{', '.join(filter(None, group))}{plain}")
        for entry in rows:
            print(entry.name.ljust(width) + f"\n{'':{width}}".join(textwrap.wrap(visible(entry.summary), room)))
    if not entries:
        print(f"no block matches {options.search!r}")
    return int(not entries)
