"""The figures of all effects in examples/compensation, with the bounds that they keep, in full.

``--page docs/compensation.md`` writes the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:1] = [str(ROOT), str(ROOT / "examples"), str(ROOT / "examples" / "compensation")]

import argparse
import ast
import json
import re
import tempfile
from dataclasses import asdict
from importlib import import_module
from typing import TYPE_CHECKING

from page import scripts
from rich.console import Console
from rich.progress import track
from rich.table import Table

if TYPE_CHECKING:
    from _effect import Check, Effect

INTRODUCTION = """# Figures of friction compensation

What each script of [effects.md](effects.md) measures, and the bounds that theory, the literature or an independent
computation give for it. Ratios are those of root mean square tracking errors, with the compensator over without,
unless it is said otherwise. The scripts state all gains, references and initial conditions. Written by

```console
$ python benchmarks/effects.py --page docs/compensation.md
```
"""


def title(name: str) -> str:
    """The first line of a script's docstring."""
    text = scripts("compensation")[name].read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]


def line(check: Check) -> str:
    """A figure as a line of the page's tables."""
    unit = f" {check.unit}" if check.unit else ""
    return f"| {check.name} | {check.value:.4g}{unit} | {check.bounds} | {'' if check.holds else 'does not hold'} |"


def section(name: str, effect: Effect) -> str:
    """The figures of a script as a section of the page."""
    heading = title(name)
    anchor = re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")
    head = f"## [{heading}](effects.md#{anchor})\n\n| | value | bounds | |\n|---|--:|---|---|\n"
    return head + "\n".join(line(check) for check in effect.checks) + "\n"


def show(found: dict[str, Effect]) -> None:
    """Prints the table."""
    table = Table(title="Effects", title_justify="left")
    for heading, side in (("", "left"), ("value", "right"), ("unit", "left"), ("bounds", "left"), ("", "left")):
        table.add_column(heading, justify=side)  # type: ignore[arg-type]
    for name, effect in found.items():
        table.add_row(f"[bold]{title(name)}[/]")
        for check in effect.checks:
            mark = "" if check.holds else "[bold]does not hold[/]"
            table.add_row(f"  {check.name}", f"{check.value:.4g}", check.unit, check.bounds, mark)
        table.add_section()
    Console().print(table)


def main() -> int:
    """Prints the table; status 1 if a figure is out of its bounds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="scripts to run, all if none is named")
    parser.add_argument("--short", action="store_true", help="what the tests run")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to a file")
    parser.add_argument("--page", type=Path, metavar="FILE", help="also write the page")
    options = parser.parse_args()
    if unknown := set(options.names) - scripts("compensation").keys():
        parser.error(f"there is no {min(unknown)}.py in examples/compensation")
    names = options.names or list(scripts("compensation"))
    with tempfile.TemporaryDirectory() as figures:
        found: dict[str, Effect] = {
            name: import_module(name).main(Path(figures), not options.short)
            for name in track(names, "effects", console=Console(stderr=True))
        }
    show(found)
    if options.json:
        rows = {name: [asdict(c) | {"ok": c.holds} for c in effect.checks] for name, effect in found.items()}
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    if options.page:
        text = "\n".join([INTRODUCTION, *(section(name, effect) for name, effect in found.items())])
        options.page.write_text(text, encoding="utf-8")
    return 0 if all(check.holds for effect in found.values() for check in effect.checks) else 1


if __name__ == "__main__":
    sys.exit(main())
