"""Ranking of the compensators.

1. A compensator improves the axis if it reduces the tracking error by at least `WORTH`, both on the identified axis and
   in every case that counts and that the servo alone survives.
2. Compensators that improve the axis come first.
3. Within both groups, the lower score comes first. The score is the weighted sum of binary logarithms of four figures,
   each relative to the servo without compensation: the worst-case error, the drive force above the bandwidth of the
   loop, the peak of the sensitivity function Ms, and the cycles of one sample. With the weight 1, a figure half as
   large lowers the score by 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, log2
from typing import Final

from friction_fmus.study.compensator_records import CompensatorResult, Metrics

WORTH: Final = 0.05
"""Smallest relative reduction of the error that counts as an improvement."""

NEGLIGIBLE: Final = 0.02
"""Ratio to the total force of the servo alone below which drive force above the bandwidth counts as equal."""

CHEAP: Final = 100.0
"""Cycles below which costs count as equal."""

UNKNOWN: Final = 10_000.0
"""Cycles of a compensator without C code."""


@dataclass(frozen=True)
class Weights:
    """Weights of the figures in the score."""

    error: float = 1.0
    effort: float = 0.25
    margin: float = 0.25
    cost: float = 0.01
    """Weights of worst-case error, drive force above the bandwidth, sensitivity peak, and cycles."""


def rank(
    none: CompensatorResult, rows: Sequence[CompensatorResult], weights: Weights, Ms: float
) -> list[CompensatorResult]:
    """Rank the compensators."""
    judged = [_judged(none, row, weights, Ms) for row in rows if row.metrics is not None]
    # differences in the last bits must not decide the order
    ordered = sorted(judged, key=lambda row: (not row.improves, _rounded(row.score), row.name))
    ranked = [replace(row, rank=place) for place, row in enumerate(ordered, start=1)]
    return ranked + [row for row in rows if row.metrics is None]


def extremes(row: CompensatorResult, none: CompensatorResult) -> CompensatorResult:
    """Return the result with its smallest and largest error over the cases that count.

    The largest is None if a run failed that succeeds without compensation.
    """
    possible = zip(none.corners, row.corners, strict=True)
    runs = [row.metrics, *(own.metrics for alone, own in possible if own.counts and alone.metrics is not None)]
    errors = [run.rms for run in runs if run is not None]
    failed = any(run is None for run in runs)
    return replace(row, best=min(errors, default=None), worst=None if failed else max(errors))


def figures(none: CompensatorResult, row: CompensatorResult, Ms: float) -> tuple[float, float, float, float]:
    """Return the binary logarithms of the four figures relative to the servo without compensation."""
    assert none.metrics is not None
    assert row.metrics is not None
    floor = max(NEGLIGIBLE * none.metrics.effort, 1e-300)
    cycles = 0.0 if row.name == none.name else UNKNOWN if row.cycles is None else row.cycles
    return (
        inf if row.worst is None or not none.worst else log2(max(row.worst, 1e-300) / none.worst),
        log2(max(row.metrics.effort_high, floor) / max(none.metrics.effort_high, floor)),
        log2(_peak(row, Ms) / _peak(none, Ms)),
        log2(max(cycles, CHEAP) / CHEAP),
    )


def _rounded(score: float | None) -> float:
    return inf if score is None else round(score, 6)


def _peak(row: CompensatorResult, otherwise: float) -> float:
    return otherwise if row.margins is None or row.margins.Ms is None else row.margins.Ms


def _judged(none: CompensatorResult, row: CompensatorResult, weights: Weights, Ms: float) -> CompensatorResult:
    """Return the result with `worst`, `best`, `improves` and `score` set."""
    row = extremes(row, none)
    counted = [(a.metrics, b.metrics) for a, b in zip(none.corners, row.corners, strict=True) if b.counts]
    improves = all(_reduces(a, b) for a, b in [(none.metrics, row.metrics), *counted])
    error, effort, margin, cost = figures(none, row, Ms)
    score = weights.error * error + weights.effort * effort + weights.margin * margin + weights.cost * cost
    return replace(row, improves=improves, score=None if score == inf else score)


def _reduces(without: Metrics | None, own: Metrics | None) -> bool:
    return without is None or (own is not None and own.rms <= (1.0 - WORTH) * without.rms)
