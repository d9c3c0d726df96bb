"""Find the break-aways in a record, and with them the static friction in each direction.

The axis rests, then the force rises until it moves. ``python examples/identification/break_aways.py`` reads the record
of a tribometer, whose normal force is 5 N. The level of a drive force contains what else acts at rest, such as gravity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from friction_fmus.data import load_tribometer

Array = NDArray[np.float64]

STEEPEST = 0.1
"""Fraction of the break-away force by which the force may rise over the last quarter of `travel` in sliding."""

BEGUN = 0.5  # fraction of the break-away force above which its rate is measured


@dataclass(frozen=True)
class BreakAways:
    """Break-aways of an axis from rest."""

    direction: Array
    """1 for forward, -1 for backward motion."""
    force: Array
    """Largest force in the direction of motion, from rest until the axis has moved by `travel` [N]."""
    position: Array
    dwell: Array
    rate: Array
    """Position at rest [m], time at rest [s], mean rate at which the force rose over its second half [N/s]."""
    sliding: NDArray[np.bool_]
    """Whether the axis slid when it had moved by `travel`: over the last quarter of it the force rose by less than a
    tenth, by less than in presliding."""

    def level(self, direction: int) -> tuple[float, float]:
        """Return the mean break-away force in one direction and its standard error [N].

        Raises
        ------
        ValueError
            If the axis did not slide after any break-away in this direction.
        """
        force = self.force[(self.direction == direction) & self.sliding]
        if force.size == 0:
            way = "forward" if direction > 0 else "backward"
            raise ValueError(
                f"level: the axis did not slide {way} within `travel` in any of {(self.direction == direction).sum()} "
                "break-aways; choose a `travel` beyond presliding"
            )
        error = float(force.std(ddof=1) / np.sqrt(force.size)) if force.size > 1 else float("nan")
        return float(force.mean()), error


def find_break_aways(t: Array, force: Array, x: Array, *, travel: float, dwell: float) -> BreakAways:
    """Find the break-aways in a record: the axis rests, then moves by `travel`.

    Parameters
    ----------
    t, force, x : array, shape (n,)
        Times [s], drive force or measured friction force, positive forward [N], and position [m].
    travel : float
        Displacement from rest that counts as break-away [m]: more than presliding and noise.
    dwell : float
        Shortest time at rest, within a quarter of `travel` around one position, above 0 [s].
    """
    rows: list[tuple[float, ...]] = []
    start, rested, rest, end = 0, slice(0), 0.0, None
    while (left := _leaves(x, start, x[start], travel / 4.0)) is not None or end is not None:
        if end is not None and (left is None or end <= left):
            among, held = slice(rested.start, end + 1), t[rested.stop - 1] - t[rested.start]
            rows.append(_break_away(t[among], force[among], x[among] - rest, rest, held, travel))
            start, end = end, None
            continue
        assert left is not None
        if t[left] - t[start] >= dwell:
            rested, rest = slice(start, left), float(np.median(x[start:left]))
            end = _leaves(x, left, rest, travel)
        start = left
    return _table(rows)


def _table(rows: list[tuple[float, ...]]) -> BreakAways:
    direction, force, position, dwell, rate, sliding = np.array(rows, dtype=np.float64).reshape(-1, 6).T
    return BreakAways(direction, force, position, dwell, rate, sliding > 0.0)


def _leaves(x: Array, start: int, rest: float, travel: float) -> int | None:
    """Return the first sample from `start` on that is farther than `travel` from a position; None if there is none."""
    block = 1024
    for first in range(start, x.size, block):
        away = np.abs(x[first : first + block] - rest) > travel
        if away.any():
            return first + int(away.argmax())
    return None


def _break_away(t: Array, force: Array, moved: Array, rest: float, held: float, travel: float) -> tuple[float, ...]:
    """Return a row of `BreakAways` from the samples between the begin of rest and detection."""
    direction = float(np.sign(moved[-1]))
    along, ahead = direction * force, direction * moved
    loading = int(along.argmin())  # the force of the motion before has then decayed
    top = loading + int(along[loading:].argmax())
    level, last = float(along[top]), float(along[-1])
    before = float(along[np.flatnonzero(ahead <= 0.75 * travel)[-1]])
    # the time at rest before the force rises does not count
    below = np.flatnonzero(along[loading : top + 1] <= BEGUN * level)
    begun = loading + (int(below[-1]) if below.size else 0)
    rate = (level - along[begun]) / (t[top] - t[begun]) if top > begun else float("nan")
    return direction, level, rest, held, float(rate), float(last - before <= STEEPEST * abs(level))


if __name__ == "__main__":
    record = load_tribometer()
    found = find_break_aways(record.t, record.column("friction"), record.column("q"), travel=0.2e-3, dwell=0.4)
    for direction, name in ((1, "forward"), (-1, "backward")):
        level, error = found.level(direction)
        print(f"{name}: {level:.3f} N, standard error {error:.3f} N, {(found.direction == direction).sum()} times")
