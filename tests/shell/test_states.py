"""Saved states, and instances beside each other: nothing is lost, nothing is shared."""

from __future__ import annotations

import ctypes
import gc
import struct
from collections.abc import Callable, Iterator
from ctypes import byref, c_size_t, c_void_p, create_string_buffer
from pathlib import Path

import pytest
from shell.exchanging import SITUATIONS, begin, go_on, go_to
from shell.instance import ERROR, MODEL_EXCHANGE, OK, Instance, Library, forged, load, signals
from thorough import some

from friction_fmus import catalogue

H = 1e-3


@pytest.fixture
def running(library: Library, situation: str) -> Iterator[Instance]:
    """In the middle of a run, at 30 H."""
    with Instance(library, kind=SITUATIONS[situation]) as made:
        begin(made, SITUATIONS[situation])
        between = "co-simulation" if situation == "co-simulation" else "continuous-time mode"
        go_on(made, between, signals(library, 1, 30), 0.0, H)
        go_to(made, situation)
        yield made


def now(instance: Instance) -> float:
    return instance.get1("time")


def test_a_state_pointer_is_used_again(library: Library, situation: str, running: Instance) -> None:
    state = c_void_p()
    running.must("GetFMUstate", byref(state))
    first = state.value
    t = now(running)
    go_on(running, situation, signals(library, 2, 1), t, H)
    go_to(running, situation)
    running.must("GetFMUstate", byref(state))
    assert state.value == first
    go_on(running, situation, signals(library, 2, 1), t + H, H)
    running.must("SetFMUstate", state)
    assert now(running) == t + H
    running.must("FreeFMUstate", byref(state))
    running.must("FreeFMUstate", byref(state))  # null by now


