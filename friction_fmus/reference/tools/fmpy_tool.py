"""Run a case in fmpy."""

import csv
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.simulation import (
    apply_start_values,
    instantiate_fmu,
    settable_in_initialization_mode,
    settable_in_instantiated,
)
from fmpy.ssp.simulation import simulate_ssp

from friction_fmus.reference.calls import CallRefusedError, run_calls
from friction_fmus.reference.case import ReferenceCase, read_case
from friction_fmus.reference.tool_runs import SKIPPED

LACKS = {"string-output"}


class FmpyInstance:
    """An instance in fmpy; its methods are those of `CalledInstance`."""

    def __init__(self, case: ReferenceCase, folder: str, description: Any) -> None:
        self._case, self._description = case, description
        self._three = description.fmiVersion.startswith("3")
        self._variables = {variable.name: variable for variable in description.modelVariables}
        self._fmu = instantiate_fmu(folder, description, "CoSimulation")
        self.time = case.experiment.start

    def _checked(self, function: Any, *arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except FMICallException as error:
            raise CallRefusedError(error.status) from error

    def start(self, values: Mapping[str, Any]) -> None:
        """Set start values and initialise."""
        times = self._case.experiment
        self.time = times.start
        setup: dict[str, Any] = {"tolerance": times.tolerance, "startTime": times.start, "stopTime": times.stop}
        if not self._three:
            self._checked(self._fmu.setupExperiment, **setup)
            setup = {}
        left = self._checked(apply_start_values, self._fmu, self._description, values, settable_in_instantiated)
        self._checked(self._fmu.enterInitializationMode, **setup)
        self._checked(apply_start_values, self._fmu, self._description, left, settable_in_initialization_mode)
        self._checked(self._fmu.exitInitializationMode)

    def set(self, values: Mapping[str, Any]) -> None:
        """Set variables."""
        for name, value in values.items():
            given = value if isinstance(value, list) else [value]
            self._checked(getattr(self._fmu, f"set{self._type(name)}"), [self._variables[name].valueReference], given)

    def get(self, names: Sequence[str]) -> list[Any]:
        """Return the values of variables."""
        return [
            self._checked(getattr(self._fmu, f"get{self._type(name)}"), [self._variables[name].valueReference])[0]
            for name in names
        ]

    def _type(self, name: str) -> str:
        kind = str(self._variables[name].type)
        return ("Int64" if self._three else "Integer") if kind == "Enumeration" else kind

    def step(self, size: float) -> None:
        """Make a communication step."""
        self._checked(self._fmu.doStep, self.time, size)
        self.time += size

    def save(self) -> Any:
        """Return a copy of the state."""
        return self.time, self._checked(self._fmu.getFMUState if self._three else self._fmu.getFMUstate)

    def restore(self, state: Any) -> None:
        """Return to a state."""
        self._checked(self._fmu.setFMUState if self._three else self._fmu.setFMUstate, state[1])
        self.time = state[0]

    def serialise(self, state: Any) -> Any:
        """Return a state as bytes, with its time."""
        return state[0], self._checked(
            self._fmu.serializeFMUState if self._three else self._fmu.serializeFMUstate, state[1]
        )

    def deserialise(self, data: Any) -> Any:
        """Return a state of bytes."""
        return data[0], self._checked(
            self._fmu.deserializeFMUState if self._three else self._fmu.deSerializeFMUstate, data[1]
        )

    def derivative(
        self, kind: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> list[float]:
        """Return directional or adjoint derivatives."""
        function = self._fmu.getDirectionalDerivative if kind == "directional" else self._fmu.getAdjointDerivative
        references = [[self._variables[name].valueReference for name in names] for names in (unknowns, knowns)]
        count = {} if kind == "directional" else {"nSensitivity": len(knowns)}
        return list(self._checked(function, *references, seed, **count))

    def reset(self) -> None:
        """Return to the state after the instantiation."""
        self._checked(self._fmu.reset)

    def terminate(self) -> None:
        """End the run."""
        self._checked(self._fmu.terminate)


def run(case: ReferenceCase) -> Any:
    """Return the rows of the results."""
    times = case.experiment
    if case.call:
        description = fmpy.read_model_description(str(case.file))
        folder = fmpy.extract(str(case.file))
        return run_calls(case, lambda name: FmpyInstance(case, folder, description))
    if case.kind == "ssp":
        found = simulate_ssp(str(case.file), times.start, times.stop, times.step)
    else:
        found = fmpy.simulate_fmu(
            str(case.file),
            start_time=times.start,
            stop_time=times.stop,
            output_interval=times.step,
            relative_tolerance=times.tolerance,
            fmi_type={"cs": "CoSimulation", "me": "ModelExchange"}[case.kind],
            start_values=case.start,
            input=np.genfromtxt(case.folder / "inputs.csv", names=True, delimiter=",") if case.inputs else None,
            output=case.outputs,
            **({"use_event_mode": True, "early_return_allowed": True} if "event-mode" in case.needs else {}),
        )
    return zip(*(found[name] for name in ["time", *case.outputs]), strict=True)


def main(folder: str, output: str) -> int:
    """Run the case in a folder, and write its results."""
    case = read_case(Path(folder))
    lacks = sorted(case.all_needs & LACKS)
    if lacks:
        print(f"fmpy {fmpy.__version__} has no {', '.join(lacks)}")
        return SKIPPED
    rows = run(case)
    with Path(output).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["time", *case.outputs], *rows])
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
