"""ecos, by ecospy."""

from __future__ import annotations

import re
import zipfile
from importlib.metadata import version
from itertools import pairwise
from typing import Any

from adapter import AdaptedCase, Rows, UnsupportedError, main, types
from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure

LACKS = ("call", "me", "partial-last-step", "algebraic-loops", "enumerations", "discrete-inputs")
GETTERS = {"Real": "real", "Integer": "integer", "Boolean": "bool", "String": "string"}


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    EcosLib.set_log_level("warn")
    if case.start != round(case.start):
        raise UnsupportedError("its start time is a whole number")
    if case.kind == "ssp":
        with EcosSimulation(case.step, ssp_path=str(case.file)) as simulation:
            return steps(case, simulation, parameter_set(case))
    with EcosSimulationStructure() as structure:
        structure.add_model("fmu", str(case.file))
        enumerations = case.enumerations().intersection({*case.values, *case.outputs})
        if enumerations:
            raise UnsupportedError(f"it does not know {', '.join(enumerations)}, an enumeration")
        first = {**case.inputs().at(case.start), **case.values}
        values = {f"fmu::{name}": plain(value) for name, value in first.items()}
        structure.add_parameter_set("start", values)
        with EcosSimulation(case.step, structure=structure) as simulation:
            return steps(case, simulation, "start" if values else "")


def parameter_set(case: AdaptedCase) -> str:
    """The name of the first parameter set, which it asks for."""
    with zipfile.ZipFile(case.file) as archive:
        text = archive.read("SystemStructure.ssd").decode()
        text += "".join(archive.read(name).decode() for name in archive.namelist() if name.endswith(".ssv"))
    names = re.findall(r'<ssv:ParameterSet [^>]*name="([^"]*)"', text)
    return names[0] if names else ""


def plain(value: Any) -> Any:
    """A value that it can set."""
    if isinstance(value, list):
        raise UnsupportedError("its interface has no arrays")
    return value


def steps(case: AdaptedCase, simulation: EcosSimulation, parameters: str) -> Rows:
    """Steps of one FMU or of a system."""
    simulation.init(int(case.start), *([parameters] if parameters else []))
    inputs = case.inputs() if case.kind != "ssp" else None
    alone = case.kind != "ssp"
    kinds = case.types() if alone else {}

    def name(output: str) -> str:
        return f"fmu::{output}" if alone else "::".join(output.rsplit(".", 1))

    def read() -> list[Any]:
        return [getattr(simulation, f"get_{GETTERS[kind(each)]}")(name(each)) for each in case.outputs]

    def kind(output: str) -> str:
        if alone:
            return kinds[output]
        component = output.rsplit(".", 2)[-2]
        fmu = case.folder / f"{component}.fmu"
        return types(fmu).get(output.rsplit(".", 1)[-1], "Real") if fmu.is_file() else "Real"

    times = case.times()
    rows = []
    for t, end in pairwise(times):
        for each, value in (inputs.at(t) if inputs is not None else {}).items():
            set_ = getattr(simulation, f"set_{GETTERS[kinds[each]]}")
            set_(f"fmu::{each}", int(value) if kinds[each] == "Integer" else value)
        if t == times[0]:
            rows.append([t, *read()])
        if end - t < 0.5 * case.step:
            break  # it has whole steps only
        simulation.step(1)
        rows.append([end, *read()])
    simulation.terminate()
    return rows


if __name__ == "__main__":
    main(run, LACKS, lambda: version("ecospy"))
