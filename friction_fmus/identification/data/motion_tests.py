"""Physical tests of columns: which is the derivative of which, and which force explains a motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from friction_fmus.identification.data.record import Array

WIDTHS: Final = (0.8, 2.0, 5.0, 12.0)  # widths of the smoothing [samples]; noise decides which shows a relation best
MOST: Final = 20_000  # most samples that are tested
DERIVATIVE: Final = 0.97  # correlation above which a column is the derivative of another
LEAST: Final = 30  # fewest samples in motion
SAME: Final = 0.98  # correlation above which two columns show the same motion or force


def without_gaps(x: Array) -> Array:
    """Return a column with empty cells interpolated."""
    good = np.isfinite(x)
    return x if good.all() else np.interp(np.arange(len(x)), np.flatnonzero(good), x[good])


def without_jumps(x: Array) -> Array:
    """Return a column without empty cells and without jumps by more than half its range, such as those of a counter."""
    x = without_gaps(x)
    steps = np.diff(x)
    jumps = np.abs(steps) > 0.5 * np.ptp(x)
    if not jumps.any() or np.mean(jumps) > 0.1:
        return x
    steps[jumps] = np.interp(np.flatnonzero(jumps), np.flatnonzero(~jumps), steps[~jumps])
    return np.concatenate([x[:1], x[0] + np.cumsum(steps)])


def smoothed(values: Array, width: float, order: int = 0) -> Array:
    """Return columns behind a Gaussian filter, or their first or second derivative per sample."""
    # The second derivative is the difference of the first: the sum of a truncated kernel of it is not zero, and adds a
    # multiple of the values.
    found = gaussian_filter1d(values, width, axis=0, order=min(order, 1))
    return np.asarray(np.gradient(found, axis=0) if order == 2 else found, dtype=np.float64)


def longest_run(t: Array) -> slice:
    """Return the longest part of at most `MOST` samples with increasing times at one rate."""
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 1.0
    even = np.concatenate([[False], np.abs(steps / usual - 1.0) < 0.6, [False]])
    edges = np.flatnonzero(np.diff(even.astype(np.int8)))
    if not edges.size:
        return slice(0, min(len(t), MOST))
    begin, end = max(edges.reshape(-1, 2), key=lambda pair: pair[1] - pair[0])
    return slice(int(begin), min(int(end) + 1, int(begin) + MOST))


@dataclass(frozen=True)
class DriveShare:
    """How well a motion explains a force."""

    share: float  # share of the variance that acceleration, direction and speed explain
    without_direction: float  # share that acceleration and speed explain
    right: bool  # whether inertia and friction have the same sign

    @property
    def friction(self) -> bool:
        """Whether the direction explains what acceleration and speed do not: a following error has no such part."""
        return self.without_direction < 0.97 and 1.0 - self.share < 0.7 * (1.0 - self.without_direction)


NOTHING: Final = DriveShare(0.0, 0.0, False)


@dataclass(frozen=True, eq=False)
class SampledColumns:
    """Columns of a table on samples at one rate."""

    values: Mapping[str, Array]  # without empty cells
    dt: float  # mean sample time, in the unit of the time column
    _smooth: dict[tuple[str, float, int], Array] = field(default_factory=dict)  # by name, width and order

    def widths(self) -> tuple[float, ...]:
        """Return the widths of the smoothing that the number of samples allows."""
        count = len(next(iter(self.values.values()), ()))
        return tuple(width for width in WIDTHS if 20.0 * width < count)

    def smooth(self, names: Sequence[str], width: float, order: int = 0) -> Array:
        """Return smoothed columns, or their derivatives per sample, shape (n, names)."""
        edge = round(4.0 * width)
        for name in names:
            if (name, width, order) not in self._smooth:
                given = without_jumps(self.values[name]) if order else self.values[name]
                self._smooth[name, width, order] = smoothed(given, width, order)[edge : len(given) - edge]
        return np.column_stack([self._smooth[name, width, order] for name in names])

    def same(self, a: str, b: str) -> float:
        """Return the correlation of two columns."""
        return float(_correlation(without_jumps(self.values[a]), without_jumps(self.values[b])[:, None])[0])

    def derivatives(self, of: str, candidates: Sequence[str]) -> list[tuple[float, float]]:
        """Return correlation and factor of each candidate with the derivative of a column."""
        best = [(0.0, 0.0)] * len(candidates)
        for width in self.widths() if candidates else ():
            d, w = self.smooth([of], width, 1)[:, 0], self.smooth(candidates, width)
            r = _correlation(d, w)
            k = (d - d.mean()) @ w / max(float(np.sum((d - d.mean()) ** 2)), 1e-300) * self.dt
            best = [max(old, (float(r[i]), float(k[i]))) for i, old in enumerate(best)]
        return best

    def lag(self, a: str, b: str) -> tuple[float, float]:
        """Return by how many samples column b lags behind a, and the share of their difference that this explains."""
        share, late = 0.0, 0.0
        for width in self.widths():
            v, x, y = self.smooth([a], width, 1)[:, 0], self.smooth([a], width)[:, 0], self.smooth([b], width)[:, 0]
            line = np.column_stack([x, np.ones_like(x)])
            k = np.linalg.lstsq(line, y, rcond=None)[0]
            difference = y - line @ k
            now = -float(difference @ v) / max(float(v @ v), 1e-300) / (k[0] or 1.0)
            explained = (k[0] * now) ** 2 * float(v @ v) / max(float(difference @ difference), 1e-300)
            share, late = max((share, late), (explained, now))
        return late, share

    def explained(self, position: str, velocity: str, drives: Sequence[str]) -> list[DriveShare]:
        """Return how well acceleration, direction and speed of a motion explain each of some forces."""
        best = [NOTHING] * len(drives)
        for width in self.widths() if drives else ():
            if velocity:
                v, a = (self.smooth([velocity], width, order)[:, 0] for order in (0, 1))
            else:
                v, a = (self.smooth([position], width, order)[:, 0] for order in (1, 2))
            top = float(np.quantile(np.abs(v), 0.99))
            moving = np.abs(v) > 0.02 * top
            if not top or np.count_nonzero(moving) < LEAST or not np.ptp(a[moving]) or not np.ptp(v[moving]):
                continue  # at rest in 99 % of the log, or without a change of the speed
            direction = smoothed(v / (np.abs(v) + 0.005 * top), width)
            smooth = np.column_stack([np.ones_like(v), a / a.std(), v / v.std()])[moving]
            every = np.column_stack([smooth, direction[moving]])
            F = self.smooth(drives, width)[moving]
            total = np.sum((F - F.mean(axis=0)) ** 2, axis=0) + 1e-300
            theta = _solved(every, F)
            left = np.sum((F - every @ theta) ** 2, axis=0) / total
            left_smooth = np.sum((F - smooth @ _solved(smooth, F)) ** 2, axis=0) / total
            lost = np.mean((every[:, 2:] @ theta[2:]) * v[moving, None], axis=0)
            heavy = np.abs(theta[1]) > 0.05 * F.std(axis=0)
            for i, old in enumerate(best):
                if (share := 1.0 - float(left[i])) > old.share:
                    right = bool((theta[1, i] > 0.0) == (lost[i] > 0.0) or not heavy[i])
                    best[i] = DriveShare(share, 1.0 - float(left_smooth[i]), right)
        return best


def _solved(A: Array, F: Array) -> Array:
    """Return the least squares solution of scaled columns from the normal equations, which is fast for many samples."""
    return np.asarray(np.linalg.lstsq(A.T @ A, A.T @ F, rcond=None)[0], dtype=np.float64)


def _correlation(x: Array, y: Array) -> Array:
    """Return the correlations of x with the columns of y."""
    x, y = x - x.mean(), y - y.mean(axis=0)
    scale = np.sqrt(float(x @ x) * np.sum(y**2, axis=0)) + 1e-300
    return np.asarray(x @ y / scale, dtype=np.float64)
