"""A container of the FMU Manipulation Toolbox, which fmpy runs.

The container of one FMU has its inputs and outputs; that of an SSP is made of the SSP.
"""

from __future__ import annotations

import logging
import shutil
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from adapter import AdaptedCase, Rows, UnsupportedError, main
from fmu_manipulation_toolbox.assembly import Assembly, AssemblyNode

LACKS = ("call", "state", "directional", "me", "event-mode", "string-output")


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    logging.getLogger("fmu_manipulation_toolbox").setLevel(logging.ERROR)
    if any(isinstance(value, list) for value in case.values.values()):
        raise UnsupportedError("its interface has no arrays")
    with tempfile.TemporaryDirectory() as folder:
        return list(system(case, Path(folder)) if case.kind == "ssp" else alone(case, Path(folder)))


def alone(case: AdaptedCase, folder: Path) -> Rows:
    """A container of one FMU."""
    inside = f"{case.file.stem}.fmu"
    node = AssemblyNode("container.fmu", case.step, auto_link=False, auto_input=False, auto_output=False)
    node.add_fmu(inside, str(case.file))
    for name in case.inputs().columns:
        node.add_input(name, inside, name)
    for name in case.outputs:
        node.add_output(inside, name, name)
    for name, value in case.values.items():
        node.add_start_value(inside, name, str(value).lower() if isinstance(value, bool) else str(value))
    node.make_fmu(folder, fmi_version=3 if case.said["fmi"] == "3.0" else 2)
    return simulated(case, folder / "container.fmu", {name: name for name in case.outputs})


def system(case: AdaptedCase, folder: Path) -> Rows:
    """A container of an SSP."""
    ssp = folder / case.file.name
    shutil.copyfile(case.file, ssp)
    assembly = Assembly(ssp.name, default_step_size=case.step, fmu_directory=folder, default_auto_local=True)
    if assembly.root is None:
        raise UnsupportedError("it reads no system from this SSP")
    assembly.make_fmu(fmi_version=3 if case.said["fmi"] == "3.0" else 2)
    made = folder / assembly.root.name
    known = {v.name for v in fmpy.read_model_description(str(made)).modelVariables}
    columns = {}
    for name in case.outputs:
        part, _, port = name.rpartition(".")
        names = [each for each in known if each in (name, f"{part}_{port}", port, f"{part}.fmu.{port}")]
        if not names:
            raise UnsupportedError(f"its container of an SSP has no {name}; it has {', '.join(sorted(known))[:200]}")
        columns[name] = names[0]
    return simulated(case, made, columns)


def simulated(case: AdaptedCase, path: Path, columns: dict[str, str]) -> Rows:
    """The rows of fmpy."""
    more: dict[str, Any] = {}
    if case.said.get("inputs"):
        more["input"] = np.genfromtxt(case.folder / "inputs.csv", names=True, delimiter=",")
    rows = fmpy.simulate_fmu(
        str(path),
        start_time=case.start,
        stop_time=case.stop,
        output_interval=case.step,
        output=list(columns.values()),
        **more,
    )
    return zip(rows["time"], *(rows[column] for column in columns.values()), strict=True)


if __name__ == "__main__":
    main(run, LACKS, lambda: version("fmu-manipulation-toolbox"))
