"""Findings about positions and forces that are not those of the axis: jumps, clipped values, held samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from friction_fmus.identification.data.record import Record, RecordFinding

JUMP: Final = 10.0  # ratio of a step of the position to the usual largest step that is a jump
OTHERS: Final = 0.99  # fraction of the steps that are no jumps
LONG: Final = 5  # smallest number of samples at the largest or smallest value that may be clipped
FAST: Final = 0.5  # fraction of the usual speed just before a stop above which the position is clipped
HELD: Final = 0.1  # fraction of the steps between moving samples that are zero above which the position is held


def position_findings(records: Sequence[Record]) -> Iterator[RecordFinding]:
    """Yield findings after which no parameter can be identified from these records."""
    for record in records:
        if record.q is None or np.ptp(record.q) == 0.0:
            continue
        found = [*_jumps(record), *_clipped(record), *_held(record)]
        if found:
            yield from found
            return


def _jumps(record: Record) -> Iterator[RecordFinding]:
    """Yield a finding about a position that jumps, such as an angle that wraps or a counter that was reset."""
    steps = np.abs(np.diff(record.column("q")))
    usual = float(np.quantile(steps, OTHERS))
    beside = np.maximum(np.append(steps[1:], 0.0), np.append(0.0, steps[:-1]))
    largest = np.maximum(usual, np.minimum(beside, 0.5 * steps))
    at = np.flatnonzero(steps > JUMP * np.maximum(largest, 3.0 * record.quantum))
    if record.units.position == "rad":
        at = np.union1d(at, np.flatnonzero(steps > np.pi))
    if at.size and usual > 0.0:
        u = record.units.position
        times = "once" if at.size == 1 else f"{at.size} times"
        what = (
            f"The position jumps by {steps[at].max():.4g} {u} from one sample to the next, {times}, first at "
            f"t = {record.t[at[0]]:.6g} s."
        )
        yield RecordFinding("position-jumps", what, "Log a continuous position, or choose windows without jumps.")


def _clipped(record: Record) -> Iterator[RecordFinding]:
    """Yield a finding about a position that stops at its largest or smallest value without slowing down before."""
    q = record.column("q")
    steps = np.abs(np.diff(q))
    usual = float(np.median(steps[steps > 0.0])) if steps.any() else 0.0
    for word, side in (("largest", 1.0), ("smallest", -1.0)):
        limit = float(np.max(side * q))
        begins, ends = _runs(side * q >= limit)
        long = ends - begins >= LONG
        entered = [steps[b - 2] for b in begins[long] if b >= 2]
        left = [steps[e] for e in ends[long] if e < len(steps)]
        speeds = [*entered, *left]
        if len(speeds) >= 2 and float(np.median(speeds)) > FAST * max(usual, 3.0 * record.quantum):
            share = float(np.sum((ends - begins)[long])) / len(q)
            what = (
                f"The position stops at its {word} value, {side * limit:.4g} {record.units.position}, without slowing "
                f"down before, for {100 * share:.2g} % of the time; it is clipped."
            )
            yield RecordFinding("position-clipped", what, "Log the whole motion, or choose windows within it.")
            return


def _held(record: Record) -> Iterator[RecordFinding]:
    """Yield a finding about a position that is updated less often than it is logged, at varying intervals."""
    steps = np.abs(np.diff(record.column("q")))
    moved = steps > max(5.0 * record.quantum, 0.2 * float(np.quantile(steps, 0.9)))
    between = (steps[1:-1] == 0.0) & (moved[:-2] | moved[2:])
    share = float(np.count_nonzero(between)) / max(float(np.count_nonzero(moved)), 1.0)
    if np.count_nonzero(moved) >= 20 and share > HELD:
        what = f"The position does not change in {100 * share:.2g} % of the samples beside one at which it moves fast."
        yield RecordFinding("position-held", what, "Log the position as often as the other signals.")


def _runs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first index of each run of true values, and the one behind its last."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
