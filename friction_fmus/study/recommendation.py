"""Ranking of the compensators, and the recommendation in words: reasons, ladder of improvements, what to do next.

1. A compensator improves the axis if it reduces the tracking error by at least `WORTH`, both on the identified axis and
   in every case that counts and that the servo alone survives, and by more than the numerical error of its simulation.
2. Compensators that improve the axis come first.
3. Within both groups, the smaller worst-case error comes first. Compensators whose worst-case errors are within `WORTH`
   of the smallest one are equivalent: the one with the fewest blocks comes first, then the one with the fewest cycles.
   The error of the simulated axis on the recorded motion is added to both, as the axis has it with each of them; of two
   with as many blocks, it does not make the worse one equivalent.
4. Compensators that were not run in the other cases, because their error on the identified axis is above the worst case
   of another one, follow in the order of this error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import hypot, inf
from typing import Final

from friction_fmus.blocks.axis_units import Words
from friction_fmus.listings import shown
from friction_fmus.study.compensators import INTEGRAL, TABLE
from friction_fmus.study.study_result import CompensatorResult, Metrics, Recommendation, Rung

WORTH: Final = 0.05  # smallest relative reduction of the error that counts as an improvement


def rank(none: CompensatorResult, rows: Sequence[CompensatorResult], model: float = 0.0) -> list[CompensatorResult]:
    """Rank the compensators on an axis that follows the recorded motion with the rms error `model`."""
    left = sorted(
        (_judged(none, row) for row in rows if row.metrics is not None),
        key=lambda row: (
            not row.improves,
            row.untried,
            inf if row.worst is None else row.worst,
            nominal(row),
            row.name,
        ),
    )
    ordered: list[CompensatorResult] = []
    while left:
        alike = [row for row in left if equivalent(left[0], row, model)]
        left = [row for row in left if row not in alike]
        alike.sort(key=lambda row: (blocks(row), inf if row.worst is None else row.worst, row.name))
        while alike:  # of as many blocks, only errors within `WORTH` are as good, as the model has one error with both
            close = [row for row in alike if blocks(row) == blocks(alike[0]) and equivalent(alike[0], row, 0.0)]
            ordered.append(min(close, key=_simplicity))
            alike.remove(ordered[-1])
    ranked = [replace(row, rank=place) for place, row in enumerate(ordered, start=1)]
    return ranked + [row for row in rows if row.metrics is None]


def _simplicity(row: CompensatorResult) -> tuple[int, float, float, str]:
    """Return what orders equivalent compensators; differences in the last digits of the error must not decide."""
    worst = inf if row.worst is None else float(f"{row.worst:.3g}")
    return blocks(row), inf if row.cycles is None else row.cycles, worst, row.name


def equivalent(best: CompensatorResult, row: CompensatorResult, model: float) -> bool:
    """Return whether a compensator is as good as a better one: its worst-case error is at most `WORTH` larger."""
    if best.worst is None or row.worst is None:
        return row is best or (best.worst is row.worst and best.improves == row.improves and not row.untried)
    return best.improves == row.improves and within_worth(best.worst, row.worst, model)


def within_worth(best: float, error: float, model: float) -> bool:
    """Return whether an error is at most `WORTH` above the smallest one, on an axis with the error `model` besides."""
    return (1.0 - WORTH) * hypot(error, model) <= hypot(best, model)


def nominal(row: CompensatorResult) -> float:
    """Return the error on the identified axis."""
    return inf if row.metrics is None else row.metrics.rms


def blocks(row: CompensatorResult) -> int:
    """Return the number of blocks that a compensator adds to the servo."""
    return row.name.count("+") + 1


def extremes(row: CompensatorResult, none: CompensatorResult) -> CompensatorResult:
    """Return the result with its extreme errors over the worst cases; no largest if a run fails only with it."""
    if row.metrics is not None and none.corners and not row.corners:
        return replace(row, untried=True)
    possible = zip(none.corners, row.corners, strict=True)
    runs = [row.metrics, *(own.metrics for alone, own in possible if own.counts and alone.metrics is not None)]
    errors = [run.rms for run in runs if run is not None]
    failed = any(run is None for run in runs)
    return replace(row, best=min(errors, default=None), worst=None if failed else max(errors))


def _judged(none: CompensatorResult, row: CompensatorResult) -> CompensatorResult:
    """Return the result with `worst`, `best` and `improves` set."""
    row = extremes(row, none)
    cases = () if row.untried else zip(none.corners, row.corners, strict=True)
    counted = [(a.metrics, b.metrics) for a, b in cases if b.counts]
    improves = all(_reduces(a, b) for a, b in [(none.metrics, row.metrics), *counted])
    return replace(row, improves=improves and _certain(none.metrics, row.metrics))


def _reduces(without: Metrics | None, own: Metrics | None) -> bool:
    return without is None or (own is not None and own.rms <= (1.0 - WORTH) * without.rms)


def _certain(without: Metrics | None, own: Metrics | None) -> bool:
    """Return whether the numerical error of a simulation is smaller than the improvement that it shows."""
    if without is None or own is None or own.rms_bound is None:
        return True
    return own.rms_bound <= without.rms - own.rms


AS_MEASURED = "as measured"
FEEDFORWARD = "with velocity and acceleration feedforward"


def ladder(
    measured: Metrics | None, motion: bool, none: CompensatorResult, ranked: Sequence[CompensatorResult]
) -> tuple[Rung, ...]:
    """Return the rungs from the axis as measured to the best compensation."""
    rungs = [] if measured is None else [Rung(AS_MEASURED, "", measured)]
    if motion and none.metrics is not None:
        rungs.append(Rung(FEEDFORWARD, none.name, none.metrics))
    steps = (
        ("integral action", "with integral action"),
        ("feedforward", "with friction feedforward"),
        ("estimator", "with an estimator"),
        ("feedforward with estimator", "with feedforward and estimator"),
        (TABLE.kind, "with a table over position"),
    )
    for kind, title in steps:
        row = next((row for row in ranked if row.kind == kind and row.rank is not None), None)
        if row is not None and row.metrics is not None:
            rungs.append(Rung(title, row.name, row.metrics))
    return tuple(
        replace(rung, title=f"{rung.title} (no improvement)") if place and not improves(rungs[:place], rung) else rung
        for place, rung in enumerate(rungs)
    )


def improves(before: Sequence[Rung], rung: Rung) -> bool:
    """Return whether a rung has a smaller error than those before it, by more than can be ignored."""
    return rung.metrics.rms <= (1.0 - WORTH) * min(each.metrics.rms for each in before)


def largest_step(rungs: Sequence[Rung]) -> tuple[Rung, Rung] | None:
    """Return the rung that reduces the error most and the best rung before it; None if no rung improves it."""
    best: tuple[float, Rung, Rung] | None = None
    for place, rung in enumerate(rungs[1:], start=1):
        before = min(rungs[:place], key=lambda each: each.metrics.rms)
        factor = before.metrics.rms / rung.metrics.rms if rung.metrics.rms > 0.0 else 1.0
        if improves(rungs[:place], rung) and (best is None or factor > best[0]):
            best = factor, before, rung
    return None if best is None else best[1:]


def recommend(
    none: CompensatorResult,
    ranked: Sequence[CompensatorResult],
    rungs: Sequence[Rung],
    u: Words,
    contradicted: Mapping[str, str] | None = None,
    model: float = 0.0,
) -> Recommendation:
    """Return the recommended compensator with the reasons."""
    tried = [row for row in ranked if row.rank is not None]
    if not tried:
        return Recommendation("", "No compensator could be simulated on this axis. The table states the reasons.")
    first = tried[0]
    assert none.metrics is not None
    assert first.metrics is not None
    unit = u.m
    start = _start(rungs, unit, first.name)
    if not first.improves:
        nearest = min(tried, key=lambda row: (row.worst is None, row.worst, row.name))
        assert nearest.metrics is not None
        what = f"{shown(nearest.metrics.rms, unit)} on the identified axis"
        if nearest.worst is not None and nearest.corners:
            what += f" and {shown(nearest.worst, unit)} in the worst case"
        return Recommendation(
            none.name,
            f"{start}No compensator reduces the tracking error of {shown(none.metrics.rms, unit)} rms by at least "
            f"{100 * WORTH:.0f} % in every case. {nearest.name} comes closest, with {what}.",
        )
    reason = (
        f"{start}{first.name} reduces the tracking error from {shown(none.metrics.rms, unit)} to "
        f"{shown(first.metrics.rms, unit)} rms"
        + (f", and in the worst case from {_worst(none, unit)} to {_worst(first, unit)}" if first.corners else "")
        + f". {_figures(none, first, u)}"
    )

    def as_good(row: CompensatorResult) -> bool:
        added = 0.0 if blocks(row) == blocks(first) else model
        return row.improves and equivalent(first, row, added) and equivalent(row, first, added)

    if same := ", ".join(row.name for row in tried[1:] if as_good(row)):
        beside = f" of the error with the {shown(model, unit)} of the simulated axis" if model else ""
        reason += f" Equivalent, within {100 * WORTH:.0f} %{beside}, but with more blocks or cycles: {same}."
    reason += "".join(f" {objection}" for objection in _objections(contradicted or {}))
    improving = [row for row in tried if row.improves]
    if len(improving) < 2:
        return Recommendation(first.name, reason, first.gain)
    second = improving[1]
    assert second.metrics is not None
    worst = "" if second.untried else f" and {_worst(second, unit)} in the worst case"
    also = f"{second.name} reaches {shown(second.metrics.rms, unit)} rms{worst}. {_figures(none, second, u)}"
    return Recommendation(first.name, reason, first.gain, second.name, also)


def _start(rungs: Sequence[Rung], unit: str, first: str) -> str:
    """Return the error of the axis as it is and the change that reduces it most, unless this is what follows."""
    if not rungs or rungs[0].title != AS_MEASURED:
        return ""
    sentence = f"Today the axis tracks to {shown(rungs[0].metrics.rms, unit)} rms"
    step = largest_step(rungs)
    if step is None:
        return f"{sentence}. "
    before, after = step
    if after.name == first and first:
        return f"{sentence}. "
    name = f" ({after.name})" if after.name not in ("", "none", INTEGRAL.name) else ""
    return (
        f"{sentence}. The largest improvement comes {after.title}{name}: from {shown(before.metrics.rms, unit)} to "
        f"{shown(after.metrics.rms, unit)}. "
    )


def _objections(contradicted: Mapping[str, str]) -> list[str]:
    """Return a sentence for each violated condition, with the compensators that violate it."""
    groups: dict[str, list[str]] = {}
    for name, wrong in contradicted.items():
        groups.setdefault(wrong.split(":")[0], []).append(name)
    return [
        f"{' and '.join([', '.join(names[:-1]), names[-1]] if names[1:] else names)} rank{'' if names[1:] else 's'} "
        f"higher, but violate{'' if names[1:] else 's'} a condition ({contradicted[names[0]]})."
        for names in groups.values()
    ]


def _figures(none: CompensatorResult, row: CompensatorResult, u: Words) -> str:
    """Return a sentence with the effort, the margins and the cost of a compensator."""
    assert none.metrics is not None
    assert row.metrics is not None
    ratio = row.metrics.effort_high / none.metrics.effort_high if none.metrics.effort_high else 1.0
    change = round(100.0 * (ratio - 1.0))
    parts = [
        f"changes the high-frequency drive {u.force} by less than 1 %"
        if abs(change) < 1
        else f"{'raises' if change > 0 else 'lowers'} the high-frequency drive {u.force} by {abs(change)} %"
    ]
    if row.margins is not None and row.margins.Ms is not None:
        margin = f"leaves a sensitivity peak of {row.margins.Ms:.2f}"
        if row.margins.delay is not None:
            margin += f" and a delay margin of {row.margins.delay:.1f} samples"
        parts.append(margin)
    if row.cycles is not None:
        parts.append(f"takes about {row.cycles:.0f} cycles a sample on a Cortex-M4F")
    return f"It {', '.join(parts[:-1])}{' and ' if len(parts) > 1 else ''}{parts[-1]}."


def _worst(row: CompensatorResult, unit: str) -> str:
    return "failure" if row.worst is None else shown(row.worst, unit)
