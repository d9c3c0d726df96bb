"""Probes of what FMI 3.0 adds: all types and arrays, configuration mode, clocks, adjoints, intermediate update."""

import math
from collections.abc import Sequence
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_uint, c_void_p
from typing import Any

from .fmi2_library import OK, WARNING, RawInstance, RawLibrary, last_message
from .fmi3_library import BUFFERS, UPDATE, RawLibrary3
from .probe_process import Report, probe

_MOST_UPDATES = 100
_GOOD = (OK, WARNING)


def _access(
    verb: str, library: RawLibrary3, pointer: int | None, row: dict[str, Any], values: Sequence[Any] = ()
) -> tuple[int, list[Any]]:
    """Get or set a variable; return the status and its elements."""
    buffer = (BUFFERS[row["type"]] * row["count"])(*values)
    kind = "Int64" if row["type"] == "Enumeration" else row["type"]
    reference, n = (c_uint * 1)(row["reference"]), c_size_t(row["count"])
    status = library.raw(f"{verb}{kind}", c_void_p(pointer), reference, c_size_t(1), buffer, n)
    return int(status), list(buffer)


@probe(only="FMI 3.0")
def arrays(library: RawLibrary, report: Report) -> None:
    """Check that variables of all types and arrays are readable, start as stated, and accept their start values."""
    assert isinstance(library, RawLibrary3)
    with RawInstance(library) as run:
        run.begin()
        for row in library.job["arrays"]:
            name, kind = row["name"], row["type"]
            status, found = _access("Get", library, run.pointer, row)
            if status not in _GOOD:
                message = f"fmi3Get{kind} of {name} fails{last_message(library)}; make every declared variable readable"
                report("variable-not-readable", message, name)
                continue
            stated = row["starts"]
            if stated and any(abs(a - b) > 1e-6 * abs(b) for a, b in zip(found, stated, strict=True)):
                report("start-differs", f"{name} starts at {found}, but at {stated} in the XML; make them agree", name)
            if stated and row["settable"] and _access("Set", library, run.pointer, row, found)[0] not in _GOOD:
                report(
                    "variable-not-settable", f"{name} rejects its start value{last_message(library)}; accept it", name
                )


@probe(only="FMI 3.0")
def configuration(library: RawLibrary, report: Report) -> None:
    """Check that structural parameters are set in configuration mode, and only there."""
    assert isinstance(library, RawLibrary3)
    rows = library.job["structural"]
    if not rows:
        return
    with RawInstance(library) as run:
        run.must("EnterConfigurationMode")
        for row in rows:
            if _access("Set", library, run.pointer, row, row["starts"])[0] not in _GOOD:
                message = (
                    f"{row['name']} rejects its start value in configuration mode{last_message(library)}; accept it"
                )
                report("fmi3-configuration", message, row["name"])
        run.must("ExitConfigurationMode")
        run.begin()
        for row in rows:
            fixed = row["variability"] == "fixed"
            if fixed and _access("Set", library, run.pointer, row, row["starts"])[0] in _GOOD:
                message = f"{row['name']} is set in initialization mode; allow that in configuration mode only"
                report("fmi3-configuration", message, row["name"])
        run.must("ExitInitializationMode")


@probe(only="FMI 3.0")
def adjoint(library: RawLibrary, report: Report) -> None:
    """Check adjoint derivatives against directional ones."""
    assert isinstance(library, RawLibrary3)
    if not library.job["adjoint"]:
        return
    rows = [v for v in library.variables if v.type == "Real" and v.variability == "continuous"]
    inputs = [v for v in rows if v.causality == "input"][:8]
    with RawInstance(library) as run:
        run.initialise()
        for output in [v for v in rows if v.causality == "output"][:8]:
            n, one, found = len(inputs), (c_double * 1)(1.0), (c_double * len(inputs))()
            a, b = (c_uint * 1)(output.reference), (c_uint * n)(*(v.reference for v in inputs))
            given = (a, c_size_t(1), b, c_size_t(n), one, c_size_t(1), found, c_size_t(n))
            if library.raw("GetAdjointDerivative", c_void_p(run.pointer), *given) not in _GOOD:
                what = f"fmi3GetAdjointDerivative of {output.name} fails{last_message(library)}"
                report("capability", f"{what}; implement it or do not declare it", output.name)
                continue
            for v, value in zip(inputs, found, strict=True):
                column = (c_double * 1)()
                known = (c_uint * 1)(v.reference)
                if run.status("GetDirectionalDerivative", a, 1, known, 1, one, column) not in _GOOD:
                    continue
                if not abs(column[0] - value) <= 1e-9 * max(abs(value), abs(column[0])):
                    both = f"{value} as adjoint and {column[0]} as directional derivative"
                    message = f"the derivative of {output.name} by {v.name} is {both}; make them agree"
                    report("fmi3-adjoint", message, output.name)


