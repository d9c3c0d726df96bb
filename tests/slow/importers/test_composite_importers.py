"""Stick-slip as one FMU in every importer: the values are those of the harness, whatever the importer's step.

The table of docs/any-simulator.md is made of these numbers: run this file to print it.
"""

from __future__ import annotations

import logging
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from install_cofmupy import PYTHON
from interop.importers import ALONE, as_trajectories, in_fmpy, in_worker, loop_job
from interop.loops import Loop, Trajectories, ports
from test_fmpy import container as fmpy_container
from test_fmu_toolbox import container as toolbox_container
from test_fmu_toolbox import exposed

from friction_fmus import fmu
from harness import HarnessError, System

EXAMPLE = Path(__file__).parents[3] / "examples" / "stick_slip.toml"
STIFFNESS = (1e5, 1e7)
STEPS = (1e-3, 5e-3)
STOP, EVERY = 10.0, 0.1  # s
X = f"{ALONE}.mass.x"
Importer = Callable[[Loop, float, Path], Trajectories]


def stick_slip(sigma0: float) -> System:
    return System.from_toml(EXAMPLE, resolve=fmu).with_start({"friction.sigma0": sigma0})


def in_process(worker: str, loop: Loop, step: float, _folder: Path, python: str = sys.executable) -> Trajectories:
    job = loop_job("x", loop) | {"step": step, "count": round(STOP / step), "every": round(EVERY / step)}
    job["method"] = "gauss_seidel"
    if worker == "in_cofmupy":  # it sets inputs without a value to 0
        fmu_path = loop.fmus[ALONE]
        job["start"] = {f"{ALONE}.{name}": start_of(fmu_path, name) for name in ports(fmu_path, "input")}
    answer: Any = in_worker(worker, [job], python)["x"]
    assert not isinstance(answer, str), answer
    return as_trajectories(job, answer["rows"])


def start_of(path: Path, name: str) -> float:
    (variable,) = (v for v in fmpy.read_model_description(str(path)).modelVariables if v.name == name)
    return float(variable.start)


def simulate_fmu(loop: Loop, step: float, folder: Path) -> Trajectories:
    rows = in_fmpy(
        loop.fmus[ALONE], folder / "alone", stop_time=STOP, step_size=step, output_interval=EVERY, output=["mass.x"]
    )
    return {X: rows["mass.x"][1:]}


def in_fmpy_container(loop: Loop, step: float, folder: Path) -> Trajectories:
    path = fmpy_container(loop, folder / "container", step)
    rows = in_fmpy(path, folder / "one", stop_time=STOP, step_size=step, output_interval=EVERY, output=[X])
    return {X: rows[X][1:]}


def in_toolbox(loop: Loop, step: float, folder: Path) -> Trajectories:
    path = toolbox_container(loop, step, folder)
    rows = in_fmpy(path, folder / "two", stop_time=STOP, step_size=step, output_interval=EVERY, output=[exposed(X)])
    return {X: rows[exposed(X)][1:]}


IMPORTERS: Mapping[str, Importer] = {
    "fmpy": simulate_fmu,
    "fmpy's container": in_fmpy_container,
    "libcosimpy": partial(in_process, "in_libcosim"),
    "ecospy": partial(in_process, "in_ecos"),
    "fmu-manipulation-toolbox": in_toolbox,
    "CoFmuPy": partial(in_process, "in_cofmupy", python=str(PYTHON)),
}


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.ERROR, "fmu_manipulation_toolbox")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Mapping[float, tuple[Path, np.ndarray, np.ndarray]]:
    """For each stiffness: the composite FMU, x in the harness with the same step, and x with a hundredth of it."""
    return dict(prepared(tmp_path_factory.mktemp("stick_slip")))


def prepared(folder: Path) -> Iterator[tuple[float, tuple[Path, np.ndarray, np.ndarray]]]:
    for sigma0 in STIFFNESS:
        path = folder / f"stick_slip_{sigma0:.0e}.fmu".replace("+", "")
        with stick_slip(sigma0) as system:
            system.to_fmu(path)
            yield sigma0, (path, position(system, 1e-3, "newton"), position(system, 1e-5, "newton"))


def position(system: System, step: float, master: str) -> np.ndarray:
    result = system.run(stop=STOP, step=step, master=master, record=["mass.x"], decimate=round(EVERY / step))
    return np.asarray(result["mass.x"])[1:]


@pytest.mark.parametrize("importer", IMPORTERS)
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("sigma0", STIFFNESS)
def test_one_fmu_gives_the_values_of_the_harness(
    importer: str,
    step: float,
    sigma0: float,
    runs: Mapping[float, tuple[Path, np.ndarray, np.ndarray]],
    tmp_path: Path,
) -> None:
    if importer == "CoFmuPy" and not PYTHON.exists():
        pytest.skip("CoFmuPy is not installed: run tests/slow/importers/install_cofmupy.py")
    if importer in ("libcosimpy", "ecospy"):
        pytest.importorskip(importer)
    path, harness, reference = runs[sigma0]
    found = IMPORTERS[importer](Loop({ALONE: path}, (), {}), step, tmp_path)[X]
    assert np.abs(found - harness).max() <= 1e-12 * np.abs(harness).max()
    assert np.abs(found - reference).max() <= 1e-4


@pytest.mark.parametrize("sigma0", STIFFNESS)
def test_the_table_of_the_page_is_measured(
    sigma0: float, runs: Mapping[float, tuple[Path, np.ndarray, np.ndarray]]
) -> None:
    """Two FMUs by the master jacobi, as which libcosim, ecos and the toolbox couple (see their tests); in mm."""
    _, one, reference = runs[sigma0]
    with stick_slip(sigma0) as system:
        two = [np.abs(position(system, step, "jacobi") - reference).max() for step in STEPS]
    measured = [1e3 * error for error in (*two, np.abs(one - reference).max())]
    page = (EXAMPLE.parents[1] / "docs" / "any-simulator.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| 1e{round(np.log10(sigma0))} N/m \| (.*) \|$", page, re.M)
    assert [float(cell.removesuffix(" mm")) for cell in row.split(" | ")] == pytest.approx(measured, rel=0.05)


def table() -> None:
    """Print the table of the page."""
    with tempfile.TemporaryDirectory() as folder:
        for sigma0, (_, one, reference) in prepared(Path(folder)):
            errors = {"one FMU": f"{np.abs(one - reference).max():.1e}"}
            with stick_slip(sigma0) as system:
                for master in ("jacobi", "gauss-seidel"):
                    for step in STEPS:
                        try:
                            error = np.abs(position(system, step, master) - reference).max()
                            errors[f"{master} {step:g}"] = f"{error:.1e}"
                        except HarnessError as failure:
                            errors[f"{master} {step:g}"] = str(failure)[:60]
            print(sigma0, errors)


if __name__ == "__main__":
    table()
