"""A composite FMU gives the values of the harness bit for bit where communication points lie on its grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from composite.composite_systems import (
    STEP,
    check_random_system,
    differing,
    random_seed_settings,
    run_composite,
    run_parts,
)
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from shell.selection import COMPOSITES
from thorough import landing, nightly, some

from friction_fmus import build, fmu
from friction_fmus.cli.inputs import open_system
from harness import Experiment, FmuPart, SeriesPart, System, Wire

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", some([*COMPOSITES, "two_axes"], COMPOSITES))
@pytest.mark.parametrize("every", some([1, 4], [4]))
def test_examples_are_equal_to_the_harness(compose: Callable[[str], Path], name: str, every: int) -> None:
    path = compose(name)
    with open_system(EXAMPLES / f"{name}.toml") as system:
        assert system.experiment is not None
        step = system.experiment.step
        expected = run_parts(system, 2.0)
    found = run_composite(path, 2.0, every * step)
    assert set(found) == set(expected)
    assert differing(found, expected, every) == []


@nightly
@pytest.mark.parametrize("name", [*COMPOSITES, "two_axes"])
def test_points_between_grid_points_change_no_value_of_a_loop(tmp_path: Path, name: str) -> None:
    """At the grid points bit for bit the values of the harness, with twice as many communication points."""
    step, stop = 2.0**-11, 2.0
    with open_system(EXAMPLES / f"{name}.toml") as system:
        assert system.experiment is not None
        start = {key: step for key in system.start if key.endswith(".Ts")}
        experiment = replace(system.experiment, stop=stop, step=step)
        changed = System(system.parts.values(), system.wires, system.start | start, experiment)
        changed.to_fmu(tmp_path / "axis.fmu")
        expected = run_parts(changed, stop)
    found = run_composite(tmp_path / "axis.fmu", stop, 0.5 * step)
    assert differing({key: values[::2] for key, values in found.items()}, expected) == []


@nightly
def test_a_system_from_an_ssp_archive(tmp_path: Path) -> None:
    with open_system(EXAMPLES / "stick_slip.toml") as system:
        system.to_ssp(tmp_path / "axis.ssp")
    with open_system(tmp_path / "axis.ssp") as system:
        system.to_fmu(tmp_path / "axis.fmu")
        expected = run_parts(system, 1.0)
    assert differing(run_composite(tmp_path / "axis.fmu", 1.0, 1e-3), expected) == []


def mixed() -> System:
    """Sampled, slow and continuous parts, recorded tables, a delay, a gain, an offset and an algebraic start."""
    times = np.linspace(0.0, 0.2, 6)
    parts = [
        FmuPart("mass", fmu("Mass")),
        FmuPart("friction", fmu("LuGre")),
        FmuPart("control", fmu("PID"), every=4),
        FmuPart("sensor", fmu("Quantiser")),
        SeriesPart("load", times, {"F": np.sin(40.0 * times)}, {"F": "N"}),
        SeriesPart("steps", times, {"r": 1e-4 * np.arange(6)}, {"r": "m"}, interpolation="previous"),
    ]
    wires = [
        "mass.v -> friction.v",
        "friction.F -> mass.F_friction",
        Wire("control.u", "mass.F_drive", gain=0.5, offset=0.1, delay=2, initial=0.3),
        Wire("load.F", "mass.F_load", gain=-0.2, offset=0.05),
        "steps.r -> control.r",
        "mass.x -> sensor.x",
        Wire("sensor.y", "control.x", delay=1),
        "mass.v -> control.v",
    ]
    start = {"control.Ts": 4 * STEP, "control.rd": 0.0, "control.rdd": 0.0, "mass.m": 0.3, "sensor.q": 1e-6}
    return System(parts, wires, start, Experiment(stop=0.2, step=STEP))


@pytest.mark.parametrize("master", some(["newton", "adaptive"], ["newton"]))
def test_tables_delays_gains_and_sample_times(tmp_path: Path, master: str) -> None:
    with mixed() as system:
        system.to_fmu(tmp_path / "mixed.fmu", master=master)
        expected = run_parts(system, 0.2, master)
    assert differing(run_composite(tmp_path / "mixed.fmu", 0.2, STEP), expected) == []
    assert differing(run_composite(tmp_path / "mixed.fmu", 0.2, 5 * STEP), expected, 5) == []


@nightly
def test_connections_convert_units(tmp_path: Path) -> None:
    with ZipFile(fmu("Quantiser")) as given, ZipFile(tmp_path / "InMillimetres.fmu", "w") as changed:
        for member in given.namelist():
            data = given.read(member)
            if member == "modelDescription.xml":
                data = data.replace(b'<Unit name="m">', b'<Unit name="mm">').replace(b'unit="m"', b'unit="mm"')
                data = data.replace(b'<BaseUnit m="1"/>', b'<BaseUnit m="1" factor="0.001"/>')
            changed.writestr(member, data)
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("sensor", tmp_path / "InMillimetres.fmu")]
    start = {"mass.F_drive": 1.0, "sensor.q": 0.01, "mass.F_friction": 0.0}
    with System(parts, ["mass.x -> sensor.x"], start, Experiment(stop=1.0, step=0.1)) as system:
        system.to_fmu(tmp_path / "units.fmu")
        expected = run_parts(system, 1.0)
    assert expected["sensor.y"][-1] == pytest.approx(1000.0 * expected["mass.x"][-1], abs=0.005)
    assert differing(run_composite(tmp_path / "units.fmu", 1.0, 0.1), expected) == []


@landing
def test_composites_can_be_parts(tmp_path: Path) -> None:
    with open_system(EXAMPLES / "stick_slip.toml") as system:
        system.to_fmu(tmp_path / "Contact.fmu", inputs=["mass.F_drive"], outputs=["mass.x", "mass.v"])
    times = np.linspace(0.0, 1.0, 5)
    parts = [
        FmuPart("axis", tmp_path / "Contact.fmu"),
        SeriesPart("pull", times, {"F": 3.0 * np.sin(9.0 * times)}, {"F": "N"}),
    ]
    wires = ["pull.F -> axis.mass.F_drive"]
    with System(parts, wires, experiment=Experiment(stop=1.0, step=1e-3)) as system:
        system.to_fmu(tmp_path / "Outer.fmu")
        expected = run_parts(system, 1.0)
    assert differing(run_composite(tmp_path / "Outer.fmu", 1.0, 1e-3), expected) == []
    assert np.abs(expected["axis.mass.x"]).max() > 0.0


@nightly
@seed(17)
@settings(random_seed_settings(5))
@given(data=st.data())
def test_random_systems(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    check_random_system(tmp_path_factory.getbasetemp(), data)


SPRING = """
#define MODEL   Spring
#define SUMMARY "Spring and damper"
#define SOURCE  "Hooke's law"
#define VARIABLES                                         \\
    INPUT    (x, LENGTH,   0.0,             "position")   \\
    INPUT    (v, VELOCITY, 0.0,             "velocity")   \\
    OUTPUT   (F, FORCE,                     "force")      \\
    PARAMETER(k, STIFFNESS, 400.0, 0.0, INF, "stiffness") \\
    PARAMETER(d, DAMPING,   4.0,   0.0, INF, "damping")
