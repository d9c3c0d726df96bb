"""Every FMU in a container of the FMU Manipulation Toolbox, which fmpy runs; it couples as the master jacobi does."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from interop.importers import SMALL, default_experiment, deviation, in_fmpy, without_start
from interop.loops import EVERY, STEP, STOP, Loop, Trajectories, beside_each_other, of_loop

from harness import FmuPart, System

assembly = pytest.importorskip("fmu_manipulation_toolbox.assembly")


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    """It warns of every input that keeps its start value."""
    caplog.set_level(logging.ERROR, "fmu_manipulation_toolbox")


def exposed(name: str) -> str:
    """``part.port`` is the name that the toolbox gives to what it wires."""
    return name.replace(".", "_")


def container(loop: Loop, step: float, folder: Path, fmi: int = 2) -> Path:
    """A container of a loop with all its outputs."""
    node = assembly.AssemblyNode("container.fmu", step, auto_link=False, auto_input=False, auto_output=False)

    def place(name: str) -> tuple[str, str]:
        part, port = name.split(".", 1)
        return f"{part}.fmu", port

    for part, fmu in loop.fmus.items():
        node.add_fmu(f"{part}.fmu", str(fmu))
    for source, target in loop.wires:
        node.add_link(*place(source), *place(target))
    for name in loop.outputs():
        node.add_output(*place(name), exposed(name))
    for name, value in loop.start.items():
        node.add_start_value(*place(name), str(value).lower())
    node.make_fmu(folder, fmi_version=fmi)
    return folder / node.name


def simulate(loop: Loop, stop: float, step: float, interval: float, folder: Path) -> Trajectories:
    rows = in_fmpy(
        container(loop, step, folder),
        folder / "unpacked",
        stop_time=stop,
        step_size=step,
        output_interval=interval,
        output=[exposed(name) for name in loop.outputs()],
    )
    assert rows["time"][-1] == pytest.approx(stop)
    return {name: rows[exposed(name)] for name in loop.outputs()}


def test_every_fmu_simulates_its_default_experiment(fmus: Mapping[str, Path], tmp_path: Path) -> None:
    everything = Loop(fmus, (), {})
    found = simulate(everything, 1.0, 1e-3, 1.0, tmp_path)
    for block, fmu in fmus.items():
        for name, (value,) in default_experiment(fmu).items():
            last = found[f"{block}.{name.split('.', 1)[1]}"][-1]
            assert last == pytest.approx(value, rel=1e-9, abs=1e-9 * SMALL), (block, name)


def test_every_fmu_in_a_closed_loop_gives_the_trajectory_of_jacobi(loops: Mapping[str, Loop], tmp_path: Path) -> None:
    found = simulate(beside_each_other(loops), STOP, STEP, EVERY * STEP, tmp_path)
    errors = {
        block: deviation(without_start(of_loop(block, found)), without_start(x.jacobi), x.outputs())
        for block, x in loops.items()
    }
    assert {block: error for block, error in errors.items() if not error < 1e-8} == {}


def test_a_container_in_fmi_3_is_a_part_of_the_harness(loops: Mapping[str, Loop], tmp_path: Path) -> None:
    """With the values of the container in FMI 2.0."""
    found = {}
    for fmi in (2, 3):
        folder = tmp_path / str(fmi)
        folder.mkdir()
        loop = loops["LuGre"]
        with System([FmuPart("axis", container(loop, STEP, folder, fmi))], [], {}) as system:
            result = system.run(stop=0.5, step=1e-3)
        found[fmi] = {name: np.asarray(result[f"axis.{exposed(name)}"]) for name in loop.outputs()}
    for name, values in found[2].items():
        assert found[3][name] == pytest.approx(values, rel=1e-12, abs=1e-15), name
    assert max(np.ptp(values) for values in found[3].values()) > 0.0
