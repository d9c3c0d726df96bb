"""Probes of model exchange: events, states, derivatives, event indicators, and the order of calls."""

import math
from collections.abc import Callable
from ctypes import byref, c_double, c_int, c_size_t, c_uint
from functools import partial
from operator import methodcaller
from typing import Any, Final

from .fmi2_library import (
    MOST_ITERATIONS,
    OK,
    WARNING,
    EventInfo,
    RawExchange,
    RawLibrary,
    RefusedError,
    last_message,
)
from .lifecycle import brought, report_accepted, report_refused
from .probe_process import Report, probe

_ONLY: Final = "model exchange"
_GUARD: Final = 4
_PATTERN: Final = -6.02214076e23  # what the results of a call hold before it, with further values behind them

_SAME: Final = 1e-14
_DIFFERENCE: Final = 1e-6
_AGREES: Final = 1e-3


def _moved(library: RawLibrary, run: RawExchange, x: list[float], share: float) -> list[float]:
    return [value + share * nominal for value, nominal in zip(x, run.nominals(), strict=True)]


@probe(only=_ONLY)
def events(library: RawLibrary, report: Report) -> None:
    """Check that event iterations end, that time events lie ahead, and that all flags are set."""
    h = library.job["step"]
    with RawExchange(library) as run:
        run.initialise().settle()
        for k in range(9):
            now = library.start_time + k * h
            if not run.settled:
                name = library.named("NewDiscreteStates")
                what = f"{name} still asks for another iteration after {MOST_ITERATIONS} at {now!r} s"
                report("event-iteration", f"{what}; clear newDiscreteStatesNeeded when nothing changes")
                break
            if run.info.scheduled == 1 and not run.info.next > now:
                what = f"the next time event is at {run.info.next!r} s, but the event iteration at {now!r} s is over"
                report("event-time", f"{what}; schedule it later, or clear nextEventTimeDefined")
                break
            run.step(now, h)
        for function in sorted(run.unset):
            report("counts", f"{library.named(function)} does not set all of its results; set every one in every call")


@probe(only=_ONLY)
def counts(library: RawLibrary, report: Report) -> None:
    """Check that functions set as many values as the XML declares, which are finite, and positive if nominal."""
    states = [row["state"] or row["derivative"] for row in library.job["states"]]
    sizes = dict.fromkeys(("GetContinuousStates", "GetDerivatives", "GetNominalsOfContinuousStates"), len(states))
    with RawExchange(library) as run:
        run.initialise().settle()
        run.must("EnterContinuousTimeMode")
        for function, n in {**sizes, "GetEventIndicators": library.job["indicators"]}.items():
            if n == 0:
                continue
            buffer = (c_double * (n + _GUARD))(*[_PATTERN] * (n + _GUARD))
            run.library.messages.clear()
            if run.status(function, buffer, n) not in (OK, WARNING):
                what = f"{library.named(function)} rejects {n} values, as in the XML{last_message(library)}"
                report("counts", f"{what}; declare the number that the binary has")
                continue
            written = sum(value != _PATTERN for value in buffer)
            if written != n or _PATTERN in buffer[:n]:
                report(
                    "counts", f"{library.named(function)} sets {written} values, but {n} are declared; make them agree"
                )
                continue
            _judge(report, library.named, function, states, buffer[:n])


def _judge(report: Report, named: Callable[[str], str], function: str, states: list[str], values: list[float]) -> None:
    for k, value in enumerate(values):
        name = f"event indicator {k + 1}" if function == "GetEventIndicators" else states[k]
        if function == "GetNominalsOfContinuousStates" and not 0.0 < value < math.inf:
            report("nominal-states", f"the nominal value of {name} is {value}; give its magnitude", name)
        elif not math.isfinite(value):
            report("value-not-finite", f"{named(function)} returns {value} for {name}; choose valid start values")


