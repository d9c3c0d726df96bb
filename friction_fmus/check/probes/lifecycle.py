"""Probes of functions, identity, values and the order of calls."""

import ctypes
import math
from collections.abc import Callable, Mapping
from ctypes import byref, c_void_p
from typing import TypeVar

from .fmi2_library import OK, WARNING, MissingError, ProbedVariable, RawInstance, RawLibrary, last_message
from .probe_process import Report, probe

_TOLERANCE = 1e-14  # relative tolerance: a few units in the last place, as caused by XML numbers with 15 to 17 digits


@probe()
def functions(library: RawLibrary, report: Report) -> None:
    """Check that all functions exist and that the library states its version and platform."""
    if library.missing:
        names = ", ".join(map(library.named, library.missing))
        report(
            "function-missing", f"the library does not export {names}; export all functions, including unsupported ones"
        )
    answers = {"GetVersion": library.version, **({"GetTypesPlatform": b"default"} if library.version == b"2.0" else {})}
    for function, expected in answers.items():
        if function not in library.missing:
            answer = library.call(function)
            if answer != expected:
                report("version-answer", f"{library.named(function)} returns {answer!r}; return {expected.decode()!r}")


@probe(crash="free-null")
def free_nothing(library: RawLibrary, report: Report) -> None:
    """Check that fmi2FreeInstance(NULL) does nothing."""
    library.call("FreeInstance", None)


@probe(several=True, crash="guid-not-checked")
def wrong_guid(library: RawLibrary, report: Report) -> None:
    """Check that another guid gives no instance."""
    other = "{00000000-1111-2222-3333-444444444444}"
    pointer = library.instantiate(guid=other)
    if pointer:
        library.call("FreeInstance", pointer)
        name, token = library.named("Instantiate"), library.token
        report("guid-not-checked", f"{name} accepts the {token} {other}; compare it with the {token} of the XML")


def _same(v: ProbedVariable, stated: object, read: object) -> bool:
    if v.type == "Real" and isinstance(stated, float) and isinstance(read, float):
        return abs(stated - read) <= _TOLERANCE * abs(stated)
    return stated == (bool(read) if v.type == "Boolean" else read)


@probe()
def start_values(library: RawLibrary, report: Report) -> None:
    """Check that start values agree with the XML, variables are readable, and settable ones accept their values."""
    with RawInstance(library) as run:
        run.begin()
        for v in library.variables:
            status, value = run.read_status(v)
            stated = v.start if v.initial == "exact" or v.causality == "input" else None
            if status not in (OK, WARNING):
                getter = library.named(f"Get{v.type}")
                message = f"{getter} of {v.name} fails{last_message(library)}; make every declared variable readable"
                report("variable-not-readable", message, v.name)
            elif stated is not None and not _same(v, stated, value):
                message = f"{v.name} starts at {value!r}, but at {stated!r} in the XML; make them agree"
                report("start-differs", message, v.name)
        for v in library.variables:
            settable = v.causality in ("parameter", "input") and v.start is not None
            if settable and run.write_status(v, v.start) not in (OK, WARNING):
                message = f"{v.name} rejects its start value {v.start}{last_message(library)}; accept it"
                report("variable-not-settable", message, v.name)
        run.must("ExitInitializationMode")
        for v in library.variables:
            if v.causality == "output" and v.type == "Real" and not math.isfinite(run.read_status(v)[1]):
                message = f"{v.name} is not finite after initialisation; choose valid start values"
                report("value-not-finite", message, v.name)


# ---- the order of calls (section 4.2.4)

_MODES = {
    "I": "the state instantiated",
    "N": "the state initialization mode",
    "C": "the state step complete",
    "T": "the state terminated",
}

Run = TypeVar("Run", bound=RawInstance)
InMode = Callable[[RawLibrary, str], RawInstance]  # returns an instance in a mode, given by its letter


def report_refused(
    library: RawLibrary,
    report: Report,
    in_mode: InMode,
    modes: dict[str, str],
    calls: Mapping[str, tuple[str, Callable[[RawInstance], int]]],
) -> None:
    """Report calls that are rejected in one of the modes in which the standard allows them."""
    for name, (allowed_in, call) in calls.items():
        for mode in allowed_in:
            with in_mode(library, mode) as run:
                library.messages.clear()
                if call(run) not in (OK, WARNING):
                    what = f"{library.named(name)} is rejected in {modes[mode]}{last_message(library)}"
                    report("call-refused", f"{what}; allow it in this state")


