"""The harness on the project's own FMUs: order, units and values that are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harness import FmuPart, PartError, System, UnitError
from harness.system.graph import stepping_order

BuildFmu = Callable[..., Path]

UNLOADED = {"mass.F_drive": 0.0, "mass.F_load": 0.0, "mass.F_friction": 0.0, "mass.v_support": 0.0}
LUGRE_1995 = {
    "fric.sigma0": 1e5,
    "fric.sigma1": np.sqrt(1e5),
    "fric.sigma2": 0.4,
    "fric.Fc": 1.0,
    "fric.Fs": 1.5,
    "fric.vs": 1e-3,
}
LOOP = ["mass.v -> fric.v", "fric.F -> mass.F_friction"]


def without(start: dict[str, float], *names: str) -> dict[str, float]:
    return {name: value for name, value in start.items() if name not in names}


@pytest.mark.parametrize("master", ["jacobi", "gauss-seidel"])
def test_mass_under_a_constant_force(build_fmu: BuildFmu, master: str) -> None:
    with System([FmuPart("mass", build_fmu("Mass"))], start=UNLOADED | {"mass.m": 2.0, "mass.F_drive": 3.0}) as system:
        result = system.run(stop=1.0, step=0.01, master=master)
    t = result["time"].to_numpy()
    np.testing.assert_allclose(result["mass.x"], 0.5 * 1.5 * t**2, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(result["mass.v"], 1.5 * t, rtol=1e-9, atol=1e-15)
    assert result["mass.x"].attrs["units"] == "m"


def test_mass_on_a_spring(build_fmu: BuildFmu) -> None:
    start = UNLOADED | {"mass.m": 0.5, "mass.k": 8.0, "mass.d": 0.0, "mass.x0": 0.1, "mass.v0": 0.0}
    with System([FmuPart("mass", build_fmu("Mass"))], start=start) as system:
        result = system.run(stop=3.0, step=0.01)
    t = result["time"].to_numpy()
    np.testing.assert_allclose(result["mass.x"], 0.1 * np.cos(4.0 * t), atol=1e-9)
    np.testing.assert_allclose(result["mass.v"], -0.4 * np.sin(4.0 * t), atol=4e-9)


def test_lugre_slides_on_its_steady_state_curve(build_fmu: BuildFmu) -> None:
    v = 2e-3
    with System([FmuPart("fric", build_fmu("LuGre"))], start=LUGRE_1995 | {"fric.v": v}) as system:
        result = system.run(stop=1.0, step=1e-3, record=["fric.F", "fric.z"])
    g = 1.0 + 0.5 * np.exp(-((v / 1e-3) ** 2))
    np.testing.assert_allclose(float(result["fric.F"][-1]), g + 0.4 * v, rtol=1e-9)
    np.testing.assert_allclose(float(result["fric.z"][-1]), g / 1e5, rtol=1e-9)


def test_mass_held_by_the_bristles(build_fmu: BuildFmu) -> None:
    parts = [FmuPart("fric", build_fmu("LuGre")), FmuPart("mass", build_fmu("Mass"))]
    start = without(UNLOADED, "mass.F_friction") | LUGRE_1995 | {"mass.m": 1.0, "mass.F_drive": 0.1}
    with System(parts, LOOP, start) as system:
        assert stepping_order(system.parts, system.wires) == ["mass", "fric"]
        result = system.run(stop=1.0, step=1e-3, record=["*", "fric.z"])
    np.testing.assert_allclose(float(result["fric.F"][-1]), 0.1, rtol=1e-6)
    np.testing.assert_allclose(float(result["fric.z"][-1]), 0.1 / 1e5, rtol=1e-6)
    assert abs(float(result["mass.v"][-1])) < 1e-9


@pytest.mark.parametrize(("master", "limit"), [("jacobi", 1.58e-3), ("gauss-seidel", 3.91e-3)])
def test_stability_limit_of_mass_and_bristles(build_fmu: BuildFmu, master: str, limit: float) -> None:
    """The limits that test_harness_masters finds with Python parts; so small a force keeps the bristles linear."""
    parts = [FmuPart("fric", build_fmu("LuGre")), FmuPart("mass", build_fmu("Mass"))]
    start = without(UNLOADED, "mass.F_friction") | LUGRE_1995 | {"mass.m": 1.0, "mass.F_drive": 1e-12}
    growth = []
    with System(parts, LOOP, start) as system:
        for step in (0.98 * limit, 1.02 * limit):
            result = system.run(stop=200 * step, step=step, master=master, record=["mass.v"])
            v = np.abs(result["mass.v"].to_numpy())
            growth.append(v[150:200].max() / v[50:100].max())
    assert growth[0] < 0.5
    assert growth[1] > 2.0


def test_stribeck_sticks_below_its_break_away_force(build_fmu: BuildFmu) -> None:
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("fric", build_fmu("Stribeck"))]
    start = without(UNLOADED, "mass.F_friction") | {"fric.Fc": 1.0, "fric.Fs": 1.5, "mass.F_drive": 1.4}
    with System(parts, [*LOOP, "mass.F_ext -> fric.F_ext"], start) as system:
        result = system.run(stop=0.5, step=1e-3)
    np.testing.assert_allclose(result["mass.x"], 0.0, atol=1e-15)
    np.testing.assert_allclose(result["fric.F"][1:], 1.4, rtol=1e-12)


def test_units_of_the_blocks_are_checked(build_fmu: BuildFmu) -> None:
    parts = [FmuPart("mass", build_fmu("Mass")), FmuPart("fric", build_fmu("LuGre"))]
    start = without(UNLOADED, "mass.F_friction")
    with pytest.raises(UnitError, match=r"mass\.x is in m .* fric\.v is in m/s"):
        System(parts, ["mass.x -> fric.v", "fric.F -> mass.F_friction"], start)


def test_discarded_input_ends_the_run_with_the_reason(build_fmu: BuildFmu) -> None:
    with (
        System([FmuPart("fric", build_fmu("LuGre"))], start={"fric.v": np.nan}) as system,
        pytest.raises(Exception) as caught,
    ):
        system.run(stop=1.0, step=0.1)
    assert isinstance(caught.value, PartError) or "rejected the start value" in str(caught.value)


def test_state_of_a_block_is_saved_and_restored(build_fmu: BuildFmu) -> None:
    part = FmuPart("fric", build_fmu("LuGre"))
    part.enter_initialisation(0.0, 1.0, None, {"v": 1e-3})
    u, y = np.array([1e-3]), np.zeros(1)
    calls = part.bind(["v"], ["F"], u, y)
    part.exit_initialisation()
    for k in range(5):
        calls.set()
        calls.step(k * 1e-3, 1e-3)
    state = part.save()
    forces = []
    for _ in range(2):
        part.restore(state)
        for k in range(5, 10):
            calls.set()
            calls.step(k * 1e-3, 1e-3)
        calls.get()
        forces.append(y[0])
    part.close()
    assert forces[0] == forces[1] != 0.0
