"""Saved states of every block, and instances beside each other: nothing is lost, nothing is shared."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from shell.elsewhere import Elsewhere
from shell.instance import Instance, Library, drive, signals
from shell.jobs import continued

H = 1e-3


@pytest.fixture
def running(library: Library, instance: Instance) -> Instance:
    """In the middle of a run, at 30 H."""
    instance.initialise()
    drive(instance, signals(library, 1, 30), 0.0, H)
    return instance


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(continued)
    yield made
    made.end()


def now(instance: Instance) -> float:
    return instance.get1("time")


def test_a_restored_state_continues_with_the_same_bits(library: Library, running: Instance) -> None:
    t = now(running)
    with running.saved() as state:
        first = drive(running, signals(library, 2, 30), t, H)
        running.must("SetFMUstate", state)
        assert now(running) == t
        assert drive(running, signals(library, 2, 30), t, H) == first


def test_a_state_outlives_steps_that_promise_never_to_return(library: Library, running: Instance) -> None:
    """Masters pass noSetFMUStatePriorToCurrentPoint = true always, also when they go back."""
    t, before = now(running), running.everything()
    with running.saved() as early, running.saved() as same:
        running.must("DoStep", t, H, 1)
        with running.saved():
            running.must("SetFMUstate", early)
            assert running.everything() == before
        running.must("SetFMUstate", same)
        assert running.everything() == before


def test_a_serialised_state_continues_in_another_process(
    library: Library, running: Instance, elsewhere: Elsewhere, tmp_path: Path
) -> None:
    """Straight after fmi2Instantiate, without fmi2SetupExperiment: the state carries the mode."""
    t, data = now(running), running.serialised()
    expected = b"".join(drive(running, signals(library, 2, 30), t, H))
    fmu = Path(shutil.copy(library.fmu, tmp_path))
    assert elsewhere.run(fmu, tmp_path / "trace.txt", data, t, H) == expected


def test_a_state_fits_another_instance(library: Library, running: Instance) -> None:
    t, data = now(running), running.serialised()
    with Instance(library, b"other") as other:
        other.restore(data)
        assert other.everything() == running.everything()
        assert drive(other, signals(library, 3, 20), t, H) == drive(running, signals(library, 3, 20), t, H)


def test_the_same_state_has_the_same_bytes(library: Library) -> None:
    histories = []
    for _ in range(2):
        with Instance(library) as run:
            run.initialise()
            drive(run, signals(library, 1, 10), 0.0, H)
            histories.append(run.serialised())
            run.restore(histories[-1])
            assert run.serialised() == histories[-1]
    assert histories[0] == histories[1]


def test_a_reset_instance_is_a_new_one(library: Library) -> None:
    with Instance(library) as used, Instance(library) as new:
        used.initialise(start=3.0, tolerance=1e-4, stop=4.0)
        drive(used, signals(library, 1, 30), 3.0, H)
        used.must("Terminate")
        used.must("Reset")
        assert used.serialised() == new.serialised()
        for run in (used, new):
            run.initialise()
        assert used.everything() == new.everything()
        assert drive(used, signals(library, 2, 50), 0.0, H) == drive(new, signals(library, 2, 50), 0.0, H)


def test_instances_in_turn_are_each_as_if_alone(library: Library) -> None:
    alone = []
    for seed in (1, 2):
        with Instance(library) as run:
            run.initialise()
            alone.append(drive(run, signals(library, seed, 50), 0.0, H))
    together: list[list[bytes]] = [[], []]
    with Instance(library, b"first") as first, Instance(library, b"second") as second:
        for run in (first, second):
            run.initialise()
        t = 0.0
        for inputs in zip(signals(library, 1, 50), signals(library, 2, 50), strict=True):
            for k, run in enumerate((first, second)):
                together[k] += drive(run, [inputs[k]], t, H)
            t += H
    assert together == alone


def test_threads_with_an_instance_each_are_as_if_alone(library: Library) -> None:
    def run(seed: int, into: dict[int, list[bytes]]) -> None:
        with Instance(library) as instance:
            instance.initialise()
            into[seed] = drive(instance, signals(library, seed, 200), 0.0, H)

    alone: dict[int, list[bytes]] = {}
    for seed in range(4):
        run(seed, alone)
    together: dict[int, list[bytes]] = {}
    threads = [threading.Thread(target=run, args=(seed, together)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert together == alone
