"""Systems as one FMU in every importer: the values are those of the harness, whatever the importer's step.

The table of docs/any-simulator.md is made of these numbers: run this file to print it.
"""

from __future__ import annotations

import logging
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from install_cofmupy import PYTHON
from interop.importers import ALONE, as_trajectories, in_fmpy, in_worker, loop_job
from interop.loops import Loop, Trajectories, ports, start_value, variables
from test_fmpy import container as fmpy_container
from test_fmu_toolbox import container as toolbox_container
from test_fmu_toolbox import exposed
from thorough import nightly, some

from friction_fmus import fmu
from harness import HarnessError, System

EXAMPLES = Path(__file__).parents[3] / "examples"
EXAMPLE = EXAMPLES / "stick_slip.toml"
STIFFNESS = (1e5, 1e7)
STEPS = (1e-3, 5e-3)
STOP, EVERY = 10.0, 0.1  # s
X = "mass.x"
Importer = Callable[[Loop, float, Path, Sequence[str]], Trajectories]


def stick_slip(sigma0: float) -> System:
    return System.from_toml(EXAMPLE, resolve=fmu).with_start({"friction.sigma0": sigma0})


def in_process(
    worker: str, loop: Loop, step: float, _folder: Path, names: Sequence[str], python: str = sys.executable
) -> Trajectories:
    job = loop_job("x", loop) | {"step": step, "count": round(STOP / step), "every": round(EVERY / step)}
    job["method"] = "gauss_seidel"
    if worker == "in_cofmupy":  # it sets inputs without a value to 0
        fmu_path = loop.fmus[ALONE]
        job["start"] = {f"{ALONE}.{name}": start_value(variables(fmu_path)[name]) for name in ports(fmu_path, "input")}
    answer: Any = in_worker(worker, [job], python)["x"]
    assert not isinstance(answer, str), answer
    found = as_trajectories(job, answer["rows"])
    return {name: found[f"{ALONE}.{name}"] for name in names}


def in_one(path: Path, step: float, folder: Path, columns: Mapping[str, str]) -> Trajectories:
    """An FMU in fmpy; `columns` are its names of the variables."""
    output = [*columns.values()]
    rows = in_fmpy(path, folder, stop_time=STOP, step_size=step, output_interval=EVERY, output=output)
    return {name: rows[column][1:] for name, column in columns.items()}


def simulate_fmu(loop: Loop, step: float, folder: Path, names: Sequence[str]) -> Trajectories:
    return in_one(loop.fmus[ALONE], step, folder / "alone", {name: name for name in names})


def in_fmpy_container(loop: Loop, step: float, folder: Path, names: Sequence[str]) -> Trajectories:
    path = fmpy_container(loop, folder / "container", step)
    return in_one(path, step, folder / "one", {name: f"{ALONE}.{name}" for name in names})


def in_toolbox(loop: Loop, step: float, folder: Path, names: Sequence[str]) -> Trajectories:
    path = toolbox_container(loop, step, folder)
    return in_one(path, step, folder / "two", {name: exposed(f"{ALONE}.{name}") for name in names})


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
@pytest.mark.parametrize("step", some(STEPS, STEPS[:1]))
@pytest.mark.parametrize("sigma0", some(STIFFNESS, STIFFNESS[:1]))
def test_one_fmu_gives_the_values_of_the_harness(
    importer: str,
    step: float,
    sigma0: float,
    runs: Mapping[float, tuple[Path, np.ndarray, np.ndarray]],
    tmp_path: Path,
) -> None:
    path, harness, reference = runs[sigma0]
    found = run_in(importer, path, step, tmp_path, [X])[X]
    assert np.abs(found - harness).max() <= 1e-12 * np.abs(harness).max()
    assert np.abs(found - reference).max() <= 1e-4


def run_in(importer: str, path: Path, step: float, folder: Path, names: Sequence[str]) -> Trajectories:
    if importer == "CoFmuPy" and not PYTHON.exists():
        pytest.skip("CoFmuPy is not installed: run tests/slow/importers/install_cofmupy.py")
    if importer in ("libcosimpy", "ecospy"):
        pytest.importorskip(importer)
    return IMPORTERS[importer](Loop({ALONE: path}, (), {}), step, folder, names)


SYSTEMS = {
    "compensated_axis": ("axis.x", "axis.v", "friction.F"),
    "two_axes": ("x_axis.x", "y_axis.x", "x_friction.F", "y_friction.F"),
}


@pytest.fixture(scope="module", params=SYSTEMS)
def servo(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Trajectories]:
    """An example without inputs as one FMU, and its values in the harness."""
    names, path = SYSTEMS[request.param], tmp_path_factory.mktemp("servo") / f"{request.param}.fmu"
    with System.from_toml(EXAMPLES / f"{request.param}.toml", resolve=fmu) as system:
        assert system.experiment is not None
        system.to_fmu(path, inputs=[], outputs=names)  # CoFmuPy exchanges Reals only
        every = round(EVERY / system.experiment.step)
        result = system.run(stop=STOP, master="newton", record=list(names), decimate=every)
        return path, {name: np.asarray(result[name])[1:] for name in names}


@pytest.mark.parametrize("importer", IMPORTERS)
@pytest.mark.parametrize("step", some(STEPS, STEPS[:1]))
def test_one_and_two_axes_under_control(
    importer: str, step: float, servo: tuple[Path, Trajectories], tmp_path: Path
) -> None:
    path, harness = servo
    found = run_in(importer, path, step, tmp_path, [*harness])
    for name, expected in harness.items():
        assert np.abs(found[name] - expected).max() <= 1e-12 * np.ptp(expected), name


@nightly
@pytest.mark.parametrize("sigma0", STIFFNESS)
def test_the_table_of_the_page_is_measured(
    sigma0: float, runs: Mapping[float, tuple[Path, np.ndarray, np.ndarray]]
) -> None:
    """Two FMUs by the master jacobi, as which libcosim, ecos and the toolbox couple (see their tests); in mm."""
    _, one, reference = runs[sigma0]
    with stick_slip(sigma0) as system:
        two = [np.abs(position(system, step, "jacobi") - reference).max() for step in STEPS]
    measured = [1e3 * error for error in (*two, np.abs(one - reference).max())]
    page = (EXAMPLES.parent / "docs" / "any-simulator.md").read_text(encoding="utf-8")
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
