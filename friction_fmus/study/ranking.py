"""Ranking of the compensators, and the recommendation in two sentences.

1. A compensator improves the axis if it reduces the tracking error by at least `WORTH`, both with the identified
   parameters and in every run with parameter mismatch.
2. Compensators that improve the axis without much noise come first, then noisy ones that improve it, then the others.
3. Within each group, the smaller worst-case error comes first.
4. Worst-case errors within `ALIKE` of the smallest count as equal. Among them, compensators that add almost no
   high-frequency force come first, then faster ones; costs within a factor of two count as equal, and the smaller
   error decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from friction_fmus.study.records import CompensatorResult, Metrics, Recommendation

WORTH: Final = 0.05
"""Smallest relative reduction of the error that counts as an improvement."""

ALIKE: Final = 0.10
"""Relative difference below which worst-case errors count as equal."""

NOISY: Final = 2.0
"""Ratio to the high-frequency force of the servo alone above which a compensator is noisy."""

QUIET: Final = 1.1
"""Ratio to the high-frequency force of the servo alone up to which a compensator adds almost none."""

NEGLIGIBLE: Final = 0.02
"""Ratio to the total force of the servo alone below which high-frequency force is negligible."""


def rank(none: CompensatorResult, rows: Sequence[CompensatorResult]) -> list[CompensatorResult]:
    """Rank the compensators.

    Parameters
    ----------
    none : CompensatorResult
        Servo without compensation.
    rows : sequence of CompensatorResult
        Compensators.

    Returns
    -------
    list of CompensatorResult
        Compensators by rank, with `worst`, `best`, `improves`, `noisy` and `rank` set, then those without metrics.
    """
    judged = [_judged(none, row) for row in rows if row.metrics is not None]
    ordered: list[CompensatorResult] = []
    for group in ((True, False), (True, True), (False, False), (False, True)):
        left = sorted(
            (row for row in judged if (row.improves, row.noisy) == group), key=lambda row: (_worst(row), row.name)
        )
        while left:
            alike = [row for row in left if _worst(row) <= (1.0 + ALIKE) * _worst(left[0])]
            first = _cheapest([row for row in alike if not _adds_noise(none, row)] or alike)
            ordered.append(first)
            left.remove(first)
    ranked = [replace(row, rank=place) for place, row in enumerate(ordered, start=1)]
    return ranked + [row for row in rows if row.metrics is None]


def extremes(row: CompensatorResult, none: CompensatorResult) -> CompensatorResult:
    """Return the result with its smallest and largest error.

    The largest is None if a run with mismatch failed that succeeds without compensation.
    """
    possible = zip(none.corners, row.corners, strict=True)
    runs = [row.metrics, *(corner.metrics for without, corner in possible if without.metrics is not None)]
    errors = [run.rms for run in runs if run is not None]
    failed = any(run is None for run in runs)
    return replace(row, best=min(errors, default=None), worst=None if failed else max(errors))


def recommend(none: CompensatorResult, ranked: Sequence[CompensatorResult], unit: str) -> Recommendation:
    """Return the recommended compensator with the reasons.

    Parameters
    ----------
    none : CompensatorResult
        Servo without compensation.
    ranked : sequence of CompensatorResult
        Compensators as returned by `rank`.
    unit : str
        Unit of the position, "m" or "rad".
    """
    tried = [row for row in ranked if row.rank is not None]
    if not tried:
        return Recommendation("", "No compensator could be simulated on this axis. The table states the reasons.")
    assert none.metrics is not None
    without = shown(none.metrics.rms, unit)
    first = tried[0]
    assert first.metrics is not None
    off = worst_case(none)
    if not first.improves:
        nearest = min(tried, key=_worst)
        assert nearest.metrics is not None
        what = f"{shown(nearest.metrics.rms, unit)} with the identified parameters"
        if nearest.worst is not None:
            what += f" and {shown(nearest.worst, unit)} in the worst case"
        return Recommendation(
            "none",
            f"No compensator reduces the tracking error of {without} rms by at least {100 * WORTH:.0f} %"
            + (f" in all cases, including those {off}" if off else "")
            + f". {nearest.name} comes closest, with {what}.",
        )
    improving = [row for row in tried if row.improves]
    alike = [
        row for row in improving if row.noisy == first.noisy and _worst(row) <= (1.0 + ALIKE) * _smallest(improving)
    ]
    assert first.worst is not None
    assert none.worst is not None
    one = (
        f"{first.name} with gain {first.gain:g} reduces the tracking error from {without} to "
        f"{shown(first.metrics.rms, unit)} rms"
        + (
            f", and in the worst case {off} from {shown(none.worst, unit)} to {shown(first.worst, unit)}."
            if off
            else "."
        )
    )
    added = first.metrics.effort_high / none.metrics.effort_high - 1.0 if none.metrics.effort_high else 0.0
    force = f"adds {100.0 * added:.0f} % to" if added >= QUIET - 1.0 else "adds almost nothing to"
    cost = f"It {force} the drive force above the loop bandwidth and takes {first.cost_ns or 0.0:.0f} ns per sample"
    if len(alike) > 1 and first in alike:
        one_other = len(alike) == 2
        others = "one other compensator has" if one_other else f"{len(alike) - 1} other compensators have"
        verb = "is" if one_other else "are"
        two = (
            f"{cost}; {others} the same worst-case error within {100 * ALIKE:.0f} %, but {verb} neither clearly less "
            "noisy nor more than twice as fast."
        )
    else:
        two = f"{cost}; no other compensator has as small a worst-case error without more noise."
    if len(improving) < 2:
        return Recommendation(first.name, f"{one} {two}", first.gain)
    second = improving[1]
    assert second.metrics is not None
    assert second.worst is not None
    also = (
        f"{second.name} reaches {shown(second.metrics.rms, unit)} rms and {shown(second.worst, unit)} in the worst "
        f"case, for {second.cost_ns or 0.0:.0f} ns per sample."
    )
    return Recommendation(first.name, f"{one} {two}", first.gain, second.name, also)


def worst_case(row: CompensatorResult) -> str:
    """Return the mismatch of the runs that include the worst case in words; empty without such runs."""
    largest = max((abs(corner.friction - 1.0) for corner in row.corners), default=0.0)
    return f"with friction and mass {100.0 * largest:.3g} % off" if row.corners else ""


def shown(value: float, unit: str) -> str:
    """Return a length or an angle with a suitable unit prefix."""
    for factor, prefix in ((1.0, ""), (1e3, "m"), (1e6, "µ")):
        if abs(value) * factor >= 1.0:
            return f"{value * factor:.3g} {prefix}{unit}"
    return f"{value * 1e9:.3g} n{unit}"


def _judged(none: CompensatorResult, row: CompensatorResult) -> CompensatorResult:
    """Return the result with `worst`, `best`, `improves` and `noisy` set."""
    row = extremes(row, none)
    pairs = [
        (none.metrics, row.metrics),
        *((a.metrics, b.metrics) for a, b in zip(none.corners, row.corners, strict=True)),
    ]
    improves = all(a is None or (b is not None and b.rms <= (1.0 - WORTH) * a.rms) for a, b in pairs)
    return replace(row, improves=improves, noisy=_noisy(none.metrics, row.metrics))


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
    """Return the first result, in order of error, whose cost is within a factor of two of the lowest.

    Measured times are not more accurate than that.
    """
    least = min(row.cost_ns or 0.0 for row in rows)
    return next(row for row in rows if (row.cost_ns or 0.0) <= 2.0 * least)


def _worst(row: CompensatorResult) -> float:
    """Return the worst-case error rounded to six digits: differences in the last bits must not decide the order."""
    return float("inf") if row.worst is None else float(f"{row.worst:.6g}")


def _smallest(rows: Sequence[CompensatorResult]) -> float:
    return min(_worst(row) for row in rows)
