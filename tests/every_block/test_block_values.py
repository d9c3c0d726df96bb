"""Values of every block: all can be read, outputs follow what was set, and limits are kept."""

from __future__ import annotations

import random

import pytest
from shell.instance import DISCARD, OK, Instance, Library, signals


def test_everything_declared_can_be_read_in_initialization_mode_and_later(instance: Instance) -> None:
    instance.setup()
    instance.must("EnterInitializationMode")
    instance.everything()
    instance.must("ExitInitializationMode")
    instance.everything()
    instance.step(0.0, 0.01)
    instance.everything()
    instance.must("Terminate")
    instance.everything()


def test_what_was_set_is_read_back(library: Library, running: Instance) -> None:
    for name in library.settable():
        v = library.variables[name]
        if v.type == "Boolean":
            value = 1.0 - running.get1(name)
        else:
            value = max(min(0.75, float(v.max or "inf")), float(v.min or "-inf"))
        running.set({name: value})
        assert running.get1(name) == value, name


def test_reading_twice_gives_the_same(running: Instance) -> None:
    assert running.everything() == running.everything()


def test_outputs_follow_inputs_that_are_set_without_a_step(library: Library) -> None:
    """Masters read outputs again after setting inputs: what feeds through must be computed on the way."""
    with Instance(library) as in_run, Instance(library) as new:
        in_run.initialise()
        inputs = signals(library, 9, 1)[0]
        outputs = library.names("output")
        in_run.everything()
        in_run.set(inputs)
        after = in_run.get(*outputs)
        new.initialise(**inputs)
        assert after == new.get(*outputs)


def test_inputs_pass_to_outputs_in_initialization_mode(library: Library) -> None:
    """Masters iterate over connected inputs there: whatever was set before, the last set counts."""
    outputs = library.names("output")
    with Instance(library) as once, Instance(library) as iterated:
        for run in (once, iterated):
            run.setup()
            run.must("EnterInitializationMode")
        for inputs in signals(library, 10, 10):
            iterated.set(inputs)
            iterated.get(*outputs)
        once.set(inputs)
        assert once.get(*outputs) == iterated.get(*outputs)
        for run in (once, iterated):
            run.must("ExitInitializationMode")
        assert once.get(*outputs) == iterated.get(*outputs)
        once.step(0.0, 0.1)
        iterated.step(0.0, 0.1)
        assert once.everything() == iterated.everything()


@pytest.mark.parametrize("when", ["instantiated", "before initialization mode", "initialization mode", "after it"])
def test_inputs_and_parameters_may_be_set_early(library: Library, when: str) -> None:
    values = signals(library, 11, 1)[0]
    draw = random.Random(11)
    for name in library.names("parameter", type="Real"):
        v = library.variables[name]
        if when != "after it" or v.variability == "tunable":
            unset = 2.0 if name.startswith("pair[") else 0.1  # zeros belong outside the unit circle
            value = (library.start(name) or unset) * draw.uniform(0.9, 1.1)
            values[name] = min(max(value, float(v.min or "-inf")), float(v.max or "inf"))
    with Instance(library) as run:
        if when == "instantiated":
            run.set(values)
        run.setup()
        if when == "before initialization mode":
            run.set(values)
        run.must("EnterInitializationMode")
        if when == "initialization mode":
            run.set(values)
        run.must("ExitInitializationMode")
        if when == "after it":
            run.set(values)
        assert run.get(*values) == list(values.values())
        run.step(0.0, 0.01)
        with Instance(library) as other:
            other.initialise(**values)
            other.step(0.0, 0.01)
            assert run.everything() == other.everything()


def test_values_outside_their_limits_are_discarded(library: Library, instance: Instance) -> None:
    before = instance.serialised()
    tried = 0
    for v in library.variables.values():
        if v.causality not in ("parameter", "input") or v.type == "Boolean":
            continue
        for limit, way in ((v.min, -1.0), (v.max, 1.0)):
            if limit is not None:
                outside = (
                    int(limit) + int(way) if v.type == "Integer" else float(limit) + way * max(abs(float(limit)), 1e-3)
                )
                assert instance.try_set({v.name: outside}) == [DISCARD], v.name
                assert instance.messages[-1][1] == DISCARD
                assert instance.try_set({v.name: float(limit)}) == [OK], v.name
                instance.set({v.name: library.start(v.name)})
                tried += 1
    assert instance.serialised() == before
    assert len(instance.messages) == tried
