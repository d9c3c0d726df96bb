"""A container of the FMU Manipulation Toolbox, which fmpy runs.

The container of one FMU has its inputs and outputs; that of a system has the connections of the case.
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
from fmu_manipulation_toolbox.assembly import AssemblyNode

LACKS = ("call", "me", "algebraic-loops")


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    logging.getLogger("fmu_manipulation_toolbox").setLevel(logging.ERROR)
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
        node.add_start_value(inside, name, text(value))
    node.make_fmu(folder, fmi_version=3 if case.said["fmi"] == "3.0" else 2)
    return simulated(case, folder / "container.fmu", {name: name for name in case.outputs})


def system(case: AdaptedCase, folder: Path) -> Rows:
    """A container with the components and connections of an SSP; of an SSP itself it exposes connectors only."""
    if not case.said.get("connections"):
        raise UnsupportedError("its containers of an SSP show connectors only")
    node = AssemblyNode("container.fmu", case.step, auto_link=False, auto_input=False, auto_output=False)
    for name, path in case.components().items():
        node.add_fmu(f"{name}.fmu", str(shutil.copyfile(path, folder / f"{name}.fmu")))

    def place(name: str) -> tuple[str, str]:
        part, port = name.split(".", 1)
        return f"{part}.fmu", port

    for connection in case.said["connections"]:
        source, target = connection.split(" -> ")
        node.add_link(*place(source), *place(target))
    for name in case.outputs:
        node.add_output(*place(name), name.replace(".", "_"))
    for name, value in case.values.items():
        node.add_start_value(*place(name), text(value))
    node.make_fmu(folder, fmi_version=3 if case.said["fmi"] == "3.0" else 2)
    return simulated(case, folder / "container.fmu", {name: name.replace(".", "_") for name in case.outputs})


def text(value: Any) -> str:
    """A start value; the elements of an array are separated by blanks."""
    if isinstance(value, list):
        return " ".join(map(text, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


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
