"""Checks of an FMU's binary in a monitored process, in which a crash or a hang is a finding."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import Any, Final

import fmpy
from lxml import etree

from friction_fmus.check.archive_rules import Contents
from friction_fmus.check.description import SECTIONS, Model, Variable2, integer, real
from friction_fmus.check.findings import RULES, Finding, Severity, declare
from friction_fmus.check.fmi3_rules import DERIVATIVE, FLOATS, INTEGERS, Model3, Variable3
from friction_fmus.check.probes import events, fmi3_features, lifecycle, stepping, surroundings
from friction_fmus.check.probes.fmi2_library import TRACE_SIZE
from friction_fmus.check.probes.probe_process import CRASHES, ONLY, PROBES, SEVERAL, WITH
from friction_fmus.errors import FrictionError
from harness.compiling.platforms import NATIVE
from harness.storage.files import ScratchFolder
from harness.storage.zip_file import unpack_zip

_MODULES: Final = (lifecycle, stepping, events, fmi3_features, surroundings)  # register the probes, in this order

_RULES: Final[dict[str, tuple[Severity, str, str]]] = {
    "binary-not-loadable": ("error", "2.3", "The library for this platform cannot be loaded."),
    "binary-crashes": ("error", "2.1.3", "A legal call ends the process."),
    "binary-hangs": ("error", "2.1.3", "A legal call does not return within the time limit."),
    "free-null": ("warning", "2.1.5", "fmi2FreeInstance does not ignore a null pointer."),
    "misuse-crashes": ("warning", "4.2.4", "A call in a state in which it is not allowed ends the process or hangs."),
    "function-missing": ("error", "2.3", "The library does not export a function of the standard."),
    "version-answer": ("error", "2.1.4", "fmi2GetVersion or fmi2GetTypesPlatform returns a wrong result."),
    "instantiate-fails": ("error", "2.1.5", "fmi2Instantiate returns no instance for the guid of the XML."),
    "guid-not-checked": ("error", "2.1.5", "fmi2Instantiate accepts a guid that differs from the XML."),
    "second-instance": ("error", "4.3.1", "A second instance is rejected although the XML allows it."),
    "instances-interfere": ("error", "2.1.5", "An instance affects the results of another one."),
    "call-refused": ("error", "4.2.4", "A call is rejected in a state in which the standard allows it."),
    "call-order-accepted": ("warning", "4.2.4", "A call is accepted in a state in which the standard forbids it."),
    "start-differs": ("error", "2.2.7", "A start value in the XML differs from the start value in the binary."),
    "variable-not-readable": ("error", "2.1.7", "A declared variable cannot be read."),
    "variable-not-settable": ("error", "2.1.7", "An input or parameter rejects its own start value."),
    "step-refused": ("error", "4.2.2", "fmi2DoStep rejects a step that the capabilities allow."),
    "step-rounding": ("error", "4.2.2", "fmi2DoStep rejects a step that differs from the last one only by rounding."),
    "time-wrong": ("error", "4.2.2", "The time after a step is not the end of the step."),
    "time-own-grid": (
        "note",
        "4.2.2",
        "The time after a step lags by less than a preferred step, on a grid of the FMU.",
    ),
    "time-rounded": ("note", "4.2.2", "The time after a step differs from the end of the step by rounding."),
    "value-not-finite": ("warning", "2.2.7", "An output is NaN or infinite with all start values unchanged."),
    "event-iteration": ("error", "3.2.2", "fmi2NewDiscreteStates asks for iterations without end."),
    "event-time": ("error", "3.2.2", "The next time event is not after the current time."),
    "counts": ("error", "3.2.2", "A function sets more or fewer results than it must."),
    "nominal-states": ("error", "3.2.2", "A nominal value of a state is not positive."),
    "states": ("error", "3.2.1", "States are not kept, or are other variables than the XML says."),
    "history": ("error", "3.2.1", "Values depend on points that the solver has tried before."),
    "directional": ("error", "2.1.9", "A directional derivative disagrees with differences."),
    "dependency-missing": ("error", "2.2.8", "A value depends on an input that its dependencies omit."),
    "not-reproducible": ("warning", "2.1.5", "Two instances with the same calls give different results."),
    "reset-incomplete": ("error", "2.1.6", "After fmi2Reset, the same calls give different results."),
    "state-not-restored": ("error", "2.1.8", "fmi2SetFMUstate does not restore the complete saved state."),
    "state-pointer": ("error", "2.1.8", "fmi2FreeFMUstate does not clear the pointer to the freed state."),
    "state-not-serialized": ("error", "2.1.8", "A state differs after serialisation."),
    "capability": ("error", "4.3.1", "A function fails although the XML declares the capability."),
    "memory-grows": ("warning", "2.1.5", "Memory grows with every instance or every step."),
    "log-category": ("note", "2.2.4", "A message is logged in a category that the XML does not declare."),
    "prints": ("note", "2.1.5", "The library prints to stdout or stderr instead of the logger."),
    "process-changed": (
        "warning",
        "2.1.5",
        "The library changes the working directory, the locale or the rounding mode.",
    ),
}
"""Rules of the binary: severity, section of FMI 2.0.5, and a description of the error."""

_RULES_3: Final[dict[str, tuple[Severity, str, str]]] = {
    "fmi3-configuration": ("error", "2.2.1", "A structural parameter cannot be set in its mode, or elsewhere too."),
    "fmi3-adjoint": ("error", "2.2.11", "An adjoint derivative disagrees with a directional derivative."),
    "fmi3-event-mode": ("error", "4.2.2", "A co-simulation with events fails."),
    "fmi3-intermediate-update": ("error", "4.2.2", "Intermediate updates are out of order or end a step."),
}
"""Rules of what FMI 3.0 adds, with sections of FMI 3.0.2."""

for _id, _rule in _RULES.items():
    declare(_id, *_rule, "binary")
for _id, _rule in _RULES_3.items():
    declare(_id, *_rule, "fmi3")

NO_BINARY = declare("no-binary-here", "note", "2.3", "There is no binary for this machine, so none was run.", "binary")

_FLAGS: Final = (
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "providesDirectionalDerivative",
)
_PROGRAM: Final = (
    "import sys; sys.path.append({folder!r}); "
    "from probes import lifecycle, stepping, events, fmi3_features, surroundings; "
    "from probes.probe_process import main; main({place!r}, {names!r})"
)
_DEBUG: Final = "run this call in a debugger"
_ADVICE: Final = {
    "guid-not-checked": "return no instance and log the reason",
    "free-null": "return immediately if there is no instance",
    "misuse-crashes": "return an error for a call that is not allowed, and do not rely on a logger",
}
_START_TIME: Final = 30.0
"""Longest time until the first probe begins, as a slow start on a busy machine is not the fault of the FMU [s]."""


def examine_binary(contents: Contents, model: Model | Model3, time_limit: float) -> list[Finding]:
    """Run the probes of co-simulation and model exchange, and return their findings."""
    findings: list[Finding] = []
    for interface in model.interfaces:
        if interface.tag == "ScheduledExecution":
            continue
        folder, job = (
            (NATIVE.folder, _job(model, interface))
            if isinstance(model, Model)
            else (fmpy.platform_tuple, _job_3(model, interface))
        )
        once = _flag(interface, "canBeInstantiatedOnlyOncePerProcess")
        binary = f"binaries/{folder}/{interface.get('modelIdentifier', '')}{NATIVE.suffix}"
        findings += run_probes(contents, binary, job, _probes(model, interface, once), once, time_limit)
    return list(dict.fromkeys(findings))


def run_probes(
    contents: Contents, binary: str, job: dict[str, Any], names: list[str], once: bool, time_limit: float
) -> list[Finding]:
    """Run probes of one interface and return their findings."""
    if binary not in contents.names:
        found = sorted({path.parts[1] for path in contents.below("binaries") if len(path.parts) > 2})
        there = ", ".join(found) or "none"
        return [
            NO_BINARY.finding(f"{binary} is missing (binaries for: {there}); run the check on one of these platforms")
        ]
    with ScratchFolder() as name:
        folder = Path(name).resolve()
        unpack_zip(contents.archive, folder / "fmu")  # no rule has found a dangerous member
        job = job | {
            "folder": str(folder),
            "binary": str(folder / "fmu" / binary),
            "resources": str(folder / "fmu" / "resources"),
        }
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        (folder / "trace").write_bytes(b" " * TRACE_SIZE)
        return list(_supervise(folder, names, once, binary, time_limit))


def _probes(model: Model | Model3, interface: etree._Element, once: bool) -> list[str]:
    """Return the probes of an interface. Those of both run once in FMI 2.0, apart from those of saved states."""
    kind = "model exchange" if interface.tag == "ModelExchange" else "co-simulation"
    wanted = {kind} if isinstance(model, Model) else {kind, "FMI 3.0", f"FMI 3.0 {kind}"}
    names = [name for name in PROBES if ONLY.get(name, kind) in wanted and not (once and name in SEVERAL)]
    if interface is model.interfaces[0] or isinstance(model, Model3):
        return names
    return [name for name in names if name in ONLY or name in _REPEATED]


_REPEATED: Final = ("functions", "state", "serialization", "reset", "messages")
"""Probes of both interfaces that run for each of them."""


def _flag(interface: etree._Element, name: str) -> bool:
    return interface.get(name) in ("true", "1")


def _common(model: Model | Model3, interface: etree._Element, own_step: float | None = None) -> dict[str, Any]:
    """Return what both versions of FMI state alike: the default experiment, and what belongs to the interface."""
    experiment = model.root.find("DefaultExperiment")
    names = ("startTime", "stopTime", "stepSize")
    given = {} if experiment is None else {name: real(experiment.get(name)) for name in names}
    start, stop, step = given.get("startTime") or 0.0, given.get("stopTime"), given.get("stepSize") or own_step
    if not step or not 0.0 < step < float("inf"):
        step = (stop - start) / 500.0 if stop and 0.0 < stop - start < float("inf") else 1e-2
    return {
        "start_time": start if abs(start) < float("inf") else 0.0,
        "step": step,
        "exchange": interface.tag == "ModelExchange",
        "output_derivatives": integer(interface.get("maxOutputDerivativeOrder")) or 0,
        "categories": [element.get("name") for element in model.root.iterfind("LogCategories/Category")],
    }


def _job(model: Model, interface: etree._Element) -> dict[str, Any]:
    """Return the data of the XML that the probes need, as a JSON value."""
    return {
        **_common(model, interface),
        "guid": model.root.get("guid", ""),
        "flags": {name: _flag(interface, name) for name in _FLAGS},
        "states": [_state(model, unknown.index) for unknown in model.unknowns["Derivatives"]],
        "indicators": max(0, integer(model.root.get("numberOfEventIndicators")) or 0),
        "dependencies": {section: _dependencies(model, f"{section}/Unknown", "index") for section in SECTIONS},
        "completes": not _flag(interface, "completedIntegratorStepNotNeeded"),
        "variables": [row for v in model.variables if (row := _row(v)) is not None],
    }


def _state(model: Model, index: int) -> dict[str, Any]:
    """Return a derivative with its state; None for a name that the XML does not tell."""
    derivative = model.variable(index)
    state = None if derivative is None else model.numbered(derivative.get("derivative"))
    named = {}
    for key, v in (("derivative", derivative), ("state", state)):
        row = None if v is None else _row(v)
        named[key] = None if row is None else row["name"]
        named[f"{key}_reference"] = None if row is None else row["reference"]
    return named


def _dependencies(model: Model | Model3, section: str, key: str) -> dict[str, list[str]]:
    """Return the names on which each unknown depends; without an unknown that depends on all."""
    found = {}
    for element in model.all(f"ModelStructure/{section}"):
        v, given = model.numbered(element.get(key)), element.get("dependencies")
        if v is not None and given is not None:
            found[v.name] = [known.name for known in map(model.numbered, given.split()) if known is not None]
    return found


def _row(v: Variable2) -> dict[str, Any] | None:
    reference = integer(v.reference)
    if reference is None or not 0 <= reference < 1 << 32 or not v.type:
        return None
    kind = "Integer" if v.type == "Enumeration" else v.type
    return _scalar(v, reference, kind, v.initial, _start(kind, v.start))


def _scalar(v: Variable2 | Variable3, reference: int, kind: str, initial: str | None, start: Any) -> dict[str, Any]:
    low, high, nominal = real(v.get("min")), real(v.get("max")), real(v.get("nominal"))
    return {
        "name": v.name,
        "reference": reference,
        "type": kind,
        "causality": v.causality,
        "variability": v.variability,
        "initial": initial,
        "start": start,
        "low": -1e300 if low is None else low,
        "high": 1e300 if high is None else high,
        "nominal": nominal or 1.0,
    }


def _start(kind: str, text: str | None) -> Any:
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text.strip() in ("true", "1")
    number = integer(text) if kind == "Integer" else real(text)
    return number if kind == "Real" or number is None or -(1 << 31) <= number < 1 << 31 else None


# ---- FMI 3.0

_TYPES: Final = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean", "String": "String"}
"""Types of FMI 2.0 of scalars that the probes of FMI 2.0 read and set."""
_FLAGS_3: Final = {
    "canHandleVariableCommunicationStepSize": "canHandleVariableCommunicationStepSize",
    "canBeInstantiatedOnlyOncePerProcess": "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUstate": "canGetAndSetFMUState",
    "canSerializeFMUstate": "canSerializeFMUState",
    "providesDirectionalDerivative": "providesDirectionalDerivatives",
}
"""Capabilities of FMI 2.0, and their names in FMI 3.0."""


def _job_3(model: Model3, element: etree._Element) -> dict[str, Any]:
    indicators = (model.numbered(e.get("valueReference")) for e in model.all("ModelStructure/EventIndicator"))
    clocks = [v for v in model.variables if v.type == "Clock" and v.causality == "input"]
    return {
        **_common(model, element, real(element.get("fixedInternalStepSize"))),
        "version": 3,
        "guid": model.root.get("instantiationToken", ""),
        "flags": {old: _flag(element, new) for old, new in _FLAGS_3.items()},
        "states": [state for e in model.all(f"ModelStructure/{DERIVATIVE}") for state in _states_3(model, e)],
        "indicators": sum(model.elements(v) or 1 for v in indicators if v is not None),
        "dependencies": {
            old: _dependencies(model, new, "valueReference")
            for old, new in zip(SECTIONS, ("Output", DERIVATIVE, "InitialUnknown"), strict=True)
        },
        "completes": _flag(element, "needsCompletedIntegratorStep"),
        "variables": [row for v in model.variables if (row := _row_3(v)) is not None],
        "arrays": [row for v in model.variables if (row := _array(model, v)) is not None],
        "structural": [
            row
            for v in model.variables
            if v.causality == "structuralParameter" and (row := _array(model, v)) is not None and row["starts"]
        ],
        "clocks": [
            {
                "name": v.name,
                "reference": v.reference,
                "stated": any(v.get(each) is not None for each in ("intervalDecimal", "intervalCounter")),
            }
            for v in clocks
            if v.get("intervalVariability") in ("constant", "fixed", "tunable")
        ],
        "event_mode": _flag(element, "hasEventMode"),
        "returns": _flag(element, "mightReturnEarlyFromDoStep")
        or _flag(element, "canReturnEarlyAfterIntermediateUpdate"),
        "adjoint": _flag(element, "providesAdjointDerivatives") and _flag(element, "providesDirectionalDerivatives"),
        "intermediate": _flag(element, "providesIntermediateUpdate"),
    }


def _states_3(model: Model3, element: etree._Element) -> list[dict[str, Any]]:
    """Return a derivative with its state; None for the elements of arrays, which the probes of FMI 2.0 do not read."""
    derivative = model.numbered(element.get("valueReference"))
    state = None if derivative is None else model.numbered(derivative.element.get("derivative"))
    if derivative is None or state is None or derivative.dimensions:
        count = 1 if derivative is None else model.elements(derivative) or 1
        return [dict.fromkeys(("derivative", "derivative_reference", "state", "state_reference"))] * count
    pair = {"derivative": derivative.name, "derivative_reference": derivative.reference}
    return [pair | {"state": state.name, "state_reference": state.reference}]


def _row_3(v: Variable3) -> dict[str, Any] | None:
    if v.type not in _TYPES or v.dimensions or v.reference is None or v.clocks:
        return None
    text = v.starts[0] if v.starts else None
    value: Any = text
    if v.type != "String" and text is not None:
        value = text in ("true", "1") if v.type == "Boolean" else integer(text) if v.type == "Int32" else real(text)
    return _scalar(v, v.reference, _TYPES[v.type], None if v.causality == "input" else v.initial, value)


def _array(model: Model3, v: Variable3) -> dict[str, Any] | None:
    """Return a variable of numbers or Booleans with all its elements."""
    count = model.elements(v)
    if v.type not in (*FLOATS, *INTEGERS, "Boolean", "Enumeration") or v.reference is None or count is None or v.clocks:
        return None
    texts = v.starts or ()
    texts = texts * count if len(texts) == 1 else texts
    read = real if v.type in FLOATS else integer
    values = [text in ("true", "1") if v.type == "Boolean" else read(text) for text in texts]
    known = len(values) == count and None not in values and v.initial == "exact"
    return {
        "name": v.name,
        "reference": v.reference,
        "type": v.type,
        "count": count,
        "variability": v.variability,
        "starts": values if known else [],
        "settable": v.causality in ("input", "parameter"),
    }


# ---- the process


def _supervise(folder: Path, names: list[str], once: bool, binary: str, time_limit: float) -> Iterator[Finding]:
    """Run the probes, with a new process after each one that does not return."""
    while names:
        (folder / "report").write_bytes(b"")
        ending = _run(folder, names[:1] if once else names, time_limit)
        lines = [json.loads(line) for line in (folder / "report").read_bytes().splitlines()]
        for line in lines:
            if "fault" in line:
                raise FrictionError(
                    f"the probe {line['probe']} of {binary} raised {line['fault']}; report this error in the check"
                )
            if "finding" in line:
                yield RULES[line["finding"]].finding(line["message"], binary, variable=line["variable"])
        begun = [line["probe"] for line in lines if "probe" in line]
        current = begun[-1] if begun else "load"
        if lines and lines[-1].get("end") == "load":
            return
        if not (lines and lines[-1].get("end")):
            yield _broken(folder, binary, ending, current)
            if current == "load" or (ending == "" and current not in CRASHES):
                return  # no use to continue with a library that cannot be loaded or that hangs
        refused = any(line.get("finding") == "instantiate-fails" for line in lines)
        names = [] if refused else names[names.index(current) + 1 :]


def _broken(folder: Path, binary: str, ending: str, current: str) -> Finding:
    """Return the finding for the last call, which ended its process or did not return."""
    function = (folder / "trace").read_bytes().decode(errors="replace").strip() or "a call"
    hangs = ending == ""
    if current == "load" and not hangs:
        message = f"loading the library ends its process: {ending}; it or its initialisers are faulty: build it again"
        return RULES["binary-not-loadable"].finding(message, binary)
    special = CRASHES.get(current)
    how = "does not return within the time limit" if hangs else f"ends its process: {ending}"
    rule = RULES[special or ("binary-hangs" if hangs else "binary-crashes")]
    function += WITH.get(current, "")
    return rule.finding(f"{function} {how}; {_ADVICE.get(special or '', _DEBUG)}", binary)


def _run(folder: Path, names: list[str], time_limit: float) -> str:
    """Run one process and return how it ended; empty if it was killed at the time limit."""
    program = _PROGRAM.format(folder=str(Path(__file__).parent), place=str(folder), names=names)
    with (folder / "stdout").open("ab") as out, (folder / "stderr").open("ab") as err:
        child = subprocess.Popen(
            [sys.executable, "-I", "-X", "utf8", "-c", program],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            cwd=folder,
            start_new_session=True,  # Ctrl-C goes to the check, which then ends the process
        )
        try:
            return "" if _hangs(child, folder / "report", time_limit) else _ending(child.wait())
        finally:
            _end(child)


def _hangs(child: subprocess.Popen[bytes], report: Path, time_limit: float) -> bool:
    """Return whether no new probe begins within the time limit while the process is alive."""
    seen, deadline = 0, monotonic() + max(time_limit, _START_TIME)
    while child.poll() is None:
        try:
            child.wait(0.02)
        except subprocess.TimeoutExpired:
            size = report.stat().st_size
            if size != seen:
                seen, deadline = size, monotonic() + time_limit
            if monotonic() > deadline:
                return True
    return False


def _end(child: subprocess.Popen[bytes]) -> None:
    """End the process and its child processes."""
    if os.name == "posix":
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()
    child.wait()


def _ending(status: int) -> str:
    if status >= 0:
        return f"exit status {status}"
    known = {member.value: member.name for member in signal.Signals}
    return known.get(-status, f"signal {-status}")
