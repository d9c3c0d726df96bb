"""Probes of steps, instances, saved states and derivatives."""

import math
from collections.abc import Iterator
from ctypes import byref, c_double, c_int, c_size_t, c_void_p
from time import perf_counter
from typing import Any

from .fmi2_library import (
    DISCARD,
    OK,
    WARNING,
    ProbedVariable,
    RawInstance,
    RawLibrary,
    RefusedError,
    last_message,
    references,
    start,
)
from .probe_process import Report, probe

_ODD = (1.0 / 3.0, 1.0 / 0.06, 1.0, 0.1)  # multiples of the preferred step of the XML that are no binary fractions

Trajectory = list[dict[str, Any]]


def _steps(library: RawLibrary, count: int) -> Iterator[tuple[float, float]]:
    """Yield times and lengths of steps that the FMU must accept, on the grid of a master that counts steps."""
    t, h = library.start_time, library.job["step"]
    for k in range(count):
        step = h * _ODD[k % 4] if library.flag("canHandleVariableCommunicationStepSize") else h
        yield t, step
        t += step


def _drive(run: RawInstance, seed: int, count: int, first: int = 0) -> Trajectory:
    """Perform steps with varying inputs and return all variables after each; a rejected step ends the sequence."""
    states = []
    for k, (t, h) in enumerate(_steps(run.library, first + count)):
        if k >= first:
            for v in run.library.variables:
                if v.causality == "input" and v.type == "Real":
                    _move(run, v, math.sin(1.0 + seed + 1.7 * k + v.reference))
            if run.step_status(t, h) not in (OK, WARNING):
                break
            states.append(run.snapshot())
    return states


def _move(run: RawInstance, v: ProbedVariable, direction: float) -> None:
    """Set a Real variable near its start value, within its limits."""
    start = v.start if isinstance(v.start, float) else 0.0
    run.write_status(v, min(max(start + 0.1 * v.nominal * direction, v.low), v.high))


def _difference(a: Trajectory, b: Trajectory) -> tuple[str, Any, Any] | None:
    """Return the first variable in which two trajectories differ, with its values."""
    for left, right in zip(a, b, strict=False):
        for name, value in left.items():
            if name in right and right[name] != value:
                return name, value, right[name]
    return None


@probe(only="co-simulation")
def steps(library: RawLibrary, report: Report) -> None:
    """Check that allowed steps are performed and end at their end time."""
    told: set[str] = set()
    clock = next((v for v in library.variables if v.causality == "independent" and v.type == "Real"), None)
    with start(library) as run:
        run.initialise()
        for t, h in _steps(library, 8):
            if run.step_status(t, h) not in (OK, WARNING):
                where = f"the step from {t!r} s over {h!r} s is rejected{last_message(library)}"
                report("step-refused", f"{where}; accept it, or do not declare variable steps")
                return
            if clock is not None:
                status, time = run.read_status(clock)
                rule = _judge_time(library, time, t + h) if status in (OK, WARNING) else None
                if rule and rule not in told:
                    told.add(rule)
                    where = f"{clock.name} is {time!r} s after a step from {t!r} s over {h!r} s"
                    report(rule, f"{where}; set it to the sum of both", clock.name)
        for v in library.variables:
            if v.causality == "output" and v.type == "Real" and not math.isfinite(run.read_status(v)[1]):
                report("value-not-finite", f"{v.name} is not finite after some steps; correct the start values", v.name)


def _judge_time(library: RawLibrary, time: float, end: float) -> str | None:
    """Return the rule that a time after a step violates, if any."""
    if time == end:
        return None
    preferred = library.job["step"] * (1.0 + 1e-9)
    if abs(time - end) <= 1e-9 * (preferred + abs(end)):
        return "time-rounded"
    variable = library.flag("canHandleVariableCommunicationStepSize")
    return "time-own-grid" if variable and 0.0 < end - time <= preferred else "time-wrong"


