"""Refused calls of model exchange: vectors of another length, values that are not finite, trials of a solver."""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import c_double
from pathlib import Path

import pytest
from shell.exchanging import refused_with_a_message
from shell.instance import DISCARD, ERROR, MODEL_EXCHANGE, OK, EventInfo, Instance, Library, load, signals
from shell.selection import COMPOSITES, CONTINUOUS_BLOCKS, of_each_branch
from shell.test_values import guarded

NOT_FINITE = (math.nan, math.inf, -math.inf)
VECTORS = (
    "SetContinuousStates",
    "GetContinuousStates",
    "GetNominalsOfContinuousStates",
    "GetDerivatives",
    "GetEventIndicators",
)
UNTOUCHED = -7.25


@pytest.fixture(params=[*of_each_branch(CONTINUOUS_BLOCKS), *COMPOSITES])
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each continuous block that is for model exchange, and two composites."""
    found = load(build_fmu(request.param))
    if not found.exchanges:
        pytest.skip("the block is for co-simulation only")
    return found


def working(library: Library) -> Instance:
    """In continuous-time mode, with inputs."""
    run = Instance(library, kind=MODEL_EXCHANGE)
    return run.exchange(**signals(library, 1, 1)[0])


def test_a_vector_of_another_length_is_refused(library: Library) -> None:
    with working(library) as run:
        for function in VECTORS:
            right = library.indicators if function == "GetEventIndicators" else library.states
            for n in {right - 1, right + 1, right + 1000, 2**31} - {-1, right}:
                values = (c_double * (right + 1))(*[UNTOUCHED] * (right + 1))
                assert refused_with_a_message(run, function, values, n), (function, n)
                assert {*values} == {UNTOUCHED}
            assert run.call(function, None, right) == (ERROR if right else OK)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_times_that_are_not_finite_are_refused(library: Library, bad: float) -> None:
    with working(library) as run:
        assert refused_with_a_message(run, "SetTime", bad)
        run.must("EnterEventMode")
        assert refused_with_a_message(run, "SetTime", bad)
        assert run.get1("time") == 0.0


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_states_and_inputs_that_are_not_finite_are_discarded(library: Library, bad: float) -> None:
    n = library.states
    with working(library) as run:
        before, x = run.serialised(), run.vector("GetContinuousStates", n)
        for k in range(n):
            values = (c_double * n)(*(bad if i == k else x[i] + 1e-9 for i in range(n)))
            assert run.call("SetContinuousStates", values, n) == DISCARD
            assert run.messages[-1][1:3] == (DISCARD, "logStatusDiscard")
            assert run.serialised() == before
        for name in {*library.names("input", type="Real")} - guarded(library):
            assert run.try_set({name: bad}) == [DISCARD]
            assert run.serialised() == before


def trials(library: Library, run: Instance) -> list[Callable[[], int]]:
    """A solver may try any time, states and inputs that are finite."""
    n, tried = library.states, []
    for size in (1e308, -1.7e308, 1e160, 1e100):
        tried += [lambda name=name, x=size: run.try_set({name: x})[0] for name in library.names("input", type="Real")]
        tried += [
            lambda k=k, x=size: run.call("SetContinuousStates", (c_double * n)(*(x * (i == k) for i in range(n))), n)
            for k in range(n)
        ]
        tried.append(lambda x=size: run.call("SetTime", x))
    return tried


def test_a_trial_that_is_not_finite_is_discarded_and_changes_nothing_else(library: Library) -> None:
    """In continuous-time mode; in event mode the same values are an error, and the event changes nothing."""
    n, z = library.states, library.indicators
    with working(library) as run, run.saved() as good:
        expected = run.everything(), run.vector("GetDerivatives", n), run.vector("GetEventIndicators", z)
        for trial in trials(library, run):
            run.must("SetFMUstate", good)
            assert trial() == OK
            for function, count in (("GetEventIndicators", z), ("GetDerivatives", n), ("GetContinuousStates", n)):
                before, values = run.serialised(), (c_double * count)(*[UNTOUCHED] * count)
                status = run.call(function, values, count)
                assert status in (OK, DISCARD)
                if status == OK:
                    assert all(map(math.isfinite, values))
                else:
                    assert run.messages[-1][1:3] == (DISCARD, "logStatusDiscard")
                    assert run.serialised() == before and {*values} <= {UNTOUCHED}
            run.must("EnterEventMode")
            before, info = run.serialised(), EventInfo(next=UNTOUCHED)
            if run.call("NewDiscreteStates", info) == ERROR:
                assert run.serialised() == before and info.next == UNTOUCHED
        run.must("SetFMUstate", good)
        assert (run.everything(), run.vector("GetDerivatives", n), run.vector("GetEventIndicators", z)) == expected


def test_a_solver_goes_on_after_a_discarded_trial(build_fmu: Callable[..., Path]) -> None:
    """With the values of before, set again, as solvers do."""
    library = load(build_fmu("LuGre"))
    with working(library) as run, working(library) as undisturbed:
        x = run.vector("GetContinuousStates", 1)
        run.must("SetContinuousStates", (c_double * 1)(1e308), 1)
        assert run.call("GetDerivatives", (c_double * 1)(), 1) == DISCARD
        for each in (run, undisturbed):
            each.must("SetContinuousStates", (c_double * 1)(*x), 1)
            each.must("SetTime", 1e-3)
        assert run.vector("GetDerivatives", 1) == undisturbed.vector("GetDerivatives", 1)
        assert run.everything() == undisturbed.everything()
