"""Run a case in fmpy or in the harness: ``python -m friction_fmus.reference.tools TOOL CASE OUTPUT``."""

import csv
import math
import sys
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy import simulation
from fmpy.ssp.simulation import simulate_ssp

from friction_fmus.reference.case import INPUTS, ReferenceCase, read_case, run_calls
from friction_fmus.reference.tool_runs import SKIPPED, read_results
from harness import FmuPart, Part, SeriesPart, System, save_result

LACKS = {"fmpy": {"strings"}, "harness": {"call", "strings", "partial-last-step", "discrete-inputs", "fmi3-me"}}


class _FmpyInstance:
    """An instance in fmpy, whose exceptions have the attribute ``status``."""

    def __init__(self, case: ReferenceCase, folder: str, description: Any) -> None:
        self._experiment, self._description = case.experiment, description
        self._variables = {variable.name: variable for variable in description.modelVariables}
        self.fmu = simulation.instantiate_fmu(folder, description, "CoSimulation")
        self.reset, self.terminate = self.fmu.reset, self.fmu.terminate

    def start(self, values: Mapping[str, Any]) -> None:
        times = self._experiment
        self.time = times.start
        setup: dict[str, Any] = {"tolerance": times.tolerance, "startTime": times.start, "stopTime": times.stop}
        if self._description.fmiVersion == "2.0":
            self.fmu.setupExperiment(**setup)
            setup = {}
        apply = partial(simulation.apply_start_values, self.fmu, self._description)
        left = apply(values, simulation.settable_in_instantiated)
        self.fmu.enterInitializationMode(**setup)
        apply(left, simulation.settable_in_initialization_mode)
        self.fmu.exitInitializationMode()

    def set(self, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            self._access("set", name, value if isinstance(value, list) else [value])

    def get(self, names: Sequence[str]) -> list[Any]:
        return [self._access("get", name)[0] for name in names]

    def _access(self, action: str, name: str, *values: Any) -> Any:
        whole = {"Enumeration": "Integer" if self._description.fmiVersion == "2.0" else "Int64"}
        kind = str(self._variables[name].type)
        return getattr(self.fmu, f"{action}{whole.get(kind, kind)}")(self._references([name]), *values)

    def _references(self, names: Sequence[str]) -> list[int]:
        return [self._variables[name].valueReference for name in names]

    def step(self, size: float) -> None:
        self.fmu.doStep(self.time, size)
        self.time += size

    def save(self) -> Any:
        return self.time, self.fmu.getFMUState()

    def restore(self, state: Any) -> None:
        self.fmu.setFMUState(state[1])
        self.time = state[0]

    def serialise(self) -> Any:
        return self.time, self.fmu.serializeFMUState(self.fmu.getFMUState())

    def deserialise(self, state: Any) -> None:
        self.restore((state[0], self.fmu.deserializeFMUState(state[1])))

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> Any:
        return self.fmu.getDirectionalDerivative(self._references(unknowns), self._references(knowns), seed)

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> Any:
        references = self._references(unknowns), self._references(knowns)
        return self.fmu.getAdjointDerivative(*references, seed, nSensitivity=len(knowns))


def run_fmpy(case: ReferenceCase, output: str) -> None:
    """Run a case in fmpy and write its results."""
    times, path = case.experiment, str(case.file)
    if case.call:
        folder, description = fmpy.extract(path), fmpy.read_model_description(path)
        rows: Any = run_calls(case, lambda name: _FmpyInstance(case, folder, description))
    else:
        if case.kind == "ssp":
            found = simulate_ssp(path, times.start, times.stop, times.step)
        else:
            found = fmpy.simulate_fmu(
                path,
                start_time=times.start,
                stop_time=times.stop,
                output_interval=times.step,
                relative_tolerance=times.tolerance,
                start_values={
                    name: np.ravel(v).tolist() if isinstance(v, list) else v for name, v in case.start.items()
                },
                input=np.genfromtxt(case.folder / INPUTS, names=True, delimiter=",") if case.inputs else None,
                output=case.outputs,
                use_event_mode="event-mode" in case.needs,
                early_return_allowed="event-mode" in case.needs,
            )
        rows = zip(*(found[name] for name in ["time", *case.outputs]), strict=True)
    with Path(output).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["time", *case.outputs], *rows])


def run_harness(case: ReferenceCase, output: str) -> None:
    """Run a case in the harness and write its results."""
    settings: dict[str, Any] = {**vars(case.experiment)}
    names = {name if case.kind == "ssp" else f"fmu.{name}": name for name in case.outputs}
    if "algebraic-loops" in case.needs:
        settings["master"] = "newton"
    with System.from_ssp(case.file) if case.kind == "ssp" else _alone(case, settings) as system:
        save_result(system.run(**settings, record=[*names]).rename(names), output)


def _alone(case: ReferenceCase, settings: dict[str, Any]) -> System:
    """Return the FMU with its inputs as a system; in model exchange, take a step that meets their times."""
    fmu = FmuPart("fmu", case.file)
    columns = read_results(case.folder / INPUTS) if case.inputs else {"time": []}
    times = [float(time) for time in columns.pop("time")]
    series = {name: [*dict(zip(times, map(float, column), strict=True)).values()] for name, column in columns.items()}
    between: Any = "linear" if len({*times}) == len(times) else "previous"  # what jumps is constant between its jumps
    parts: list[Part] = [fmu]
    if series:
        parts.append(SeriesPart("inputs", sorted({*times}), series, interpolation=between, beyond="hold"))
    if case.kind == "me":
        meets = [Fraction(str(time - settings["start"])) / Fraction(str(settings["step"])) for time in times]
        settings["step"] /= math.lcm(*(each.denominator for each in meets))
    start = {port.name: port.start for port in fmu.inputs if port.name not in series and port.start is not None}
    for name, value in case.start.items():
        elements = np.ndenumerate(value) if isinstance(value, list) else ()
        many = {f"{name}[{','.join(str(i + 1) for i in place)}]": each.item() for place, each in elements}
        start |= many or {name: value}
    wires = [f"inputs.{name} -> fmu.{name}" for name in series]
    return System(parts, wires, start={f"fmu.{name}": value for name, value in start.items()})


def main(tool: str, folder: str, output: str) -> int:
    """Run the case in a folder in a tool, and write its results."""
    case = read_case(Path(folder))
    if lacks := LACKS[tool].intersection(case.all_needs):
        print(f"{tool} has no {', '.join(lacks)}")
        return SKIPPED
    (run_fmpy if tool == "fmpy" else run_harness)(case, output)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