@probe(only=_ONLY)
def states(library: RawLibrary, report: Report) -> None:
    """Check that states keep the values set, and that states and derivatives are the variables of the XML."""
    with RawExchange(library) as run:
        x = _moved(library, run.continuous(), run.states(), 1e-3)
        run.go_to(library.start_time, x)
        for row, value, kept in zip(library.job["states"], x, run.states(), strict=True):
            if value != kept:
                report("states", f"{row['state']} is {kept!r} after it was set to {value!r}; keep it", row["state"])
        for key, values in (("state", run.states()), ("derivative", run.derivatives())):
            for row, value in zip(library.job["states"], values, strict=True):
                if row[key] is None:
                    continue
                buffer = (c_double * 1)()
                run.must("GetReal", (c_uint * 1)(row[f"{key}_reference"]), 1, buffer)
                if abs(buffer[0] - value) > _SAME * abs(value):
                    function = "GetContinuousStates" if key == "state" else "GetDerivatives"
                    names = library.named(function), library.named("GetReal")
                    what = f"{names[0]} gives {value!r} for {row[key]}, but {names[1]} {buffer[0]!r}"
                    report("states", f"{what}; use the order of Derivatives in the XML", row[key])


@probe(only=_ONLY)
def history(library: RawLibrary, report: Report) -> None:
    """Check that values depend on time, states and inputs alone, as a solver tries points that it rejects."""
    with RawExchange(library) as run:
        run.continuous()
        t, x = library.start_time, run.states()

        def values(at: float, point: list[float]) -> dict[str, Any]:
            run.go_to(at, point)
            named = {f"derivative {k + 1}": value for k, value in enumerate(run.derivatives())}
            named |= {f"event indicator {k + 1}": value for k, value in enumerate(run.indicators())}
            return named | run.snapshot()

        before = values(t, x)
        values(t + library.job["step"], _moved(library, run, x, 0.1))
        after = values(t, x)
        for name, value in before.items():
            if str(after.get(name)) != str(value):
                what = f"{name} is {value!r}, but {after.get(name)!r} after another point was tried"
                report("history", f"{what}; change memory in events and completed steps only")
                return


# ---- derivatives


@probe(only=_ONLY)
def directional(library: RawLibrary, report: Report) -> None:
    """Check directional derivatives of the state derivatives against differences, where these are smooth."""
    rows = [row for row in library.job["states"] if row["state"] and row["derivative"]]
    if not library.flag("providesDirectionalDerivative") or not rows or len(rows) < len(library.job["states"]):
        return
    unknowns = (c_uint * len(rows))(*(row["derivative_reference"] for row in rows))
    with RawExchange(library) as run:
        run.initialise()
        for k in range(3):
            run.step(library.start_time + k * library.job["step"], library.job["step"])
        run.must("EnterContinuousTimeMode")
        t, x, scale = library.start_time + 3 * library.job["step"], run.states(), run.nominals()
        x = [value + 0.01 * size for value, size in zip(x, scale, strict=True)]
        run.go_to(t, x)
        settings: list[tuple[str, int, float, float, Callable[[float], object]]] = []
        for k, row in enumerate(rows):
            set_state = partial(lambda k, value: run.go_to(t, [*x[:k], value, *x[k + 1 :]]), k)
            settings.append((row["state"], row["state_reference"], x[k], scale[k], set_state))
        for v in library.continuous("input"):
            _, value = run.read_status(v)
            settings.append((v.name, v.reference, value, v.nominal, partial(run.write_status, v)))
        for name, reference, value, size, set_to in settings:
            column = (c_double * len(rows))()
            arguments = (unknowns, c_size_t(len(rows)), (c_uint * 1)(reference), c_size_t(1), (c_double * 1)(1.0))
            if run.status("GetDirectionalDerivative", *arguments, column) not in (OK, WARNING):
                what = f"{library.named('GetDirectionalDerivative')} rejects {name}{last_message(library)}"
                report("capability", f"{what}; implement it or do not declare providesDirectionalDerivative")
                return
            found = _differences(run, set_to, value, _DIFFERENCE * max(abs(value), size))
            for row, difference, stated in zip(rows, found, column, strict=True):
                if difference is not None and abs(stated - difference[0]) > difference[1] + _AGREES * abs(stated):
                    what = f"the derivative of {row['derivative']} with respect to {name} is {stated!r}"
                    report("directional", f"{what}, but differences give {difference[0]:.6g}; correct it", name)


