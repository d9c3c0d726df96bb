"""Run a case in the harness."""

import sys
from pathlib import Path
from typing import Any

from friction_fmus.reference.case import ReferenceCase, read_case
from friction_fmus.reference.tool_runs import SKIPPED
from harness import FmuPart, Part, Result, SeriesPart, System, save_result

LACKS = {"me", "call", "string-output"}


def run(case: ReferenceCase) -> Result:
    """Return the results."""
    times = case.experiment
    settings: dict[str, Any] = {
        "start": times.start,
        "stop": times.stop,
        "step": times.step,
        "tolerance": times.tolerance,
    }
    if case.kind == "ssp":
        with System.from_ssp(case.file) as system:
            return system.run(**settings)
    fmu = FmuPart("fmu", case.file)
    parts: list[Part] = [fmu]
    given: set[str] = set()
    if case.inputs:
        parts.append(SeriesPart.from_csv("inputs", case.folder / "inputs.csv", beyond="hold"))
        given = {port.name for port in parts[1].outputs}
    wires = [f"inputs.{name} -> fmu.{name}" for name in sorted(given)]
    start = {port.name: port.start for port in fmu.inputs if port.name not in given and port.start is not None}
    start = {f"fmu.{name}": value for name, value in {**start, **case.start}.items()}
    with System(parts, wires, start=start) as system:
        result = system.run(**settings)
        return result.rename({f"fmu.{name}": name for name in case.outputs})


def main(folder: str, output: str) -> int:
    """Run the case in a folder, and write its results."""
    case = read_case(Path(folder))
    lacks = sorted(case.all_needs & LACKS)
    if lacks:
        print(f"the harness has no {', '.join(lacks)}")
        return SKIPPED
    save_result(run(case), output)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