@probe(only="co-simulation")
def rounded_steps(library: RawLibrary, report: Report) -> None:
    """Check steps whose times are rounded differently, as from a master that counts steps."""
    h, first = library.job["step"], library.start_time
    with start(library) as run:
        run.initialise()
        for k in range(8):
            t, step = first + k * h, (first + (k + 1) * h) - (first + k * h)
            t = math.nextafter(t, math.inf if k % 2 else -math.inf) if k else t
            if run.step_status(t, step) not in (OK, WARNING):
                if k:
                    where = f"the step from {t!r} s over {step!r} s is rejected{last_message(library)}"
                    report("step-rounding", f"{where}; compare times with a tolerance")
                return


# ---- several instances


@probe(several=True)
def instances(library: RawLibrary, report: Report) -> None:
    """Check that runs are reproducible and that another instance in between has no effect."""
    trajectories = []
    for _ in range(2):
        with start(library) as run:
            trajectories.append(_drive(run.initialise(), 1, 6))
    if found := _difference(*trajectories):
        name, a, b = found
        report("not-reproducible", f"{name} is {a} in one run and {b} in the next; initialise all memory", name)
        return
    with start(library) as run:
        try:
            other = start(library, "other")
        except RefusedError as error:
            message = f"a second instance is rejected{error.message}; allow it, or set canBeInstantiatedOnlyOncePerProcess"  # fmt: skip  # noqa: E501
            report("second-instance", message)
            return
        with other:
            run.initialise()
            other.begin()
            for v in library.variables:
                if v.causality == "parameter" and v.type == "Real":
                    _move(other, v, 1.0)
            if other.status("ExitInitializationMode") not in (OK, WARNING):
                return  # the values came from the check
            together: Trajectory = []
            for k in range(6):
                _drive(other, 2, 1, k)
                together += _drive(run, 1, 1, k)
    if found := _difference(trajectories[0], together):
        name, a, b = found
        message = f"{name} is {a} alone and {b} next to another instance; do not use static variables"
        report("instances-interfere", message, name)


@probe()
def reset(library: RawLibrary, report: Report) -> None:
    """Check that a reset restores the initial state."""
    with start(library) as run:
        run.begin()
        initial = run.snapshot()
        run.must("ExitInitializationMode")
        before = _drive(run, 1, 6)
        run.must("Reset")
        run.begin()
        again = run.snapshot()
        run.must("ExitInitializationMode")
        after = _drive(run, 1, 6)
    if found := _difference([initial, *before], [again, *after]):
        name, a, b = found
        report(
            "reset-incomplete",
            f"{name} is {a} at first and {b} after {library.named('Reset')}; reset the complete state",
            name,
        )


# ---- saved states


@probe()
def state(library: RawLibrary, report: Report) -> None:
    """Check that a saved state restores every variable and all future values."""
    if not library.flag("canGetAndSetFMUstate"):
        return
    with start(library) as run:
        _drive(run.initialise(), 1, 4)
        pointer = c_void_p()
        run.must("GetFMUstate", byref(pointer))
        saved = run.snapshot()
        future = _drive(run, 1, 4, 4)
        run.must("SetFMUstate", pointer)
        if found := _difference([saved, *future], [run.snapshot(), *_drive(run, 1, 4, 4)]):
            name, a, b = found
            message = f"{name} is {a}, but {b} after {library.named('SetFMUstate')}; save the complete state"
            report("state-not-restored", message, name)
        run.must("FreeFMUstate", byref(pointer))
        if pointer.value:
            report("state-pointer", f"{library.named('FreeFMUstate')} does not change its argument; set it to NULL")