#include "block.h"
static void equations(Model *m)
{
    GIVEN(m)
    m->F = k * x + d * v;
}
"""
LAW = '''
from casadi import SX, if_else
from friction_fmus.lawkit.law import *

@law("Pull", "Constant force after the first sample", source="none", Ts=1e-3, outputs={"u": Output(FORCE, "force")})
def pull(
    x: SX = Input(LENGTH, 0.0, "position"),
    count: SX = State("", 0.0, "samples taken"),
    F: SX = Parameter(FORCE, 8.0, "force"),
) -> dict[str, SX]:
    """A force of 0 at the first sample and F at all others."""
    return {"u": if_else(count > 0, F, 0.0), "count": count + 1}
'''


@nightly
def test_own_blocks_in_c_and_python(tmp_path: Path) -> None:
    """A mass of 1 kg on k = 400 N/m, d = 4 N.s/m under a force step of 8 N at 1 ms: the damped oscillation."""
    (tmp_path / "Spring.c").write_text(SPRING, encoding="utf-8")
    (tmp_path / "pull.py").write_text(LAW, encoding="utf-8")
    own = {name: build(tmp_path / name, tmp_path / "fmus") for name in ("Spring.c", "pull.py")}
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("spring", own["Spring.c"]), FmuPart("pull", own["pull.py"])]
    wires = ["mass.x -> spring.x", "mass.v -> spring.v", "spring.F -> mass.F_friction", "mass.x -> pull.x"]
    with System(parts, [*wires, "pull.u -> mass.F_drive"], experiment=Experiment(stop=1.0, step=1e-3)) as system:
        system.to_fmu(tmp_path / "Axis.fmu")
        expected = run_parts(system, 1.0)
    found = run_composite(tmp_path / "Axis.fmu", 1.0, 1e-3)
    assert differing(found, expected) == []
    t = np.maximum(1e-3 * np.arange(1001) - 1e-3, 0.0)
    decay, w = 2.0, np.sqrt(400.0 - 4.0)
    exact = 8.0 / 400.0 * (1.0 - np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t)))
    assert np.abs(found["mass.x"] - exact).max() < 1e-4 * exact.max()


@nightly
def test_a_reference_can_become_inputs(tmp_path: Path) -> None:
    """One input drives all laws that read the reference; the record plays it back outside the FMU."""
    outputs = ("reference.r", "reference.rd", "reference.rdd")
    with open_system(EXAMPLES / "compensated_axis.toml") as system:
        system.to_fmu(tmp_path / "servo.fmu", inputs=outputs)
        expected = run_parts(system, 0.2)
        steps = 0.5e-3 * np.arange(401)
        columns = {name.replace(".", "_"): expected[name] for name in outputs}
        units = {name.replace(".", "_"): unit for name, unit in zip(outputs, ("m", "m/s", "m/s2"), strict=True)}
    record = SeriesPart("record", steps, columns, units)
    part = FmuPart("servo", tmp_path / "servo.fmu")
    assert [port.name for port in part.inputs] == [*outputs]
    wires = [(f"record.{name.replace('.', '_')}", f"servo.{name}") for name in outputs]
    with System([record, part], wires) as system:
        found = system.run(stop=0.2, step=0.5e-3, order=["servo", "record"])
    for port in part.outputs:
        difference = np.abs(found[f"servo.{port.name}"].to_numpy() * 1.0 - expected[port.name])
        assert difference.max() <= 1e-12 * max(np.abs(expected[port.name] * 1.0).max(), 1e-6), port.name
