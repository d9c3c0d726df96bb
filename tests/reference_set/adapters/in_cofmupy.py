"""CoFMPy, in its own environment (tests/slow/importers/install_cofmupy.py): inputs come from a CSV file, linear."""

from __future__ import annotations

import contextlib
import csv
import io
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

from adapter import AdaptedCase, Rows, UnsupportedError, main
from cofmupy import Coordinator

LACKS = ("call", "me", "ssp")


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    if case.start:
        raise UnsupportedError("its interface has no start time")
    if any(isinstance(value, list) for value in case.values.values()):
        raise UnsupportedError("its interface has no arrays")
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(sys.stderr):
        return list(steps(case, Path(folder)))


def steps(case: AdaptedCase, folder: Path) -> Rows:
    """Steps of one FMU."""
    inputs = case.inputs()
    path = folder / "inputs.csv"
    if inputs.times:
        with path.open("w", newline="", encoding="utf-8") as file:
            names = list(inputs.columns)
            rows = zip(inputs.times, *inputs.columns.values(), strict=True)
            csv.writer(file).writerows([["t", *names], *rows])
    connections = [
        {
            "source": {"type": "csv", "variable": name, "id": "inputs", "unit": "", "path": str(path)}
            | ({"interpolation": "linear"} if name in inputs.lines else {}),
            "target": {"type": "fmu", "id": "fmu", "variable": name, "unit": ""},
        }
        for name in inputs.columns
    ]
    coordinator = Coordinator()
    with contextlib.redirect_stderr(io.StringIO()):
        coordinator.start(
            {
                "fmus": [{"id": "fmu", "path": str(case.file), "name": "fmu", "initialization": case.values}],
                "connections": connections,
                "cosim_method": "gauss_seidel",
                "iterative": False,
            }
        )

    def read() -> list[Any]:
        return [coordinator.get_variable(("fmu", name))[0] for name in case.outputs]

    first, *others = case.times()
    before = first
    yield [first, *read()]
    for t in others:
        coordinator.do_step(t - before)
        before = t
        yield [t, *read()]


if __name__ == "__main__":
    main(run, LACKS, lambda: version("cofmupy"))
