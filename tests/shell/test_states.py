"""Saved states, and instances beside each other: nothing is lost, nothing is shared."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from ctypes import byref, c_size_t, c_void_p, create_string_buffer
from pathlib import Path

import pytest
from shell.instance import ERROR, OK, Instance, Library, drive, load, signals

from friction_fmus import catalogue

H = 1e-3


@pytest.fixture
def running(library: Library, instance: Instance) -> Instance:
    """In the middle of a run, at 30 H."""
    instance.initialise()
    drive(instance, signals(library, 1, 30), 0.0, H)
    return instance


def now(instance: Instance) -> float:
    return instance.get1("time")


def test_a_state_pointer_is_used_again(running: Instance) -> None:
    state = c_void_p()
    running.must("GetFMUstate", byref(state))
    first = state.value
    t = now(running)
    running.step(t, H)
    running.must("GetFMUstate", byref(state))
    assert state.value == first
    running.step(t + H, H)
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


def forged(data: bytes, place: int, value: bytes) -> bytes:
    """Other bytes in the model of a serialised state, with the checksum of them: FNV-1a."""
    header = 64
    model = bytearray(data[header:])
    model[place : place + len(value)] = value
    checksum = 14695981039346656037
    for byte in model:
        checksum = (checksum ^ byte) * 1099511628211 % 2**64
    return data[: header - 8] + checksum.to_bytes(8, sys.byteorder) + bytes(model)


def test_values_that_no_run_can_have_are_refused(library: Library, running: Instance) -> None:
    """Also with the checksum of such bytes; a value reference is the place among the doubles."""
    data = running.serialised()
    assert running.try_restore(forged(data, 0, data[64:72])) == OK
    outputs = library.names("output", type="Real") + library.names("parameter", type="Real")
    for name in ("time", outputs[0], outputs[-1]):
        for bad in (float("nan"), float("inf")):
            assert running.try_restore(forged(data, 8 * running.reference(name), struct.pack("d", bad))) == ERROR
    assert running.serialised() == data


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


def test_the_state_of_another_block_is_refused(running: Instance, build_fmu: Callable[..., Path]) -> None:
    foreign = next(name for name in catalogue() if name != running.library.identifier)
    before = running.serialised()
    with Instance(load(build_fmu(foreign))) as other:
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


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the memory use of Linux")
def test_a_thousand_instances_leave_no_memory_behind(library: Library) -> None:
    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    def live_and_die() -> None:
        with Instance(library) as run:
            run.initialise()
            run.step(0.0, H)
            with run.saved():
                run.step(H, H)
            run.restore(run.serialised())

    for _ in range(300):
        live_and_die()
    before = resident()
    for _ in range(1000):
        live_and_die()
    with Instance(library) as run:
        smallest_leak = 1000 * len(run.serialised())
    assert resident() - before < max(smallest_leak // 2, 256 * 1024)