def test_damaged_bytes_are_refused(running: Instance) -> None:
    data, before = running.serialised(), running.everything()
    for place in {*range(0, len(data), max(len(data) // 60, 1)), len(data) - 1}:
        damaged = bytearray(data)
        damaged[place] ^= 0x10
        running.messages.clear()
        assert running.try_restore(bytes(damaged)) == ERROR, place
        assert running.messages[-1][1:3] == (ERROR, "logStatusError")
    assert running.everything() == before and running.serialised() == data


@pytest.mark.parametrize(("name", "start"), [("PrandtlTomlinson", {}), ("SwitchMass", {"v_belt": 0.0, "v0": 0.0})])
def test_a_state_after_an_endless_rest_can_be_read(
    build_fmu: Callable[..., Path], name: str, start: dict[str, float]
) -> None:
    """The next inner step would be six times as long, which is infinite."""
    with Instance(Library(build_fmu(name))) as run:
        run.initialise(**start)
        run.step(0.0, 1e308)
        assert run.try_restore(run.serialised()) == OK


def test_a_state_before_the_run_can_be_read_back(library: Library) -> None:
    """As instantiated, and in initialization mode with values that were set."""
    row = signals(library, 1, 1)[0]
    with Instance(library) as run, Instance(library) as other:
        fresh = run.serialised()
        run.setup()
        run.must("EnterInitializationMode")
        run.set(row)
        data, shown = run.serialised(), run.everything()
        for saved in (fresh, data):
            other.restore(saved)
            assert other.serialised() == saved
        assert other.everything() == shown


def test_values_that_no_run_can_have_are_refused(library: Library, running: Instance) -> None:
    """Also with the checksum of such bytes; a value reference is the place among the doubles."""
    data = running.serialised()
    assert running.try_restore(forged(data, 0, data[64:72])) == OK
    outputs = library.names("output", type="Real") + library.names("parameter", type="Real")
    for name in ("time", outputs[0], outputs[-1]):
        for bad in (float("nan"), float("inf")):
            assert running.try_restore(forged(data, 8 * running.reference(name), struct.pack("d", bad))) == ERROR
    assert running.serialised() == data


# blocks that remember what was decided at an event: numbers at the end of their memory, and what these may not be
REMEMBERED = {
    **dict.fromkeys(("Coulomb", "Stiction", "Tustin", "Stribeck"), (3, (0.5, 2.0))),
    **dict.fromkeys(("Karnopp", "KarnoppMass", "ResetIntegrator", "Dahl"), (2, (0.5, 2.0))),
    **dict.fromkeys(("MaxwellSlip", "GMS", "ModifiedLeuven"), (10, (0.5, -2.0))),
    "ElastoPlastic": (1, (-1.0, 0.5)),
    "Leuven": (4, (-2.0, 0.5)),
    "Quantiser": (1, (0.5,)),
    "Circle": (1, (-1.0, 0.5)),
}


@pytest.mark.parametrize("name", some([*REMEMBERED], ["GMS"]))
def test_decisions_that_no_run_can_make_are_refused(name: str, build_fmu: Callable[..., Path]) -> None:
    """Directions, flags and counts, with the checksum of such bytes."""
    library = load(build_fmu(name))
    count, wrong = REMEMBERED[name]
    with Instance(library, kind=MODEL_EXCHANGE) as run:
        run.exchange(**signals(library, 1, 1)[0])
        data = run.serialised()
        for place in range(len(data) - 64 - 8 * count, len(data) - 64, 8):
            assert run.try_restore(forged(data, place, data[64 + place : 72 + place])) == OK
            for value in (*wrong, float("nan"), float("inf")):
                assert run.try_restore(forged(data, place, struct.pack("d", value))) == ERROR, (place, value)
        assert run.serialised() == data


@pytest.mark.parametrize("change", [lambda b: b[:-1], lambda b: b[: len(b) // 2], lambda b: b[:1], lambda b: b + b"\0"])
def test_bytes_of_another_length_are_refused(running: Instance, change: Callable[[bytes], bytes]) -> None:
    data = running.serialised()
    assert running.try_restore(change(data)) == ERROR
    assert running.serialised() == data


def test_no_bytes_at_all_are_refused(running: Instance) -> None:
    state = c_void_p()
    assert running.call("DeSerializeFMUstate", b"", 0, byref(state)) == ERROR
    assert running.call("DeSerializeFMUstate", None, 0, byref(state)) == ERROR
    assert not state.value


def test_the_state_of_another_block_is_refused(
    situation: str, running: Instance, build_fmu: Callable[..., Path]
) -> None:
    others = (load(build_fmu(name)) for name in catalogue() if name != running.library.identifier)
    foreign = next(other for other in others if other.exchanges)
    before = running.serialised()
    with Instance(foreign, kind=SITUATIONS[situation]) as other:
        other.initialise()
        assert running.try_restore(other.serialised()) == ERROR
        with other.saved() as state:
            assert running.call("SetFMUstate", state) == ERROR
    assert running.serialised() == before


def test_the_state_of_a_block_with_other_start_values_is_refused(build_fmu: Callable[..., Path]) -> None:
    """Start values are part of what the GUID stands for."""
    with Instance(load(build_fmu("LuGre"))) as one, Instance(load(build_fmu("LuGre", Fc=1.25))) as other:
        assert one.try_restore(other.serialised()) == ERROR


def test_too_small_a_buffer_is_refused(running: Instance) -> None:
    with running.saved() as state:
        size = c_size_t()
        running.must("SerializedFMUstateSize", state, byref(size))
        buffer = create_string_buffer(b"\xaa" * size.value, size.value)
        assert running.call("SerializeFMUstate", state, buffer, size.value - 1) == ERROR
        assert buffer.raw == b"\xaa" * size.value


def test_a_state_carries_parameters_and_slopes(lugre: Library) -> None:
    with Instance(lugre) as run:
        run.initialise(v=1e-3, Fc=1.25)
        assert run.input_derivatives({"v": 0.5}) == OK
        data = run.serialised()
        run.step(0.0, H)
        expected = run.everything()
        run.must("Reset")
        run.restore(data)
        run.step(0.0, H)
        assert run.everything() == expected


class Allocated(ctypes.Structure):
    """struct mallinfo2 of glibc."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "a", "b")
    ]


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="asks the C library of Linux")
def test_instances_leave_no_memory_behind(library: Library) -> None:
    """A leak grows in every round; what Python keeps does not."""
    ask = ctypes.CDLL(None).mallinfo2
    ask.restype = Allocated
    inputs, outputs = library.names("input", type="Real")[:1], library.names("output", type="Real")[:1]

    def live_and_die() -> None:
        with Instance(library) as run:
            run.initialise()
            run.step(0.0, H)
            run.directional(outputs, dict.fromkeys(inputs, 1.0))
            with run.saved():
                run.step(H, H)
            run.restore(run.serialised())
        assert Instance(library, guid=b"").pointer is None

    def growth() -> int:
        gc.collect()
        before = ask()
        for _ in range(20):
            live_and_die()
        gc.collect()
        after = ask()
        return int(after.uordblks + after.hblkhd) - int(before.uordblks + before.hblkhd)

    gc.collect()
    gc.freeze()  # each collection would search through what all earlier tests have left, which takes a second
    assert min(growth() for _ in range(5)) < 20 * 8
