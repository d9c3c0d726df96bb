"""libcosim, by libcosimpy: inputs are set before each step by an override."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from itertools import pairwise
from typing import Any

from adapter import AdaptedCase, Rows, UnsupportedError, main
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

LACKS = ("call", "me", "partial-last-step", "algebraic-loops", "enumerations")
INITIAL = {"Real": float, "Integer": int, "Boolean": bool, "String": str}
TYPES = {0: "real", 1: "integer", 2: "string", 3: "boolean"}


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    log_output_level(CosimLogLevel.ERROR)
    step = round(case.step * 1e9)
    if abs(step - case.step * 1e9) > 1e-3:
        raise UnsupportedError("its times are whole nanoseconds")
    if case.kind == "ssp":
        execution = CosimExecution.from_ssp_file(str(case.file), step)
        slaves = {info.name.decode(): info.index for info in execution.slave_infos()}
    else:
        execution = CosimExecution.from_step_size(step)
        slave = CosimLocalSlave(fmu_path=str(case.file), instance_name="fmu")
        slaves = {"fmu": execution.add_local_slave(slave)}
    if case.start:
        raise UnsupportedError("its interface has no start time")
    variables = {part: {v.name.decode(): v for v in execution.slave_variables(i)} for part, i in slaves.items()}

    def place(name: str) -> tuple[int, Any]:
        part, _, port = name.rpartition(".") if case.kind == "ssp" else ("fmu", "", name)
        if port not in variables[part]:
            raise UnsupportedError(f"it does not know {name}, an enumeration")
        return slaves[part], variables[part][port]

    inputs = case.inputs() if case.kind != "ssp" else None
    if inputs is not None:
        for name, value in {**inputs.at(0.0), **case.values}.items():
            kind = case.types()[name]
            slave, variable = place(name)
            setter = getattr(execution, f"{kind.lower()}_initial_value")
            if not setter(slave, variable.reference, INITIAL[kind](value)):
                raise RuntimeError(f"it refuses the start value of {name}")
    override = CosimManipulator.create_override()
    observer = CosimObserver.create_last_value()
    if not (execution.add_manipulator(override) and execution.add_observer(observer)):
        raise RuntimeError("it takes no manipulator or observer")

    def apply(values: Mapping[str, Any]) -> None:
        kinds = case.types()
        for name, value in values.items():
            slave, variable = place(name)
            set_ = getattr(override, f"slave_{kinds[name].lower()}_values")
            if not set_(slave, [variable.reference], [INITIAL[kinds[name]](value)]):
                raise RuntimeError(f"it refuses the input {name}")

    def read() -> list[Any]:
        row = []
        for name in case.outputs:
            slave, variable = place(name)
            kind = TYPES[variable.type]
            row += list(getattr(observer, f"last_{kind}_values")(slave, [variable.reference]))
        return [value.decode() if isinstance(value, bytes) else value for value in row]

    series = CosimObserver.create_time_series()
    execution.add_observer(series)
    numbers = {"real": CosimVariableType.REAL, "integer": CosimVariableType.INTEGER}
    for slave, variable in map(place, case.outputs):
        if (kind := TYPES[variable.type]) in numbers:
            series.start_time_series(slave, variable.reference, numbers[kind])

    def first() -> list[Any]:
        """The row of the start, which only this observer has, for numbers; other values do not change at the start."""
        row: list[Any] = []
        for (slave, variable), later in zip(map(place, case.outputs), rows[0][1:], strict=True):
            kind = TYPES[variable.type]
            samples = getattr(series, f"time_series_{kind}_samples", None)
            found = () if samples is None else samples(slave, variable.reference, 0, 2)
            row.append(found[-1][0] if found and found[0][0] == 0 else later)
        return row

    times = case.times()
    rows: list[list[Any]] = []
    for t, end in pairwise(times):
        if inputs is not None and inputs.times:
            apply(inputs.at(t))
        if end - t < 0.5 * case.step:
            break  # it has whole steps only
        if not execution.step(1):
            raise RuntimeError(f"a step at {t} s failed: {execution.status()}")
        rows.append([end, *read()])
        if len(rows) == 1:
            rows.insert(0, [times[0], *first()])
    return rows


if __name__ == "__main__":
    main(run, LACKS, lambda: version("libcosimpy"))
