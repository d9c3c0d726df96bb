"""FMUs of FMI 3.0 in fmpy: compiled from their sources, and inside a container that is a part of the harness again."""

from __future__ import annotations

import shutil
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmi3.slaves import three
from fmpy.build import build_platform_binary
from fmpy.container_fmu.cli import create_container_fmu
from fmpy.container_fmu.config import Component, Configuration, Connection
from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable, Unknown
from thorough import some

from harness import FmuPart, System

STEP = 1e-3


@pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("cc") is None, reason="builds with cmake and cc")
@pytest.mark.parametrize("name", some(("LuGre", "GMS", "PID", "compensated_axis"), ("PID",)))
def test_fmpy_compiles_a_binary_that_works(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From buildDescription.xml; it computes what our binary does, but for rounding."""
    monkeypatch.delenv("CC", raising=False)
    folder = Path(fmpy.extract(str(three(name)), str(tmp_path / "fmu")))
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    ours, theirs = (fmpy.simulate_fmu(str(path), stop_time=0.1) for path in (three(name), folder))
    for column in ours.dtype.names:
        np.testing.assert_allclose(theirs[column], ours[column], rtol=1e-7, atol=1e-10)


def container(folder: Path) -> Path:
    """A container in FMI 3.0 of a mass on LuGre friction, both in FMI 3.0; the drive force is its input."""
    parts = {
        name: Component(name, path, fmpy.read_model_description(str(path)))
        for name, path in ((name, three(name, full=False)) for name in ("Mass", "LuGre"))
    }
    of = {(n, v.name): v for n, part in parts.items() for v in part.modelDescription.modelVariables}
    model = ModelDescription(
        fmiVersion="3.0",
        modelName="container",
        instantiationToken="{container}",
        coSimulation=CoSimulation(fixedInternalStepSize=STEP, canHandleVariableCommunicationStepSize=True),
        modelVariables=[ModelVariable("time", type="Float64", causality="independent", variability="continuous")],
    )
    inside = {}
    for name, own, causality, more in (
        ("Mass", "F_drive", "input", {"start": "2"}),
        ("Mass", "v", "output", {"initial": "calculated"}),
        ("LuGre", "F", "output", {"initial": "calculated"}),
    ):
        made = ModelVariable(f"{name}.{own}", type="Float64", causality=causality, variability="continuous", **more)
        model.modelVariables.append(made)
        inside[made] = [(parts[name], of[name, own])]
        if causality == "output":
            model.outputs.append(Unknown(variable=made))
            model.initialUnknowns.append(Unknown(variable=made))
    mass, friction = parts.values()
    wires = [
        Connection(mass, [of["Mass", "v"]], friction, [of["LuGre", "v"]]),
        Connection(friction, [of["LuGre", "F"]], mass, [of["Mass", "F_friction"]]),
    ]
    (folder / "inside").mkdir()
    path = folder / "container.fmu"
    create_container_fmu(Configuration(False, model, list(parts.values()), wires, inside), folder / "inside", path)
    return path


def test_a_container_of_fmpy_is_a_part_of_the_harness(tmp_path: Path) -> None:
    """With the values that fmpy gets from it; the momentum of the mass is the integral of the forces."""
    path = container(tmp_path)
    with System([FmuPart("axis", path)], [], {"axis.Mass.F_drive": 2.0}) as system:
        result = system.run(stop=0.5, step=STEP, master="gauss-seidel")
    rows = fmpy.simulate_fmu(str(path), stop_time=0.5, step_size=STEP, output_interval=STEP)
    for name in ("Mass.v", "LuGre.F"):
        assert np.asarray(result[f"axis.{name}"]) == pytest.approx(rows[name], rel=1e-12, abs=1e-15), name
    impulse = np.sum(2.0 - np.asarray(result["axis.LuGre.F"])[:-1]) * STEP
    assert float(result["axis.Mass.v"][-1]) == pytest.approx(impulse, rel=2e-2)  # the mass is 1 kg
