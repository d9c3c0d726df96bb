"""The errors that runs state, against known answers: how many are covered, and what the suggested steps reach."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np
import pytest
from accuracy.known import Known, again, cases, reference, true_error
from thorough import nightly, some

from harness import Result

REQUIRED = 0.01
NOTHING = 1e-8
"""Range below which a variable counts as constant, as docs/trust.md says [m, m/s, N]."""
OF_THE_REFERENCE = 1e-10
LONGEST = 64
"""Largest quotient of steps of a suggestion that is tried."""

pytestmark = nightly


@dataclass(frozen=True)
class Row:
    """One variable of one run.

    Parameters
    ----------
    what : str
        Run and variable.
    verdict : str
        As stated.
    bound, error : float
        The largest ones over the range, the error beside events that the run states to be late.
    share : float
        Share of the rows whose error is within their bound.
    """

    what: str
    verdict: str
    bound: float
    error: float
    share: float

    @property
    def covered(self) -> bool:
        return self.error <= self.bound and self.share >= 0.95


def judged(case: Known, result: Result, right: Result) -> list[Row]:
    """What a run states beside what is true."""
    rows = []
    for name in case.record:
        attributes, bound = result[name].attrs, result[f"{name}.bound"].to_numpy()
        size = max(float(np.ptp(right[name].to_numpy())), NOTHING)
        error = true_error(result, right, name, attributes.get("event_error", 0.0)) - OF_THE_REFERENCE
        largest = max(0.0, float(error.max())) / size
        what = f"{case}, {name}"
        rows.append(Row(what, attributes["verdict"], bound.max() / size, largest, float(np.mean(error <= bound))))
    return rows


@pytest.fixture(scope="module")
def runs() -> tuple[list[Row], list[tuple[str, bool]]]:
    """All rows, and which suggestions reach what is required."""
    rows: list[Row] = []
    suggestions = []
    logging.getLogger("harness").setLevel(logging.ERROR)
    for case in some(cases(), cases()[::28]):
        right = reference(case)
        with case.make() as system:
            result = system.run(
                stop=case.stop, step=case.step, master=case.master, record=case.record, accuracy=REQUIRED
            )
        found = judged(case, result, right)
        rows += found
        step = result.attrs.get("suggested_step")
        if step is not None and case.step / step <= LONGEST:
            finer = again(case, round(case.step / step), result.attrs)
            suggestions.append((str(case), all(row.error <= REQUIRED for row in judged(case, finer, right))))
    logging.getLogger("harness").setLevel(logging.NOTSET)
    return rows, suggestions


def test_the_bound_covers_the_error(runs: tuple[list[Row], list[tuple[str, bool]]]) -> None:
    rows, _ = runs
    bounded = [row for row in rows if math.isfinite(row.bound)]
    assert len(bounded) > 0.8 * len(rows)
    missed = [row for row in bounded if not row.covered]
    assert len(missed) <= 0.05 * len(bounded), missed


def test_nothing_is_called_right_that_is_not(runs: tuple[list[Row], list[tuple[str, bool]]]) -> None:
    rows, _ = runs
    assert [row for row in rows if row.verdict == "within tolerance" and row.error > REQUIRED] == []


def test_the_bound_is_not_much_larger_than_the_error(runs: tuple[list[Row], list[tuple[str, bool]]]) -> None:
    rows, _ = runs
    assert np.median([row.bound / row.error for row in rows if math.isfinite(row.bound) and row.error > 1e-6]) <= 10.0


def test_suggested_steps_reach_what_is_required(runs: tuple[list[Row], list[tuple[str, bool]]]) -> None:
    _, suggestions = runs
    failed = [name for name, reached in suggestions if not reached]
    assert len(failed) <= 0.1 * len(suggestions), failed
