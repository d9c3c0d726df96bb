"""What tests do in another process, see `shell.elsewhere`."""

from __future__ import annotations

from ctypes import c_double, c_int, c_uint
from pathlib import Path

from shell.exchanging import SITUATIONS, begin, go_on, go_to
from shell.instance import Instance, load, signals

POINTERS = {
    **{"none": None, "one": (c_uint * 1)(1), "input": (c_uint * 1)(5), "output": (c_uint * 1)(7)},
    **{"flag": (c_int * 1)(0), "order": (c_int * 1)(1), "number": (c_double * 1)(1.0)},
}
"""Arguments by name, references of Dahl among them, as pointers cannot be sent to a process."""


def continued(fmu: Path, trace: Path, data: bytes, t: float, h: float, situation: str) -> bytes:
    """Restore a state straight after fmi2Instantiate and make 30 steps: the bits of all variables after each."""
    library = load(fmu)
    trace.write_text(f"a state of {library} at t = {t}", encoding="utf-8")
    with Instance(library, kind=SITUATIONS[situation]) as run:
        run.restore(data)
        return b"".join(go_on(run, situation, signals(library, 2, 30), t, h))


def called(fmu: Path, trace: Path, function: str, arguments: tuple[str | int, ...], situation: str) -> tuple[int, int]:
    """Call a function of an initialised instance: its status and the number of messages."""
    trace.write_text(f"{function}{arguments}", encoding="utf-8")
    with Instance(load(fmu), kind=SITUATIONS[situation]) as run:
        begin(run, SITUATIONS[situation])
        go_to(run, situation)
        status = run.call(function, *(POINTERS[each] if isinstance(each, str) else each for each in arguments))
        return status, len(run.messages)
