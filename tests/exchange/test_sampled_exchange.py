"""Sampled blocks in model exchange: the samples, and so the bits, of co-simulation."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from shell.instance import CO_SIMULATION, MODEL_EXCHANGE, WARNING, EventInfo, Instance, Library, load, signals
from shell.selection import SAMPLED_BLOCKS, of_each_branch
from thorough import some

SAMPLES = 200
START = 0.5
SHORTER = {"RepetitiveController": {"N": 20}}  # so that it acts within these samples


@pytest.fixture(params=of_each_branch(SAMPLED_BLOCKS))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    return load(build_fmu(request.param))


def outputs_of(library: Library) -> list[str]:
    return [v.name for v in library.variables.values() if v.causality in ("output", "local")]


def period(library: Library) -> float:
    return library.start("Ts")


def drawn(library: Library, seed: int, count: int) -> list[dict[str, float]]:
    """Inputs of each sample; commands depart from their start values now and then, for some samples."""
    rows = signals(library, seed, count)
    draw = random.Random(seed)
    commands = library.names("input", type="Boolean")
    held = {name: library.start(name) for name in commands}
    for row in rows:
        for name in commands:
            departed = held[name] != library.start(name)
            if draw.random() < (0.4 if departed else 0.03):
                held[name] = 1.0 - held[name]
        row.update(held)
    return rows


def co_simulated(library: Library, rows: list[dict[str, float]]) -> list[list[float]]:
    """The outputs after each step of a sample time."""
    Ts, names, found = period(library), outputs_of(library), []
    with Instance(library, kind=CO_SIMULATION) as run:
        run.initialise(START, **SHORTER.get(library.identifier, {}), **rows[0])
        for k, row in enumerate(rows):
            run.set(row)
            run.step(START + k * Ts, Ts)
            found.append(run.get(*names))
    return found


def sample(run: Instance, t: float, row: Mapping[str, float]) -> EventInfo:
    """The event at t of an instance in continuous-time mode, with these inputs."""
    run.must("SetTime", t)
    run.must("EnterEventMode")
    run.set(row)
    info = run.event()
    run.must("EnterContinuousTimeMode")
    return info


def exchanged(library: Library, rows: list[dict[str, float]]) -> list[list[float]]:
    """The outputs after the event at each sample time; between these they are held whatever the inputs are."""
    Ts, names, found = period(library), outputs_of(library), []
    reals = library.names("input", type="Real")
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.initialise(START, **SHORTER.get(library.identifier, {}), **rows[0])
        info = run.event()
        run.must("EnterContinuousTimeMode")
        for k, row in enumerate(rows):
            if k > 0:
                info = sample(run, START + k * Ts, row)
            found.append(run.get(*names))
            assert (info.defined, info.again, info.terminate, info.states_changed) == (1, 0, 0, 0)
            assert info.next == START + (k + 1) * Ts
            run.must("SetTime", START + (k + 0.5) * Ts)
            run.set({name: -2.0 * row[name] for name in reals})
            assert run.get(*names) == found[-1]
            run.set({name: row[name] for name in reals})
    return found


@pytest.mark.parametrize("seed", some([1, 2], [1]))
def test_the_outputs_are_those_of_co_simulation(library: Library, seed: int) -> None:
    rows = drawn(library, seed, SAMPLES)
    expected, found = co_simulated(library, rows), exchanged(library, rows)
    assert found == expected
    if library.names("input") and (library.identifier, seed) != (
        "IterativeLearning",
        2,
    ):  # interrupted in its first trial
        assert len({*map(tuple, found)}) > 1, "the inputs do nothing"


def test_an_importer_that_jumps_over_samples_gets_them_all(library: Library) -> None:
    """With the inputs of the event, as co-simulation has them in one long step."""
    Ts, names = period(library), outputs_of(library)
    row, other = drawn(library, 3, 2)
    with Instance(library, kind=CO_SIMULATION) as run:
        run.initialise(START, **row)
        run.step(START, Ts)
        run.set(other)
        run.step(START + Ts, 7.0 * Ts)
        expected = run.get(*names)
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.exchange(START, **row)
        info = sample(run, START + 7.3 * Ts, other)
        assert run.get(*names) == expected
        assert info.next == START + 8.0 * Ts
        assert run.get1("time") == START + 7.3 * Ts


def test_an_event_before_the_next_sample_takes_none(library: Library) -> None:
    Ts, names = period(library), outputs_of(library)
    row, other = drawn(library, 4, 2)
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.exchange(START, **row)
        before = run.get(*names)
        for share in (0.0, 0.5, 0.999):
            assert sample(run, START + share * Ts, other).next == START + Ts
            assert run.get(*names) == before


def test_a_fault_is_held_as_in_co_simulation(library: Library) -> None:
    """NaN for some samples: `fault`, the outputs before it, one warning; then it goes on with the same bits."""
    reals = library.names("input", type="Real")
    if "fault" not in library.variables or not reals:
        pytest.skip("the block has no guarded input")
    rows = drawn(library, 5, 30)
    for k, bad in zip(range(10, 15), (math.nan, math.inf, -math.inf, math.nan, math.nan), strict=True):
        rows[k][reals[k % len(reals)]] = bad
    expected, found = co_simulated(library, rows), exchanged(library, rows)
    fault = outputs_of(library).index("fault")
    assert [row[fault] for row in found] == [float(10 <= k < 15) for k in range(30)]
    assert found == expected
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.exchange(START, **rows[0])
        for k in (10, 11):
            sample(run, START + k * period(library), rows[k])
        assert [status for _, status, _, _ in run.messages] == [WARNING]


def test_before_the_first_sample_the_outputs_are_those_that_it_will_give(library: Library) -> None:
    """In initialization mode, after it, and after the first event, in both kinds."""
    row = drawn(library, 6, 1)[0]
    names = library.names("output")
    shown = []
    for kind in (CO_SIMULATION, MODEL_EXCHANGE):
        with Instance(library, kind=kind) as run:
            run.setup(START)
            run.must("EnterInitializationMode")
            run.set(row)
            shown.append(run.get(*names))
            run.must("ExitInitializationMode")
            shown.append(run.get(*names))
            if kind == MODEL_EXCHANGE:
                run.event()
            else:
                run.step(START, period(library))
            shown.append(run.get(*names))
    assert all(each == shown[0] for each in shown)


@pytest.mark.parametrize("start", [1e17, 1e300])
def test_a_time_in_which_the_period_is_lost_is_refused_and_not_waited_for(library: Library, start: float) -> None:
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.initialise(start)
        before = run.serialised()
        info = EventInfo(next=-7.0)
        status = run.call("NewDiscreteStates", info)
        assert status in (0, WARNING) or (run.serialised() == before and info.next == -7.0)


def test_an_event_of_more_samples_than_a_call_takes_is_refused_and_takes_none(library: Library) -> None:
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.exchange(START, **drawn(library, 5, 1)[0])
        run.must("SetTime", START + 1.1e6 * period(library))
        run.must("EnterEventMode")
        before = run.serialised()
        assert run.call("NewDiscreteStates", EventInfo()) not in (0, WARNING)
        assert run.serialised() == before


@pytest.mark.parametrize("early", [0.0, -1.0, 1.0])
def test_samples_at_large_times(build_fmu: Callable[..., Path], early: float) -> None:
    """From a Unix time, where an importer may miss the time of an event by a rounding error: each event is a sample.

    The difference of two samples of a position that moves by Ts in each is Ts, so the velocity is 1.
    """
    unix, Ts = 1.7e9, 2e-3
    with Instance(load(build_fmu("Differentiator")), kind=MODEL_EXCHANGE) as run:
        run.initialise(unix, Ts=Ts, window=1, v0=1.0)
        info = run.event()
        run.must("EnterContinuousTimeMode")
        for k in range(1, 3000):
            assert info.next == pytest.approx(unix + k * Ts, abs=1e-6)
            info = sample(run, info.next + early * math.ulp(unix), {"x": k * Ts})
            assert run.get1("v") == pytest.approx(1.0, abs=1e-6), k
