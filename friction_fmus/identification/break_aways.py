"""Static friction from break-aways in a record: the axis rests, then the force rises until it moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from friction_fmus.errors import FrictionError
from friction_fmus.identification.data.record import Array

STEEPEST = 0.1
"""Fraction of the break-away force by which the force may rise over the last quarter of `travel` in sliding."""

BEGUN = 0.5  # fraction of the break-away force above which its rate is measured


@dataclass(frozen=True)
class BreakAways:
    """Break-aways of an axis from rest.

    Attributes
    ----------
    direction : array, shape (n,)
        1 for forward, -1 for backward motion.
    force : array, shape (n,)
        Largest force in the direction of motion, from rest until the axis has moved by `travel` [N].
    position, dwell, rate : array, shape (n,)
        Position at rest [m], time at rest, 0 for a ramp [s], mean rate at which the force rose over its
        second half [N/s].
    sliding : array of bool, shape (n,)
        Whether the axis slid when it had moved by `travel`: over the last quarter of it the force rose by less than a
        tenth, by less than in presliding.
    """

    direction: Array
    force: Array
    position: Array
    dwell: Array
    rate: Array
    sliding: NDArray[np.bool_]

    def level(self, direction: int) -> tuple[float, float]:
        """Return the static friction in one direction and its standard error.

        Parameters
        ----------
        direction : int
            1 for forward, -1 for backward.

        Returns
        -------
        (float, float)
            Mean break-away force, and its standard error from the scatter, NaN for a single break-away [N].

        Raises
        ------
        FrictionError
            If the axis did not slide after any break-away in this direction.
        """
        force = self.force[(self.direction == direction) & self.sliding]
        if force.size == 0:
            way = "forward" if direction > 0 else "backward"
            raise FrictionError(
                f"level: the axis did not slide {way} within `travel` in any of {(self.direction == direction).sum()} "
                "break-aways; choose a `travel` beyond presliding"
            )
        error = float(force.std(ddof=1) / np.sqrt(force.size)) if force.size > 1 else float("nan")
        return float(force.mean()), error


def find_break_aways(t: ArrayLike, force: ArrayLike, position: ArrayLike, *, travel: float, dwell: float) -> BreakAways:
    """Find the break-aways in a record: the axis rests, then moves by `travel`.

    Parameters
    ----------
    t, force, position : array_like, shape (n,)
        Times [s], drive force or measured friction force, positive forward [N], and position [m].
    travel : float
        Displacement from rest that counts as break-away [m]: more than presliding and noise.
    dwell : float
        Shortest time at rest, within a quarter of `travel` around one position [s].

    Returns
    -------
    BreakAways
        All break-aways, in the order of the record.

    Raises
    ------
    FrictionError
        If the lengths differ, a number is not finite, or `travel` or `dwell` is outside its range.
    """
    times, forces, x = (np.asarray(each, dtype=np.float64) for each in (t, force, position))
    if times.ndim != 1 or not times.shape == forces.shape == x.shape or not times.size:
        raise FrictionError(
            f"find_break_aways: t, force and position have the shapes {times.shape}, {forces.shape} and {x.shape}; "
            "give three vectors of the same length"
        )
    if not (np.isfinite([times, forces, x]).all() and (np.diff(times) > 0.0).all()):
        raise FrictionError("find_break_aways: a value is not finite or the times do not rise; remove such samples")
    if not (travel > 0.0 and dwell >= 0.0):
        raise FrictionError(f"find_break_aways: travel = {travel} m must be above 0 and dwell = {dwell} s at least 0")
    rows: list[tuple[float, ...]] = []
    start, rested, rest, end = 0, slice(0), 0.0, None
    while (left := _leaves(x, start, x[start], travel / 4.0)) is not None or end is not None:
        if end is not None and (left is None or end <= left):
            among, held = slice(rested.start, end + 1), times[rested.stop - 1] - times[rested.start]
            rows.append(_break_away(times[among], forces[among], x[among] - rest, rest, held, travel))
            start, end = end, None
            continue
        assert left is not None
        if times[left] - times[start] >= dwell:
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
