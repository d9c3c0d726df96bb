"""OMSimulator, by its Python package."""

from __future__ import annotations

import csv
import math
import shutil
import tempfile
from pathlib import Path
from typing import Any

import OMSimulator
from adapter import AdaptedCase, Rows, UnsupportedError, main
from OMSimulator import SSP, Capi, CRef

LACKS = ("call",)
WEAK, STRONG = 1, 2  # kinds of systems: co-simulation, model exchange
CVODE, FIXED_STEP = 3, 6  # solvers
REAL = 3  # type of a signal


def checked(status: Any, what: str) -> None:
    """A status of the interface in C."""
    if getattr(status, "value", status) not in (0, 1):
        raise RuntimeError(f"{what}: {status}")


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    folder = Path(tempfile.mkdtemp(prefix="oms"))
    try:
        Capi.setTempDirectory(str(folder))
        Capi.setWorkingDirectory(str(folder))
        Capi.setCommandLineOption("--suppressPath=true")
        return list(system(case) if case.kind == "ssp" else alone(case, folder))
    finally:
        shutil.rmtree(folder)


def alone(case: AdaptedCase, folder: Path) -> Rows:
    """One FMU, with a table for its inputs."""
    strong = case.kind == "me"
    checked(Capi.newModel("model"), "newModel")
    checked(Capi.addSystem("model.root", STRONG if strong else WEAK), "addSystem")
    checked(Capi.addSubModel("model.root.fmu", str(case.file)), "addSubModel")
    inputs = case.inputs()
    if inputs.held:
        raise UnsupportedError("its tables have real numbers only")
    if inputs.lines:
        checked(Capi.addSubModel("model.root.table", str(table(case, folder))), "addSubModel")
        for name in inputs.lines:
            checked(Capi.addConnection(f"model.root.table.{name}", f"model.root.fmu.{name}"), "addConnection")
    for name, value in case.values.items():
        put(f"model.root.fmu.{name}", value, case.types()[name])
    if strong:
        checked(Capi.setSolver("model.root", CVODE), "setSolver")
    else:
        checked(Capi.setFixedStepSize("model.root", case.step), "setFixedStepSize")
    checked(Capi.setTolerance("model.root", case.tolerance), "setTolerance")
    return simulated(case, "model")


def table(case: AdaptedCase, folder: Path) -> Path:
    """The inputs with the row before a jump a moment earlier, as it takes the first of two rows with one time."""
    path = folder / "table.csv"
    inputs = case.inputs()
    times = [math.nextafter(t, -math.inf) if t in inputs.times[k + 1 :] else t for k, t in enumerate(inputs.times)]
    rows = zip(times, *inputs.columns.values(), strict=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["time", *inputs.columns], *([repr(x) for x in row] for row in rows)])
    return path


def put(name: str, value: Any, kind: str) -> None:
    """A start value."""
    if isinstance(value, list):
        raise UnsupportedError("its interface has no arrays")
    checked(getattr(Capi, f"set{kind}")(name, value), f"set{kind} {name}")


def simulated(case: AdaptedCase, model: str) -> Rows:
    """Values at the communication points."""
    checked(Capi.setStartTime(model, case.start), "setStartTime")
    checked(Capi.setStopTime(model, case.stop), "setStopTime")
    checked(Capi.setResultFile(model, "", 1), "setResultFile")
    for step in ("instantiate", "initialize"):
        checked(getattr(Capi, step)(model), step)
    kinds = case.types()

    def read() -> list[Any]:
        return [value(f"model.root.fmu.{name}", kinds[name]) for name in case.outputs]

    first, *others = case.times()
    yield [first, *read()]
    for t in others:
        checked(Capi.stepUntil(model, t), f"stepUntil {t}")
        reached, _ = Capi.getTime(model)
        yield [reached, *read()]
    for step in ("terminate", "delete"):
        checked(getattr(Capi, step)(model), step)


def value(name: str, kind: str) -> Any:
    """A value of now."""
    found, status = getattr(Capi, f"get{kind}")(name)
    checked(status, f"get{kind} {name}")
    return found


def system(case: AdaptedCase) -> Rows:
    """An SSP."""
    model = SSP(str(case.file)).instantiate()
    model.setResultFile("", 1)
    model.setStartTime(case.start)
    model.setStopTime(case.stop)
    model.setFixedStepSize(case.step)
    model.initialize()

    def read() -> list[Any]:
        return [model.getValue(CRef(*f"{model.system.name}.{name}".split("."))) for name in case.outputs]

    first, *others = case.times()
    yield [first, *read()]
    for t in others:
        model.stepUntil(t)
        yield [model.getTime(), *read()]
    model.terminate()
    model.delete()


if __name__ == "__main__":
    main(run, LACKS, lambda: OMSimulator.version.removeprefix("OMSimulator v").removesuffix("-linux"))
