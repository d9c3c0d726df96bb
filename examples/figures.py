"""The figures that the effects measure, with their bounds: one line each in ``compensation/figures.csv``."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

FILE = Path(__file__).resolve().parent / "compensation" / "figures.csv"


class Figure(NamedTuple):
    """A measured figure.

    Attributes
    ----------
    effect : str
        The script that measures it.
    name : str
        What is measured.
    value, unit : str
        The value to four digits and its unit. The value is empty where only the bounds hold on every processor, and the
        unit of a ratio is empty.
    bounds : str
        The bounds from theory or an independent computation, empty without any.
    """

    effect: str
    name: str
    value: str
    unit: str
    bounds: str


def read(path: Path = FILE) -> dict[str, dict[str, Figure]]:
    """Return the figures of each effect by name."""
    found: dict[str, dict[str, Figure]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file)
        next(rows)  # the heading
        for figure in map(Figure._make, rows):
            found.setdefault(figure.effect, {})[figure.name] = figure
    return found


def write(figures: Iterable[Figure], path: Path = FILE) -> None:
    """Write figures to a file."""
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerows([Figure._fields, *figures])
