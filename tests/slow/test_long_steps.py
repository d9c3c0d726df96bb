"""Steps so long that a block may refuse them: it says so within five seconds."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping

import pytest
from shell.instance import DISCARD, OK, WARNING, Instance, Library, signals

from friction_fmus import catalogue

COUNTING = tuple(name for name, block in catalogue().items() if re.search(r"\bCOUNT\s*\(", block.code))
"""Blocks with parameters that are numbers of something."""


def largest_counts(library: Library) -> dict[str, float]:
    """The parameters that are numbers of something, at their maxima."""
    counts = (v for v in library.variables.values() if v.causality == "parameter" and v.type == "Integer")
    return {v.name: float(v.max) for v in counts if v.max is not None and float(v.max) <= 1e6}


def long_step(library: Library, h: float, counts: Mapping[str, float]) -> None:
    """A step within the time that the block promises: done, or refused with the reason."""
    with Instance(library) as run:
        run.setup()
        run.must("EnterInitializationMode")
        run.set(counts)
        run.must("ExitInitializationMode")
        run.set(signals(library, 1, 1)[0])
        before, begin = run.everything(), time.process_time()
        status = run.call("DoStep", 0.0, h, 1)
        assert time.process_time() - begin < 5.0
        assert status in (OK, WARNING, DISCARD)
        if status == DISCARD:
            assert b"step" in run.messages[-1][-1]
            assert run.everything() == before


@pytest.mark.parametrize("h", [1e3, 1e6, 1e300])
def test_no_step_takes_longer_than_five_seconds(library: Library, h: float) -> None:
    long_step(library, h, {})


@pytest.mark.parametrize("h", [1e3, 1e6, 1e300])
@pytest.mark.parametrize("library", COUNTING, indirect=True)
def test_no_step_with_the_largest_counts_takes_longer_than_five_seconds(library: Library, h: float) -> None:
    long_step(library, h, largest_counts(library))
