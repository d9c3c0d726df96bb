"""Inputs over time of a case: `inputs.csv` read by the importer of the tests."""

from __future__ import annotations

import csv
from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from pathlib import Path
from typing import Any

Value = Any


class InputLines:
    """Columns of a CSV file: numbers of floating point are linear between rows, others are held."""

    def __init__(self, path: Path | None, continuous: Mapping[str, bool]) -> None:
        """Read it; `continuous` says which variables are linear."""
        rows: list[dict[str, str]] = []
        if path is not None:
            with path.open(encoding="utf-8", newline="") as file:
                rows = [{k.strip(): v.strip() for k, v in row.items()} for row in csv.DictReader(file)]
        self.times = [float(row["time"]) for row in rows]
        self.columns = {
            name: [_value(row[name]) for row in rows] for name in (rows[0] if rows else ()) if name != "time"
        }
        self.lines = [name for name in self.columns if continuous[name]]
        self.held = [name for name in self.columns if not continuous[name]]

    def _segment(self, t: float, left: bool) -> tuple[int, bool]:
        """The row that a segment at a time begins with, and whether the segment ends there (before or after all)."""
        k = (bisect_left if left else bisect_right)(self.times, t) - 1
        return max(k, 0), k < 0 or k >= len(self.times) - 1

    def at(self, t: float, *, left: bool = False) -> dict[str, Value]:
        """All values at a time, of two rows with one time the later one, or the earlier one on the left."""
        if not self.times:
            return {}
        k, ends = self._segment(t, left)
        found: dict[str, Value] = {}
        for name in self.lines:
            column = self.columns[name]
            if ends:
                found[name] = column[k]
            else:
                begin, end = self.times[k], self.times[k + 1]
                share = (t - begin) / (end - begin)
                # exact at both ends, unlike begin + share * difference
                found[name] = column[k] * (1.0 - share) + column[k + 1] * share if share else column[k]
        for name in self.held:
            found[name] = self.columns[name][k]
        return found

    def slopes(self, t: float) -> dict[str, float]:
        """Slopes of the lines after a time."""
        if not self.times:
            return {}
        k, ends = self._segment(t, False)
        return {
            name: 0.0 if ends else (column[k + 1] - column[k]) / (self.times[k + 1] - self.times[k])
            for name, column in ((name, self.columns[name]) for name in self.lines)
        }

    def jumps(self) -> list[float]:
        """Times at which a line jumps or a held value changes."""
        found = []
        for k in range(1, len(self.times)):
            same = self.times[k] == self.times[k - 1]
            lines = same and any(self.columns[name][k] != self.columns[name][k - 1] for name in self.lines)
            if lines or any(self.columns[name][k] != self.columns[name][k - 1] for name in self.held):
                found.append(self.times[k])
        return found

    def kinks(self) -> list[float]:
        """All times of rows: a solver restarts there."""
        return sorted(set(self.times))


def _value(text: str) -> Value:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return float(text)
    except ValueError:
        return text
