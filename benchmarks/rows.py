"""What every benchmark prints and writes: rows with name, value, unit, target, ok."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table


@dataclass(frozen=True)
class Row:
    """One figure.

    Attributes
    ----------
    name : str
        What was measured.
    value : float
        The figure.
    unit : str
        Its unit; "x" for a ratio measured in one run.
    target : float or None
        What it is to be at most.
    """

    name: str
    value: float
    unit: str
    target: float | None = None

    @property
    def ok(self) -> bool:
        """Whether the target is met, true without one."""
        return self.target is None or self.value <= self.target


def arguments(description: str) -> argparse.Namespace:
    """The options of every benchmark: ``--json FILE`` and ``--short``."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to a file")
    parser.add_argument("--short", action="store_true", help="fewer repetitions, for a quick look")
    return parser.parse_args()


def report(title: str, rows: Sequence[Row], file: Path | None) -> None:
    """Prints the table and writes the rows."""
    table = Table(title=title, title_justify="left")
    for heading, side in (("", "left"), ("value", "right"), ("unit", "left"), ("target", "right"), ("", "left")):
        table.add_column(heading, justify=side)  # type: ignore[arg-type]
    for row in rows:
        target = "" if row.target is None else f"{row.target:g}"
        mark = "" if row.target is None else "met" if row.ok else "[bold]not met[/]"
        table.add_row(row.name, f"{row.value:.3g}", row.unit, target, mark)
    Console().print(table)
    if file:
        file.write_text(json.dumps([asdict(row) | {"ok": row.ok} for row in rows], indent=2) + "\n", encoding="utf-8")