@probe(several=True)
def serialization(library: RawLibrary, report: Report) -> None:
    """Check that the bytes of a state restore it in another instance."""
    if not (library.flag("canGetAndSetFMUstate") and library.flag("canSerializeFMUstate")):
        return
    with start(library) as run:
        _drive(run.initialise(), 1, 4)
        with run.saved() as pointer:
            data = run.serialized(pointer)
        here = [run.snapshot(), *_drive(run, 1, 4, 4)]
    with start(library) as other:
        other.initialise().restore(data)
        there = [other.snapshot(), *_drive(other, 1, 4, 4)]
    if found := _difference(here, there):
        name, a, b = found
        report(
            "state-not-serialized",
            f"{name} is {a}, but {b} in an instance with the same state; serialise the complete state",
            name,
        )


# ---- derivatives


@probe(only="co-simulation")
def derivatives(library: RawLibrary, report: Report) -> None:
    """Check the functions of declared capabilities for derivatives."""
    inputs, outputs = library.continuous("input")[:1], library.continuous("output")[:1]
    one, result = (c_double * 1)(1.0), (c_double * 1)()
    order = (c_int * 1)(1)
    calls: dict[str, tuple[bool, str, tuple[object, ...]]] = {
        "SetRealInputDerivatives": (
            library.flag("canInterpolateInputs") and bool(inputs),
            "canInterpolateInputs",
            (references(inputs), c_size_t(1), order, (c_double * 1)(0.0)),
        ),
        "GetRealOutputDerivatives": (
            library.job["output_derivatives"] > 0 and bool(outputs),
            "maxOutputDerivativeOrder",
            (references(outputs), c_size_t(1), order, result),
        ),
        "GetDirectionalDerivative": (
            library.flag("providesDirectionalDerivative") and bool(inputs and outputs),
            "providesDirectionalDerivative",
            (references(outputs), c_size_t(1), references(inputs), c_size_t(1), one, result),
        ),
    }
    with start(library) as run:
        run.initialise().step(library.start_time, library.job["step"])
        for function, (declared, capability, arguments) in calls.items():
            if declared and (status := run.status(function, *arguments)) >= DISCARD:
                refused = f"{library.named(function)} returns status {status}"
                what = f"{refused} although {capability} is declared{last_message(library)}"
                report("capability", f"{what}; implement it or do not declare it")


_MOVES = (1.0, -1.0, 10.0, -10.0)  # changes of an input, as multiples of a tenth of its nominal value
_LONGEST = 3.0  # duration after which no further input is moved [s]


@probe()
def dependencies(library: RawLibrary, report: Report) -> None:
    """Check that no output or derivative follows an input that its dependencies omit: masters miss its loop."""
    stated, told = library.job["dependencies"], set[tuple[str, str]]()
    with start(library) as run:
        run.begin()
        _follow(library, report, run, {"InitialUnknowns": stated["InitialUnknowns"]}, told)
        run.must("ExitInitializationMode")
        if run.step_status(library.start_time, library.job["step"]) in (OK, WARNING):
            _follow(library, report, run, {key: stated[key] for key in ("Outputs", "Derivatives")}, told)


def _follow(
    library: RawLibrary,
    report: Report,
    run: RawInstance,
    stated: dict[str, dict[str, list[str]]],
    told: set[tuple[str, str]],
) -> None:
    """Move each Real input and compare what changes with the dependencies in these sections."""
    before, begun = run.snapshot(), perf_counter()
    for v in library.variables:
        if perf_counter() - begun > _LONGEST:
            return
        if v.type != "Real" or v.causality != "input" or before.get(v.name) in (None, "NaN"):
            continue
        for size in _MOVES:
            _move(run, v, size)
            after = run.snapshot()
            run.write_status(v, before[v.name])
            if run.snapshot() != before:
                return  # not a function of the inputs alone, which other probes report
            for section, unknowns in stated.items():
                for name, known in unknowns.items():
                    if after.get(name) != before.get(name) and v.name not in known and (name, v.name) not in told:
                        told.add((name, v.name))
                        message = f"{name} follows {v.name} at once, which its dependencies in {section} omit; list it"
                        report("dependency-missing", message, name)