def report_accepted(
    library: RawLibrary,
    report: Report,
    in_mode: InMode,
    modes: dict[str, str],
    calls: dict[str, tuple[str, tuple[object, ...]]],
    skipped: type[Exception],
) -> None:
    """Report calls that are accepted in a mode in which the standard forbids them."""
    accepted = []
    for name, (forbidden_in, arguments) in calls.items():
        for mode in forbidden_in:
            try:
                with in_mode(library, mode) as run:
                    library.misuse = f", not allowed in {modes[mode]},"
                    status = run.status(name, *arguments)
                    library.misuse = ""
                    if status in (OK, WARNING):
                        accepted.append(f"{library.named(name)} in {modes[mode]}")
            except skipped:
                library.misuse = ""
    if accepted:
        shown = ", ".join(accepted)
        report("call-order-accepted", f"the FMU accepts {shown}; return {library.named('Error')} and log the reason")


def _in_mode(library: RawLibrary, mode: str) -> RawInstance:
    return brought(RawInstance(library), mode, lambda run: run.step(library.start_time, library.job["step"]))


def brought(run: Run, mode: str, initialised: Callable[[Run], object]) -> Run:
    """Bring a new instance into a mode, through a step or an event behind the initialization mode."""
    if mode != "I":
        run.begin()
    if mode not in "IN":
        run.must("ExitInitializationMode")
        initialised(run)
    if mode == "T":
        run.must("Terminate")
    return run


def _real(library: RawLibrary, *causalities: str) -> ProbedVariable | None:
    found = (v for v in library.variables if v.type == "Real" and v.causality in causalities and v.start is not None)
    return next(found, None)


def _get(run: RawInstance, v: ProbedVariable | None) -> int:
    return OK if v is None else run.read_status(v)[0]


def _set(run: RawInstance, v: ProbedVariable | None) -> int:
    return OK if v is None else run.write_status(v, v.start)


@probe(several=True, only="co-simulation")
def allowed(library: RawLibrary, report: Report) -> None:
    """Check that calls are accepted in each state in which the standard allows them."""
    real = next((v for v in library.variables if v.type == "Real"), None)
    calls: dict[str, tuple[str, Callable[[RawInstance], int]]] = {
        "SetDebugLogging": ("INCT", lambda run: run.status("SetDebugLogging", 1, 0, None)),
        "SetReal of an input": ("NC", lambda run: _set(run, _real(library, "input"))),
        "SetReal of a parameter": ("IN", lambda run: _set(run, _real(library, "parameter"))),
        "GetReal": ("NCT", lambda run: _get(run, real)),
        "Terminate": ("C", lambda run: run.status("Terminate")),
        "Reset": ("INCT", lambda run: run.status("Reset")),
    }
    if library.flag("canGetAndSetFMUstate"):
        calls["GetFMUstate"] = ("INCT", lambda run: _state(run))
    report_refused(library, report, _in_mode, _MODES, calls)


def _state(run: RawInstance) -> int:
    state = c_void_p()
    status = run.status("GetFMUstate", byref(state))
    run.status("FreeFMUstate", byref(state))
    return status


@probe(several=True, crash="misuse-crashes", only="co-simulation")
def forbidden(library: RawLibrary, report: Report) -> None:
    """Check that calls are rejected in each state in which the standard forbids them."""
    step = library.job["step"]
    calls: dict[str, tuple[str, tuple[object, ...]]] = {
        "SetupExperiment": ("NCT", (0, 0.0, library.start_time, 0, 0.0)),
        "EnterInitializationMode": ("NCT", ()),
        "ExitInitializationMode": ("ICT", ()),
        "DoStep": ("INT", (library.start_time, step, 1)),
        "Terminate": ("INT", ()),
    }
    report_accepted(library, report, _in_mode, _MODES, calls, MissingError)


@probe(several=True, crash="misuse-crashes")
def without_logger(library: RawLibrary, report: Report) -> None:
    """Check that a rejected fmi2Instantiate works with callbacks without a logger."""
    callbacks = (c_void_p * 5)(None, *library.memory)  # an FMU may need the other functions
    pointer = library.call("Instantiate", b"checked", library.kind, b"{wrong}", b"", ctypes.addressof(callbacks), 0, 1)
    if pointer:
        library.call("FreeInstance", pointer)
