"""The implicit masters with a mass on every friction model, from rest through break-away."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.blocks.catalogue import catalogue
from harness import FmuPart, Result, System

BuildFmu = Callable[..., Path]
LOADED = ("KarnoppMass", "SwitchMass", "FrenkelKontorova")  # have no velocity input
RIGID = ("Coulomb", "Stiction", "Stribeck", "Tustin", "Karnopp", "DeadZoneTorque")
FRICTION = [block.name for block in catalogue().values() if block.kind == "friction" and block.name not in LOADED]


def pulled(build_fmu: BuildFmu, name: str, stop: float = 1.5, **settings: object) -> Result:
    """A mass of 1 kg, pulled over a contact by a spring of 20 N/m whose end moves at 0.1 m/s."""
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("friction", build_fmu(name))]
    start = {"mass.k": 20.0, "mass.v_support": 0.1, "mass.F_drive": 0.0}
    inputs = {port.name for port in parts[1].inputs}
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    if "F_ext" in inputs:
        wires.append("mass.F_ext -> friction.F_ext")
    with System(parts, wires, start) as system:
        return system.run(stop=stop, record=["mass.x", "mass.v"], **settings)


@pytest.mark.parametrize("name", [name for name in FRICTION if name not in RIGID])
@pytest.mark.parametrize("master", ["newton", "adaptive"])
def test_models_with_a_state_move_as_with_tiny_explicit_steps(build_fmu: BuildFmu, name: str, master: str) -> None:
    """Gauss-Seidel at 20 us is near what all converge to; less so with asperities, whose tips are faster still."""
    # adaptive follows every tip of the asperities
    stop = 0.3 if (name, master) == ("GenericAsperity", "adaptive") else 1.5
    fine = pulled(build_fmu, name, stop=stop, step=2e-5, master="gauss-seidel", decimate=50)
    result = pulled(build_fmu, name, stop=stop, step=1e-3, master=master)
    size = float(np.abs(fine["mass.x"]).max())
    np.testing.assert_allclose(
        result["mass.x"], fine["mass.x"], atol=(2e-2 if name == "GenericAsperity" else 5e-3) * size
    )


@pytest.mark.parametrize("name", RIGID)
@pytest.mark.parametrize("master", ["newton", "adaptive"])
@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_rigid_models_stick_and_break_away(build_fmu: BuildFmu, name: str, master: str, step: float) -> None:
    """At rest up to the static friction, 1 N at least and reached at 0.5 s; then in motion."""
    result = pulled(build_fmu, name, step=step, master=master)
    time = result["time"].values
    assert np.abs(result["mass.x"].values[time < 0.49]).max() < 1e-5
    assert result["mass.x"].values[-1] > 0.01
    assert result["mass.v"].values.max() < 1.0
