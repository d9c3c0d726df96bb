"""Which compensator is best: a rule in four lines, and its reason in two sentences.

1. A compensator pays if it makes the error at least `WORTH` smaller than without, as identified and in every corner of
   the mismatch.
2. Those that pay without much noise come first, then the noisy ones that pay, then the others.
3. Within these, the smaller error in the worst corner comes first.
4. Those within `ALIKE` of the smallest count as equal; among them the ones that hardly add high-frequency force come
   first, then the cheaper ones, and of those whose cost is alike within a factor of two the smaller error again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from friction_fmus.study.records import CompensatorResult, Metrics, Recommendation

WORTH: Final = 0.05
"""Least gain, as a share of the error without compensation."""

ALIKE: Final = 0.10
"""Worst errors that differ by less count as equal."""

NOISY: Final = 2.0
"""High-frequency force over that of the servo alone from which a compensator is noisy."""

QUIET: Final = 1.1
"""The same up to which one adds hardly any."""

NEGLIGIBLE: Final = 0.02
"""High-frequency force over the whole force of the servo alone below which it does not matter."""


def rank(none: CompensatorResult, rows: Sequence[CompensatorResult]) -> list[CompensatorResult]:
    """Judge the compensators and bring them in order.

    Parameters
    ----------
    none : CompensatorResult
        The servo without compensation.
    rows : sequence of CompensatorResult
        The others.

    Returns
    -------
    list of CompensatorResult
        Those that were co-simulated, with `worst`, `best`, `pays`, `noisy` and `rank`, then those that do not apply.
    """
    judged = [_judged(none, row) for row in rows if row.metrics is not None]
    ordered: list[CompensatorResult] = []
    for group in ((True, False), (True, True), (False, False), (False, True)):
        left = sorted(
            (row for row in judged if (row.pays, row.noisy) == group), key=lambda row: (_worst(row), row.name)
        )
        while left:
            alike = [row for row in left if _worst(row) <= (1.0 + ALIKE) * _worst(left[0])]
            first = _cheapest([row for row in alike if not _adds_noise(none, row)] or alike)
            ordered.append(first)
            left.remove(first)
    ranked = [replace(row, rank=place) for place, row in enumerate(ordered, start=1)]
    return ranked + [row for row in rows if row.metrics is None]


def extremes(row: CompensatorResult, none: CompensatorResult) -> CompensatorResult:
    """The row with its smallest and largest error; the largest is None if a corner failed that runs without it."""
    possible = zip(none.corners, row.corners, strict=True)
    runs = [row.metrics, *(corner.metrics for without, corner in possible if without.metrics is not None)]
    errors = [run.rms for run in runs if run is not None]
    failed = any(run is None for run in runs)
    return replace(row, best=min(errors, default=None), worst=None if failed else max(errors))


def recommend(none: CompensatorResult, ranked: Sequence[CompensatorResult], unit: str) -> Recommendation:
    """Say which one to take.

    Parameters
    ----------
    none : CompensatorResult
        The servo without compensation.
    ranked : sequence of CompensatorResult
        What `rank` returned.
    unit : str
        Unit of the position, "m" or "rad".
    """
    tried = [row for row in ranked if row.rank is not None]
    if not tried:
        return Recommendation("", "No compensator could be tried on this axis. The reasons stand in the table.")
    assert none.metrics is not None
    without = shown(none.metrics.rms, unit)
    first = tried[0]
    assert first.metrics is not None
    if not first.pays:
        nearest = min(tried, key=_worst)
        assert nearest.metrics is not None
        what = f"it leaves {shown(nearest.metrics.rms, unit)} as identified"
        if nearest.worst is not None:
            what += f" and up to {shown(nearest.worst, unit)} in the corners"
        return Recommendation(
            "none",
            f"No compensator makes the error of {without} rms at least {100 * WORTH:.0f} % smaller both as identified "
            f"and in every corner of the mismatch. The nearest is {nearest.name}: {what}.",
        )
    paying = [row for row in tried if row.pays]
    alike = [row for row in paying if row.noisy == first.noisy and _worst(row) <= (1.0 + ALIKE) * _smallest(paying)]
    assert first.worst is not None
    assert none.worst is not None
    one = (
        f"{first.name} at the gain {first.gain:g} brings the tracking error from {without} to "
        f"{shown(first.metrics.rms, unit)} rms, and to {shown(first.worst, unit)} in the worst corner of the mismatch, "
        f"where it is up to {shown(none.worst, unit)} without."
    )
    added = first.metrics.effort_high / none.metrics.effort_high - 1.0 if none.metrics.effort_high else 0.0
    force = f"adds {100.0 * added:.0f} % to" if added >= QUIET - 1.0 else "adds next to nothing to"
    price = f"{force} the force above the bandwidth of the loop and takes {first.cost_ns or 0.0:.0f} ns a sample"
    if len(alike) > 1 and first in alike:
        others = f"{len(alike)} compensators are alike in the worst corner within {100 * ALIKE:.0f} %"
        two = f"{others}, and of these none is less noisy or takes less than half the time: it {price}."
    else:
        two = f"No other one that pays without more noise has a worst error as small, and it {price}."
    if len(paying) < 2:
        return Recommendation(first.name, f"{one} {two}", first.gain)
    second = paying[1]
    assert second.metrics is not None
    assert second.worst is not None
    also = (
        f"{second.name} reaches {shown(second.metrics.rms, unit)}, {shown(second.worst, unit)} in the worst corner, "
        f"for {second.cost_ns or 0.0:.0f} ns a sample."
    )
    return Recommendation(first.name, f"{one} {two}", first.gain, second.name, also)


def shown(value: float, unit: str) -> str:
    """A length or an angle in a unit that suits it."""
    for factor, prefix in ((1.0, ""), (1e3, "m"), (1e6, "µ")):
        if abs(value) * factor >= 1.0:
            return f"{value * factor:.3g} {prefix}{unit}"
    return f"{value * 1e9:.3g} n{unit}"


def _judged(none: CompensatorResult, row: CompensatorResult) -> CompensatorResult:
    """The row with what it is judged by."""
    row = extremes(row, none)
    pairs = [
        (none.metrics, row.metrics),
        *((a.metrics, b.metrics) for a, b in zip(none.corners, row.corners, strict=True)),
    ]
    pays = all(a is None or (b is not None and b.rms <= (1.0 - WORTH) * a.rms) for a, b in pairs)
    return replace(row, pays=pays, noisy=_noisy(none.metrics, row.metrics))


def _noisy(none: Metrics | None, own: Metrics | None) -> bool:
    if none is None or own is None:
        return False
    return own.effort_high > NOISY * none.effort_high and own.effort_high > NEGLIGIBLE * none.effort


def _adds_noise(none: CompensatorResult, row: CompensatorResult) -> bool:
    assert none.metrics is not None
    assert row.metrics is not None
    high = row.metrics.effort_high
    return high > QUIET * none.metrics.effort_high and high > NEGLIGIBLE * none.metrics.effort


def _cheapest(rows: Sequence[CompensatorResult]) -> CompensatorResult:
    """Of rows in the order of their errors; a measured time is no better than to a factor of two."""
    least = min(row.cost_ns or 0.0 for row in rows)
    return next(row for row in rows if (row.cost_ns or 0.0) <= 2.0 * least)


def _worst(row: CompensatorResult) -> float:
    """To six digits: compensators that give the same force differ in the last bits, which are not to order them."""
    return float("inf") if row.worst is None else float(f"{row.worst:.6g}")


def _smallest(rows: Sequence[CompensatorResult]) -> float:
    return min(_worst(row) for row in rows)
