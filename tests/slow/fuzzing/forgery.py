"""Serialised states with bytes of any kind in what a block remembers, and the checksum of those bytes."""

from __future__ import annotations

import math
import struct
import sys
import time
from collections.abc import Iterator
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from shell.exchanging import SITUATIONS, begin, go_on, go_to
from shell.instance import CO_SIMULATION, MODEL_EXCHANGE, OK, EventInfo, Instance, Library, load, signals

H = 1e-3
HEADER = 64  # bytes of a serialised state before the model
SECONDS = 10.0  # for the use of one state
NUMBERS = (math.nan, math.inf, 1e300, -1e300, 1e9, 1e3, 65.0, -1.0, 0.5)
WHOLE = (-1, 2**31 - 1, -(2**31), 5000, 65)  # among their bytes are some that are no Boolean


class Forger:
    """Replaces bytes of a serialised state; FNV-1a of the model is the checksum."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self._hashes = [14695981039346656037]
        for byte in data[HEADER:]:
            self._hashes.append((self._hashes[-1] ^ byte) * 1099511628211 % 2**64)

    def forged(self, place: int, value: bytes) -> bytes:
        """The state with this value at a place of the model."""
        model = self.data[HEADER:]
        model = model[:place] + value[: len(model) - place] + model[place + len(value) :]
        checksum = self._hashes[place]
        for byte in model[place:]:
            checksum = (checksum ^ byte) * 1099511628211 % 2**64
        return self.data[: HEADER - 8] + checksum.to_bytes(8, sys.byteorder) + model


def end_of_values(library: Library) -> int:
    """Bytes of the model before the position in the simulation and the memory: values, slopes of the inputs."""
    rows, values, sampled, guid = c_size_t(), c_size_t(), c_int(), create_string_buffer(64)
    function = library.handle.block_rows
    function.argtypes, function.restype = (c_void_p, c_void_p, c_void_p, c_char_p), c_void_p
    function(byref(rows), byref(values), byref(sampled), guid)
    return 8 * (values.value + len(library.names("input")) + 1)


def places(first: int, end: int) -> Iterator[int]:
    """The beginning and the end of what lies behind the values, and some places between."""
    step = max((end - first) // 12 // 8 * 8, 8)
    near, far = range(first, min(first + 160, end), 4), range(max(end - 48, first), end, 4)
    yield from sorted({*near, *far, *range(first, end, step)})


def solve(run: Instance, t: float) -> None:
    """From any mode of model exchange: an event and a step of Euler's method, whatever is refused."""
    n, z = run.library.states, run.library.indicators
    x, rates, left = (c_double * n)(), (c_double * n)(), (c_double * z)()
    run.call("EnterEventMode")
    run.call("NewDiscreteStates", EventInfo())
    run.call("EnterContinuousTimeMode")
    if run.call("GetContinuousStates", x, n) == OK and run.call("GetDerivatives", rates, n) == OK:
        assert all(map(math.isfinite, (*x, *rates))), f"{[*x]}, {[*rates]} with fmi2OK"
        run.call("SetContinuousStates", (c_double * n)(*(a + H * b for a, b in zip(x, rates, strict=True))), n)
    run.call("SetTime", t + H)
    if run.call("GetEventIndicators", left, z) == OK:
        assert all(map(math.isfinite, left)), f"{[*left]} with fmi2OK"


def use(library: Library, data: bytes, t: float, kind: int) -> None:
    """Restore and run on; what is handed out is finite."""
    outputs = library.names("output", type="Real")
    n = len(outputs)
    values, references = (c_double * n)(), (c_uint * n)(*[library.variables[name].valueReference for name in outputs])
    with Instance(library, kind=kind) as run:
        if run.try_restore(data) != OK:
            return
        for inputs in signals(library, 3, 3):
            run.try_set(inputs)
            if kind == MODEL_EXCHANGE:
                solve(run, t)
            else:
                run.call("DoStep", t, H, 1)
            t += H
            if run.call("GetReal", references, n, values) == OK:
                assert all(map(math.isfinite, values)), f"{[*values]} with fmi2OK"


def forge(fmu: Path, trace: Path, situation: str) -> None:
    """Forge a state of an FMU in many ways, and use each.

    Parameters
    ----------
    fmu : Path
        The FMU.
    trace : Path
        Gets the place and the value of each forgery before it is used.
    situation : str
        Where the run is, one of `shell.exchanging.SITUATIONS`.

    Raises
    ------
    AssertionError
        If the use of one takes too long, or gives a value that is not finite.
    """
    library, kind = load(fmu), SITUATIONS[situation]
    with Instance(library, kind=kind) as run:
        begin(run, kind)
        between = "co-simulation" if kind == CO_SIMULATION else "continuous-time mode"
        go_on(run, between, signals(library, 1, 30), 0.0, H)
        go_to(run, situation)
        data, t = run.serialised(), run.get1("time")
    forger, first = Forger(data), end_of_values(library)
    for place in places(first, len(data) - HEADER):
        numbers = [struct.pack("d", x) for x in NUMBERS] if place % 8 == 0 else []
        for value in (*numbers, *(struct.pack("i", k) for k in WHOLE)):
            what = f"{value.hex()}, {place - first} bytes behind the values"
            trace.write_text(what, encoding="utf-8")
            since = time.monotonic()
            use(library, forger.forged(place, value), t, kind)
            assert time.monotonic() - since < SECONDS, f"the use takes too long of a state with {what}"
