"""The figures of all effects in examples/compensation, with the bounds that they must keep, in full.

``--csv examples/compensation/figures.csv`` writes the file with which the tests compare.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:1] = [str(ROOT), str(ROOT / "examples"), str(ROOT / "examples" / "compensation")]

import argparse
import json
import tempfile
from dataclasses import asdict
from importlib import import_module
from typing import TYPE_CHECKING

import figures
from page import scripts, title
from rich.console import Console
from rich.progress import track
from rich.table import Table

if TYPE_CHECKING:
    from _effect import Check, Effect


def figure(effect: str, check: Check) -> figures.Figure:
    """Return a line of the file."""
    value = f"{check.value:.4g}" if check.reproducible else ""
    return figures.Figure(effect, check.name, value, check.unit, check.bounds)


def show(found: dict[str, Effect]) -> None:
    """Print the table."""
    table = Table(title="Effects", title_justify="left")
    for heading, side in (("", "left"), ("value", "right"), ("unit", "left"), ("bounds", "left"), ("", "left")):
        table.add_column(heading, justify=side)  # type: ignore[arg-type]
    for name, effect in found.items():
        table.add_row(f"[bold]{title('compensation', name)}[/]")
        for check in effect.checks:
            mark = "" if check.holds else "[bold]out of bounds[/]"
            table.add_row(f"  {check.name}", f"{check.value:.4g}", check.unit, check.bounds, mark)
        table.add_section()
    Console().print(table)


def main() -> int:
    """Print the table; return 1 if a figure is out of its bounds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="scripts to run, all if none is named")
    parser.add_argument("--short", action="store_true", help="only what the tests run")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="also write the figures as CSV")
    options = parser.parse_args()
    if unknown := set(options.names) - scripts("compensation").keys():
        parser.error(f"there is no {min(unknown)}.py in examples/compensation")
    names = options.names or list(scripts("compensation"))
    with tempfile.TemporaryDirectory() as folder:
        found: dict[str, Effect] = {
            name: import_module(name).main(Path(folder), not options.short)
            for name in track(names, "effects", console=Console(stderr=True))
        }
    show(found)
    if options.json:
        rows = {name: [asdict(c) | {"ok": c.holds} for c in effect.checks] for name, effect in found.items()}
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    if options.csv:
        figures.write([figure(name, check) for name, effect in found.items() for check in effect.checks], options.csv)
    return 0 if all(check.holds for effect in found.values() for check in effect.checks) else 1


if __name__ == "__main__":
    sys.exit(main())
