"""Signals that were sampled at different times, on the times of one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import Table


@dataclass(frozen=True, eq=False)
class Group:
    """Signals sampled at the same times."""

    t: Array
    """Times; they increase."""
    signals: Mapping[str, Array]
    """Values by heading."""


def on_one_clock(path: Path, groups: Sequence[Group], time: str, unit: str) -> Table:
    """Return the signals of all groups at the times of the group with the most signals.

    The signals of other groups are interpolated linearly, and missing outside of their times. Each of them has a note,
    because interpolation smooths a force and distorts the derivatives of a position.
    """
    base = max(groups, key=lambda group: len(group.signals))
    columns: dict[str, Array] = {time: base.t}
    notes = {}
    for group in groups:
        same = len(group.t) == len(base.t) and np.array_equal(group.t, base.t)
        for name, values in group.signals.items():
            columns[name] = values
            if not same:
                columns[name] = np.interp(base.t, group.t, values, left=np.nan, right=np.nan)
                what = f"{name!r} was sampled at other times than most signals of {path.name}, and is interpolated."
                notes[name] = Finding("other-clock", what, "Log all signals of the axis with one sample time.")
    return Table(path, columns, {time: unit}, notes=notes)