def _differences(
    run: RawExchange, set_to: Callable[[float], object], value: float, step: float
) -> list[tuple[float, float] | None]:
    """Return difference quotients with their error from rounding; None beside a kink."""
    rates = []
    for at in (value - step, value, value + step):
        set_to(at)
        rates.append(run.derivatives())
    set_to(value)
    found: list[tuple[float, float] | None] = []
    for low, middle, high in zip(*rates, strict=True):
        before, after, quotient = (middle - low) / step, (high - middle) / step, (high - low) / (2.0 * step)
        rounding = 1e-13 * max(abs(low), abs(middle), abs(high)) / step
        smooth = abs(after - before) <= 0.1 * _AGREES * (abs(after) + abs(before)) + rounding
        found.append((quotient, rounding) if smooth and math.isfinite(quotient) else None)
    return found


# ---- the order of calls (section 3.2.3)

_MODES = {
    "I": "instantiated",
    "N": "initialization mode",
    "E": "event mode",
    "M": "continuous-time mode",
    "T": "terminated",
}


def _in_mode(library: RawLibrary, mode: str) -> RawExchange:
    def initialised(run: RawExchange) -> None:
        run.settle()
        if mode in "MT":
            run.must("EnterContinuousTimeMode")

    return brought(RawExchange(library), mode, initialised)


def _calls(library: RawLibrary) -> dict[str, tuple[object, ...]]:
    """Return the functions for model exchange with arguments."""
    n, m = len(library.job["states"]), library.job["indicators"]
    x, z = (c_double * max(n, 1))(), (c_double * max(m, 1))()
    return {
        "EnterEventMode": (),
        "NewDiscreteStates": (byref(EventInfo()),),
        "EnterContinuousTimeMode": (),
        "CompletedIntegratorStep": (1, byref(c_int()), byref(c_int())),
        "SetTime": (library.start_time,),
        "SetContinuousStates": (x, n),
        **dict.fromkeys(("GetContinuousStates", "GetDerivatives", "GetNominalsOfContinuousStates"), (x, n)),
        "GetEventIndicators": (z, m),
        "SetupExperiment": (0, 0.0, library.start_time, 0, 0.0),
        **dict.fromkeys(("EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"), ()),
    }


_ALLOWED: Final = {
    "EnterEventMode": "M",
    "NewDiscreteStates": "E",
    "EnterContinuousTimeMode": "E",
    "CompletedIntegratorStep": "M",
    "SetTime": "M",
    **dict.fromkeys(("GetContinuousStates", "GetDerivatives", "GetNominalsOfContinuousStates"), "EM"),
    "GetEventIndicators": "EM",
    "Terminate": "EM",
    "Reset": "INEMT",
}
_FORBIDDEN: Final = {
    "EnterEventMode": "INT",
    "NewDiscreteStates": "INMT",
    "EnterContinuousTimeMode": "INMT",
    "CompletedIntegratorStep": "INET",
    "SetTime": "INT",
    "SetContinuousStates": "INT",
    "SetupExperiment": "NEMT",
    "EnterInitializationMode": "NEMT",
    "ExitInitializationMode": "IEMT",
    "Terminate": "INT",
}


@probe(several=True, only=_ONLY)
def allowed_in_exchange(library: RawLibrary, report: Report) -> None:
    """Check that calls are accepted in each mode in which the standard allows them."""
    calls = _calls(library)
    given = {name: (modes, methodcaller("status", name, *calls[name])) for name, modes in _ALLOWED.items()}
    report_refused(library, report, _in_mode, _MODES, given)


@probe(several=True, crash="misuse-crashes", only=_ONLY)
def forbidden_in_exchange(library: RawLibrary, report: Report) -> None:
    """Check that calls are rejected in each mode in which the standard forbids them."""
    calls = _calls(library)
    given = {name: (modes, calls[name]) for name, modes in _FORBIDDEN.items()}
    report_accepted(library, report, _in_mode, _MODES, given, RefusedError)  # which other probes report
