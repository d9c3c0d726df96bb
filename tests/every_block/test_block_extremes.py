"""Steps and inputs at the ends of what a double can be: a right answer, or a refusal with the reason."""

from __future__ import annotations

import math

import pytest
from shell.instance import DISCARD, OK, WARNING, Instance, Library


def outputs(run: Instance) -> list[float]:
    return run.get(*run.library.names("output"))


@pytest.mark.parametrize("h", [1e3, 1e-9])
def test_huge_and_tiny_steps_are_answered_or_refused_with_the_reason(library: Library, h: float) -> None:
    with Instance(library) as run:
        run.initialise()
        before, state = run.everything(), run.serialised()
        status = run.call("DoStep", 0.0, h, 1)
        assert status in ((OK,) if h < 1.0 else (OK, WARNING, DISCARD))
        if status == DISCARD:
            assert b"step" in run.messages[-1][-1]
            assert run.everything() == before
            run.restore(state)
            run.step(0.0, 1e-3)
        assert all(map(math.isfinite, outputs(run)))


def test_denormal_inputs_are_inputs(library: Library) -> None:
    with Instance(library) as run:
        run.initialise()
        for k in range(20):
            run.set(dict.fromkeys(library.names("input", type="Real"), (-1) ** k * 5e-324))
            run.step(k * 1e-3, 1e-3)
            assert all(map(math.isfinite, outputs(run)))
