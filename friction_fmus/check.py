"""Checks of an FMU beyond fmpy's: the archive, and what the binary does. For any FMI 2.0 co-simulation FMU."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from harness import HarnessError, open_archive

ODD_STEPS = (1e-3 / 3.0, 1.0 / 60.0, 1e-3, 1e-4)
"""Communication steps that are no binary fractions [s]."""


def check(path: Path) -> list[str]:
    """Looks for faults in one FMU.

    Parameters
    ----------
    path : Path
        The FMU.

    Returns
    -------
    list of str
        One sentence for each finding; empty if there is none. A file that cannot be opened at all is one
        finding.
    """
    try:
        open_archive(path)
    except HarnessError as error:
        return [str(error)]
    findings = [str(finding) for finding in validate_fmu(str(path))]
    if findings:
        return findings
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path))
    try:
        return _run(description, folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _instance(description: Any, folder: str, name: str) -> FMU2Slave:
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=name,
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    return fmu


def _run(description: Any, folder: str) -> list[str]:
    """Start values, exact landing, two instances and the saved state, on the binary."""
    findings: list[str] = []
    try:
        first, second = _instance(description, folder, "first"), _instance(description, folder, "second")
    except Exception as error:  # fmpy raises bare Exceptions
        return [f"The binary cannot be initialised: {error}"]
    for v in description.modelVariables:
        if v.start is not None and v.type in ("Real", "Integer", "Boolean"):
            read, stated = _read(first, v), _stated(v)
            if read != stated:
                findings.append(f"{v.name} starts at {read} in the binary but at {stated} in the XML")
    first.exitInitializationMode()
    second.exitInitializationMode()

    time = 0.0
    clock = next((v for v in description.modelVariables if v.causality == "independent"), None)
    for step in ODD_STEPS:
        first.doStep(time, step)
        time += step
        if clock and _read(first, clock) != time:
            findings.append(f"After a step of {step!r} s the time is {_read(first, clock)!r} s, not {time!r} s")
    for k in range(len(ODD_STEPS)):
        second.doStep(sum(ODD_STEPS[:k]), ODD_STEPS[k])
    findings += _compare(description, first, second, "differs between two instances with the same steps")

    if description.coSimulation.canGetAndSetFMUstate:
        saved = first.getFMUState()
        first.doStep(time, 1e-3)
        first.setFMUState(saved)
        first.freeFMUState(saved)
        findings += _compare(description, first, second, "is not restored with the FMU state")
    for fmu in (first, second):
        fmu.terminate()
        fmu.freeInstance()
    return findings


def _compare(description: Any, first: FMU2Slave, second: FMU2Slave, sentence: str) -> list[str]:
    values = [(v.name, _read(first, v), _read(second, v)) for v in description.modelVariables if v.type != "String"]
    return [f"{name} {sentence}: {a} and {b}" for name, a, b in values if a != b]


def _read(fmu: FMU2Slave, v: Any) -> float:
    getter = {"Real": fmu.getReal, "Boolean": fmu.getBoolean}.get(v.type, fmu.getInteger)
    return float(getter([v.valueReference])[0])


def _stated(v: Any) -> float:
    return float(v.start in ("true", "1")) if v.type == "Boolean" else float(v.start)