@probe(several=True, only="FMI 3.0 co-simulation")
def event_mode(library: RawLibrary, report: Report) -> None:
    """Check event mode: clocks tick at their intervals, discrete states settle, steps go on."""
    assert isinstance(library, RawLibrary3)
    if not library.job["event_mode"]:
        return
    pointer = library.new(b"checked", library.guid.encode(), events=True, returns=bool(library.job["returns"]))
    if not pointer:
        report(
            "fmi3-event-mode",
            f"there is no instance with eventModeUsed = true{last_message(library)}; hasEventMode is declared",
        )
        return
    try:
        _events(library, report, pointer)
    finally:
        library.call("FreeInstance", pointer)


def _events(library: RawLibrary3, report: Report, pointer: int) -> None:
    def tried(function: str, *arguments: object) -> bool:
        library.messages.clear()
        if library.raw(function, c_void_p(pointer), *arguments) in _GOOD:
            return True
        report("fmi3-event-mode", f"fmi3{function} fails in a run with events{last_message(library)}; allow it")
        return False

    library.call("SetupExperiment", pointer, 0, 0.0, library.start_time, 0, 0.0)
    if library.call("EnterInitializationMode", pointer) not in _GOOD or not tried("ExitInitializationMode"):
        return
    for clock in library.job["clocks"]:
        if clock["stated"]:
            continue  # importers need not ask then, and some FMUs refuse
        interval, qualifier, reference = c_double(), c_int(), (c_uint * 1)(clock["reference"])
        if not tried("GetIntervalDecimal", reference, c_size_t(1), byref(interval), byref(qualifier)):
            return
        if not (interval.value > 0.0 and math.isfinite(interval.value)):
            report(
                "fmi3-event-mode",
                f"the clock {clock['name']} has the interval {interval.value}; return a positive one",
                clock["name"],
            )
            return
    t, due = library.start_time, True
    for k in range(20):
        if due and not (_ticked(library, pointer, k, tried, report) and tried("EnterStepMode")):
            return
        flags, last, h = [c_bool() for _ in range(3)], c_double(t), c_double(library.job["step"])
        if not tried("DoStep", c_double(t), h, c_bool(True), *map(byref, flags), byref(last)):
            return
        if not t < last.value <= t + h.value * (1.0 + 1e-9) and not flags[0].value:
            report("fmi3-event-mode", f"a step from {t} ends at {last.value} without an event; go on")
            return
        t, due = last.value, bool(flags[0].value)
        if due and not tried("EnterEventMode"):
            return


def _ticked(library: RawLibrary3, pointer: int, k: int, tried: Any, report: Report) -> bool:
    """Tick the periodic clocks at the start, and iterate until the discrete states settle."""
    if k == 0:
        for clock in library.job["clocks"]:
            if not tried("SetClock", (c_uint * 1)(clock["reference"]), c_size_t(1), byref(c_bool(True))):
                return False
    for _ in range(_MOST_UPDATES):
        flags, following = [c_bool() for _ in range(5)], c_double()
        if not tried("UpdateDiscreteStates", *map(byref, flags), byref(following)):
            return False
        if not flags[0].value:
            return True
    report("event-iteration", f"fmi3UpdateDiscreteStates asks for more than {_MOST_UPDATES} iterations; let it settle")
    return False


@probe(several=True, only="FMI 3.0 co-simulation")
def intermediate_update(library: RawLibrary, report: Report) -> None:
    """Check that updates come in order, within their step, and do not end it without permission."""
    assert isinstance(library, RawLibrary3)
    if not library.job["intermediate"]:
        return
    times: list[float] = []

    def update(_env: Any, t: float, _set: bool, _get: bool, _done: bool, can: bool, early: Any, at: Any) -> None:
        times.append(t)
        early[0], at[0] = False, t
        if can:
            report("fmi3-intermediate-update", "an update allows early return, which the importer has not; pass false")

    callback = UPDATE(update)
    pointer = library.new(b"checked", library.guid.encode(), update=callback)
    if not pointer:
        report("fmi3-intermediate-update", f"intermediateUpdate is rejected{last_message(library)}; accept it")
        return
    h, start = library.job["step"], library.start_time
    try:
        for function in ("EnterInitializationMode", "ExitInitializationMode"):
            if library.call(function, pointer) not in _GOOD:
                return
        for k in range(5):
            times.clear()
            if library.call("DoStep", pointer, start + k * h, h, 1) not in _GOOD:
                return
            low, high = start + k * h - 1e-9 * h, start + (k + 1) * h + 1e-9 * h
            if times != sorted(times) or not all(low <= t <= high for t in times):
                report(
                    "fmi3-intermediate-update",
                    f"the updates of a step from {low} to {high} are at {times[:5]}; call them in order and within it",
                )
                return
    finally:
        library.call("FreeInstance", pointer)
