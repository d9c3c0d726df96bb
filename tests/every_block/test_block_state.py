"""Saved states of every block, and instances beside each other: nothing is lost, nothing is shared."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from shell.elsewhere import Elsewhere
from shell.exchanging import SITUATIONS, begin, each_kind, go_on, go_to, need
from shell.instance import CO_SIMULATION, MODEL_EXCHANGE, Instance, Library, signals
from shell.jobs import continued
from shell.selection import one_of_each

H = 1e-3
BETWEEN_STEPS = {CO_SIMULATION: "co-simulation", MODEL_EXCHANGE: "continuous-time mode"}
THREADS = {CO_SIMULATION: 4, MODEL_EXCHANGE: 16}
STEPS = {CO_SIMULATION: 200, MODEL_EXCHANGE: 20}


def begun(
    run: Instance, situation: str, seed: int, count: int, start: float = 0.0, *limits: float | None
) -> list[bytes]:
    """A new run of so many steps, which ends in the situation."""
    kind = SITUATIONS[situation]
    begin(run, kind, start, *limits)
    trajectory = go_on(run, BETWEEN_STEPS[kind], signals(run.library, seed, count), start, H)
    go_to(run, situation)
    return trajectory


@pytest.fixture
def running(library: Library, situation: str) -> Iterator[Instance]:
    """In the middle of a run, at 30 H."""
    with Instance(library, kind=SITUATIONS[situation]) as made:
        begun(made, situation, 1, 30)
        yield made


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(continued)
    yield made
    made.end()


def now(instance: Instance) -> float:
    return instance.get1("time")


def test_a_restored_state_continues_with_the_same_bits(library: Library, situation: str, running: Instance) -> None:
    t = now(running)
    with running.saved() as state:
        first = go_on(running, situation, signals(library, 2, 30), t, H)
        running.must("SetFMUstate", state)
        assert now(running) == t
        assert go_on(running, situation, signals(library, 2, 30), t, H) == first


def test_a_state_outlives_steps_that_promise_never_to_return(
    library: Library, situation: str, running: Instance
) -> None:
    """Masters pass noSetFMUStatePriorToCurrentPoint = true always, also when they go back."""
    t, before = now(running), running.everything()
    with running.saved() as early, running.saved() as same:
        go_on(running, situation, signals(library, 2, 1), t, H)
        with running.saved():
            running.must("SetFMUstate", early)
            assert running.everything() == before
        running.must("SetFMUstate", same)
        assert running.everything() == before


def test_a_serialised_state_continues_in_another_process(
    library: Library, situation: str, running: Instance, elsewhere: Elsewhere, tmp_path: Path
) -> None:
    """Straight after fmi2Instantiate, without fmi2SetupExperiment: the state carries the mode."""
    t, data = now(running), running.serialised()
    expected = b"".join(go_on(running, situation, signals(library, 2, 30), t, H))
    fmu = Path(shutil.copy(library.fmu, tmp_path))
    assert elsewhere.run(fmu, tmp_path / "trace.txt", data, t, H, situation) == expected


def test_a_state_fits_another_instance(library: Library, situation: str, running: Instance) -> None:
    t, data, inputs = now(running), running.serialised(), signals(library, 3, 20)
    with Instance(library, b"other", kind=SITUATIONS[situation]) as other:
        other.restore(data)
        assert other.everything() == running.everything()
        assert go_on(other, situation, inputs, t, H) == go_on(running, situation, inputs, t, H)


def test_the_same_state_has_the_same_bytes(library: Library, situation: str) -> None:
    histories = []
    for _ in range(2):
        with Instance(library, kind=SITUATIONS[situation]) as run:
            begun(run, situation, 1, 10)
            histories.append(run.serialised())
            run.restore(histories[-1])
            assert run.serialised() == histories[-1]
    assert histories[0] == histories[1]


def test_a_reset_instance_is_a_new_one(library: Library, situation: str) -> None:
    kind = SITUATIONS[situation]
    with Instance(library, kind=kind) as used, Instance(library, kind=kind) as new:
        begun(used, situation, 1, 30, 3.0, 1e-4, 4.0)
        used.must("Terminate")
        used.must("Reset")
        assert used.serialised() == new.serialised()
        assert begun(used, situation, 2, 50) == begun(new, situation, 2, 50)
        assert used.everything() == new.everything()


@each_kind
def test_instances_in_turn_are_each_as_if_alone(library: Library, kind: int) -> None:
    need(library, kind)
    situation = BETWEEN_STEPS[kind]
    alone = []
    for seed in (1, 2):
        with Instance(library, kind=kind) as run:
            alone.append(begun(run, situation, seed, 50))
    together: list[list[bytes]] = [[], []]
    with Instance(library, b"first", kind=kind) as first, Instance(library, b"second", kind=kind) as second:
        for run in (first, second):
            begin(run, kind)
        t = 0.0
        for inputs in zip(signals(library, 1, 50), signals(library, 2, 50), strict=True):
            for k, run in enumerate((first, second)):
                together[k] += go_on(run, situation, [inputs[k]], t, H)
            t += H
    assert together == alone


@one_of_each
@each_kind
def test_threads_with_an_instance_each_are_as_if_alone(library: Library, kind: int) -> None:
    need(library, kind)

    def run(seed: int, into: dict[int, list[bytes]]) -> None:
        with Instance(library, kind=kind) as instance:
            into[seed] = begun(instance, BETWEEN_STEPS[kind], seed, STEPS[kind])

    alone: dict[int, list[bytes]] = {}
    for seed in range(THREADS[kind]):
        run(seed, alone)
    together: dict[int, list[bytes]] = {}
    threads = [threading.Thread(target=run, args=(seed, together)) for seed in range(THREADS[kind])]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert together == alone
