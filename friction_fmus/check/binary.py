"""Checks of an FMU's binary in a monitored process, in which a crash or a hang is a finding."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import Any, Final

from lxml import etree

from friction_fmus.check.archive import Contents
from friction_fmus.check.description import Model, Variable, integer, real
from friction_fmus.check.findings import RULES, Finding, declare
from friction_fmus.check.probes import arrays, events, lifecycle, stepping, surroundings
from friction_fmus.check.probes.host import CRASHES, ONLY, PROBES, SEVERAL, WITH
from friction_fmus.check.probes.library import TRACE_SIZE
from friction_fmus.check.probes.rules import RULES as BINARY_RULES
from friction_fmus.check.probes.rules import RULES_3
from friction_fmus.errors import FrictionError
from harness.compiling.platforms import NATIVE
from harness.storage.files import ScratchFolder
from harness.storage.zip_file import unpack_zip

_MODULES: Final = (lifecycle, stepping, events, arrays, surroundings)
"""Modules that register the probes, in this order."""

for _id, (_severity, _section, _summary) in BINARY_RULES.items():
    declare(_id, _severity, _section, _summary, "binary")  # type: ignore[arg-type]
for _id, (_severity, _section, _summary) in RULES_3.items():
    declare(_id, _severity, _section, _summary, "fmi3")  # type: ignore[arg-type]

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
    "import sys; sys.path.append({folder!r}); from probes import lifecycle, stepping, events, arrays, surroundings; "
    "from probes.host import main; main({place!r}, {names!r})"
)
_DEBUG: Final = "run this call in a debugger"
_ADVICE: Final = {
    "guid-not-checked": "return no instance and log the reason",
    "free-null": "return immediately if there is no instance",
    "misuse-crashes": "return an error for a call that is not allowed, and do not rely on a logger",
}
_START_TIME: Final = 30.0
"""Longest time until the first probe begins, as a slow start on a busy machine is not the fault of the FMU [s]."""


def examine_binary(contents: Contents, model: Model, time_limit: float) -> list[Finding]:
    """Run the probes and return their findings."""
    findings: list[Finding] = []
    for interface in model.interfaces:
        findings += _examine(contents, model, interface, time_limit)
    return list(dict.fromkeys(findings))


def _examine(contents: Contents, model: Model, interface: etree._Element, time_limit: float) -> list[Finding]:
    """Run the probes of one interface."""
    binary = f"binaries/{NATIVE.folder}/{interface.get('modelIdentifier', '')}{NATIVE.suffix}"
    once = _flag(interface, "canBeInstantiatedOnlyOncePerProcess")
    return run_probes(contents, binary, _job(model, interface), _probes(model, interface, once), once, time_limit)


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


def _probes(model: Model, interface: etree._Element, once: bool) -> list[str]:
    """Return the probes of an interface. Those of both run once, apart from those of saved states."""
    kind = "model exchange" if interface.tag == "ModelExchange" else "co-simulation"
    names = [name for name in PROBES if ONLY.get(name, kind) == kind and not (once and name in SEVERAL)]
    if interface is model.interfaces[0]:
        return names
    return [name for name in names if name in ONLY or name in _REPEATED]


_REPEATED: Final = ("functions", "state", "serialization", "reset", "messages")
"""Probes of both interfaces that run for each of them."""


def _flag(interface: etree._Element, name: str) -> bool:
    return interface.get(name) in ("true", "1")


def _job(model: Model, interface: etree._Element) -> dict[str, Any]:
    """Return the data of the XML that the probes need, as a JSON value."""
    orders = integer(interface.get("maxOutputDerivativeOrder"))
    return {
        "guid": model.root.get("guid", ""),
        **span(model.root, None),
        "exchange": interface.tag == "ModelExchange",
        "flags": {name: _flag(interface, name) for name in _FLAGS},
        "states": [_state(model, unknown.index) for unknown in model.unknowns["Derivatives"]],
        "indicators": max(0, integer(model.root.get("numberOfEventIndicators")) or 0),
        "dependencies": {
            section: _dependencies(model, section) for section in ("Outputs", "Derivatives", "InitialUnknowns")
        },
        "completes": not _flag(interface, "completedIntegratorStepNotNeeded"),
        "output_derivatives": orders or 0,
        "categories": [element.get("name") for element in model.all("LogCategories/Category")],
        "variables": [row for v in model.variables if (row := _row(v)) is not None],
    }


def span(root: etree._Element, fixed: float | None) -> dict[str, float]:
    """Return start time and step of the default experiment, or else a fixed step of the FMU."""
    experiment = root.find("DefaultExperiment")
    names = ("startTime", "stopTime", "stepSize")
    given = {} if experiment is None else {name: real(experiment.get(name)) for name in names}
    start, stop, step = given.get("startTime") or 0.0, given.get("stopTime"), given.get("stepSize") or fixed
    if not step or not 0.0 < step < math.inf:
        step = (stop - start) / 500.0 if stop and 0.0 < stop - start < math.inf else 1e-2
    return {"start_time": start if abs(start) < math.inf else 0.0, "step": step}


def _state(model: Model, index: int) -> dict[str, Any]:
    """Return a derivative with its state; None for a name that the XML does not tell."""
    derivative = model.variable(index)
    state = None if derivative is None else model.variable(integer(derivative.get("derivative")) or 0)
    named = {}
    for key, v in (("derivative", derivative), ("state", state)):
        row = None if v is None else _row(v)
        named[key] = None if row is None else row["name"]
        named[f"{key}_reference"] = None if row is None else row["reference"]
    return named


def _dependencies(model: Model, section: str) -> dict[str, list[str]]:
    """Return the names on which each unknown depends; without an unknown that depends on all."""
    found = {}
    for unknown in model.unknowns[section]:
        v = model.variable(unknown.index)
        if v is not None and unknown.dependencies is not None:
            found[v.name] = [known.name for index in unknown.dependencies if (known := model.variable(index))]
    return found


def _row(v: Variable) -> dict[str, Any] | None:
    reference = integer(v.reference)
    if reference is None or not 0 <= reference < 1 << 32 or not v.type:
        return None
    kind = "Integer" if v.type == "Enumeration" else v.type
    low, high, nominal = real(v.get("min")), real(v.get("max")), real(v.get("nominal"))
    return {
        "name": v.name,
        "reference": reference,
        "type": kind,
        "causality": v.causality,
        "variability": v.variability,
        "initial": v.initial,
        "start": _start(kind, v.start),
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
    return f"{known.get(-status, f'signal {-status}')}"
