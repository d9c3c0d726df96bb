"""A whole system in model exchange: sampled laws and records at time events, and what is for co-simulation only."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from lxml import etree
from shell.facade import IN_3, in_either
from shell.instance import MODEL_EXCHANGE, Instance, load
from thorough import nightly, some

from friction_fmus import fmu
from friction_fmus.cli.inputs import open_system
from harness import FmuPart, SeriesPart, System, Wire

EXAMPLES = Path(__file__).parents[2] / "examples"
STOP = 0.5


def exchanged(path: Path, stop: float, interval: float) -> np.ndarray:
    """By fmpy's CVODE; a row before and a row after each event."""
    return simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=stop,
        relative_tolerance=1e-9,
        output_interval=interval,
    )


@nightly
@pytest.mark.parametrize(
    ("system", "scale"),
    [("compensated_axis", {"axis.x": 5e-5, "friction.F": 1.5}), ("two_axes", {"x_axis.x": 5e-3, "y_friction.F": 3.0})],
)
def test_a_servo_is_what_it_is_in_co_simulation(system: str, scale: dict[str, float], tmp_path: Path) -> None:
    """Two independent computations: CVODE, and the engine of the harness with an inner step of 0.01 ms."""
    path = tmp_path / "Servo.fmu"
    with open_system(EXAMPLES / f"{system}.toml") as opened:
        opened.to_fmu(path, step=1e-5)
    slow = simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=STOP, output_interval=0.005)
    fast = exchanged(path, STOP, 0.005)
    after = np.searchsorted(fast["time"], slow["time"] + 1e-9) - 1
    for name, size in scale.items():
        assert fast[name][after] == pytest.approx(slow[name], abs=1e-5 * size), name


@nightly
@pytest.mark.parametrize("interpolation", some(["linear", "previous"], ["linear"]))
def test_a_record_has_an_event_at_each_sample(interpolation: str, tmp_path: Path) -> None:
    times, forces = np.array([0.0, 0.1, 0.25, 0.6, 1.0]), np.array([0.3, -0.2, 1.1, 0.4, -0.5])
    record = SeriesPart("record", times, {"F": forces}, {"F": "N"}, interpolation=interpolation)  # type: ignore[arg-type]
    mass = FmuPart("mass", fmu("Mass"))
    with System([mass, record], ["record.F -> mass.F_drive"], start={"mass.F_friction": 0.0}) as system:
        system.to_fmu(tmp_path / "Pulled.fmu", step=1e-3)
    found = exchanged(tmp_path / "Pulled.fmu", 0.99, 0.01)
    twice = found["time"][1:][np.diff(found["time"]) == 0.0]
    assert set(twice) >= set(times[1:-1])
    t = found["time"]
    if interpolation == "linear":
        assert found["record.F"] == pytest.approx(np.interp(t, times, forces), abs=1e-14)
    else:
        rows = np.searchsorted(times, t, side="right") - 1
        before = np.append(np.diff(t) == 0.0, False)  # the row before an event still has the sample before
        assert found["record.F"] == pytest.approx(forces[rows - before], abs=0.0)
        impulse = np.append(0.0, np.cumsum(np.diff(times) * forces[:-1]))
        assert found["mass.v"] == pytest.approx(np.interp(t, times, impulse), abs=1e-9)


@nightly
@pytest.mark.parametrize("version", [2, 3])
def test_states_that_an_event_of_a_part_changes_are_marked(version: Literal[2, 3], tmp_path: Path) -> None:
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu("Leuven"))]
    wires = ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    with System(parts, wires, start={"mass.F_drive": 0.0}) as system:
        system.to_fmu(tmp_path / "Pulled.fmu", step=1e-3, fmi=version)
    with zipfile.ZipFile(tmp_path / "Pulled.fmu") as archive:
        root = etree.fromstring(archive.read("modelDescription.xml"))
    (marked,) = root.iterfind(".//*[@reinit]")
    assert (marked.getparent() if version == 2 else marked).get("name") == "friction.z"


def test_an_event_of_a_part_that_changes_nominal_values_is_told(tmp_path: Path) -> None:
    """Also if another one follows that does not. No block has such events: the source of one is changed."""
    last = b"info->valuesOfContinuousStatesChanged ="
    scaled = b"info->nominalsOfContinuousStatesChanged = info->newDiscreteStatesNeeded"
    twice = b"static int first = 1;\n    " + scaled + b" = first;\n    first = 0;\n    "
    with zipfile.ZipFile(fmu("Dahl")) as archive, zipfile.ZipFile(tmp_path / "Scaled.fmu", "w") as written:
        for name in archive.namelist():
            data = archive.read(name)
            if name == "sources/fmi2_exchange.h":
                data = data.replace(last, twice + last)
            written.writestr(name, data)
    with System([FmuPart("friction", tmp_path / "Scaled.fmu")], start={"friction.v": 1e-3}) as system:
        system.to_fmu(tmp_path / "One.fmu", step=1e-3)
    with Instance(load(tmp_path / "One.fmu"), kind=MODEL_EXCHANGE) as run:
        run.initialise()
        event = run.event()
        assert (event.again, event.nominals_changed, event.states_changed) == (0, 1, 0)


@nightly
def test_the_end_of_a_record_ends_the_simulation(tmp_path: Path) -> None:
    record = SeriesPart("record", [0.0, 0.5], {"F": [1.0, 1.0]}, {"F": "N"})
    mass = FmuPart("mass", fmu("Mass"))
    with System([mass, record], ["record.F -> mass.F_drive"], start={"mass.F_friction": 0.0}) as system:
        system.to_fmu(tmp_path / "Pulled.fmu", step=1e-3)
    found = exchanged(tmp_path / "Pulled.fmu", 2.0, 0.1)
    assert found["time"][-1] == 0.5
    assert found["mass.v"][-1] == pytest.approx(0.5, abs=1e-9)


@nightly
@pytest.mark.parametrize(
    ("friction", "every", "wire"),
    [
        ("BurridgeKnopoff", 1, "mass.v -> friction.v"),
        ("LuGre", 3, "mass.v -> friction.v"),
        ("LuGre", 1, Wire("mass.v", "friction.v", delay=2)),
    ],
    ids=["a part that is", "a part with a step of its own", "a delay"],
)
def test_for_co_simulation_only(friction: str, every: int, wire: str | Wire, tmp_path: Path) -> None:
    parts = [FmuPart("mass", fmu("Mass")), FmuPart("friction", fmu(friction), every=every)]
    with System(parts, [wire, "friction.F -> mass.F_friction"], start={"mass.F_drive": 1.0}) as system:
        system.to_fmu(tmp_path / "Axis.fmu", step=1e-3)
    description = read_model_description(str(tmp_path / "Axis.fmu"))
    assert description.coSimulation is not None and description.modelExchange is None
    assert not description.derivatives and not description.numberOfEventIndicators
    library = load(tmp_path / "Axis.fmu")
    assert not library.exchanges
    assert not hasattr(library.handle, "fmi2GetDerivatives")
    refused = Instance(library, kind=MODEL_EXCHANGE)
    assert refused.pointer is None
    assert b"co-simulation only" in refused.messages[-1][-1]


@pytest.mark.parametrize("name", ["compensated_axis", "compensated_axis" + IN_3])
def test_a_terminated_composite_has_the_values_of_its_last_state(name: str, tmp_path: Path) -> None:
    """Of the state that was set last, though the parts took its values only when something was read."""
    library = load(in_either(name, tmp_path))
    with Instance(library, kind=MODEL_EXCHANGE) as read, Instance(library, kind=MODEL_EXCHANGE) as terminated:
        values = []
        for instance in (read, terminated):
            instance.exchange()
            states = np.array(instance.vector("GetContinuousStates", library.states)) + 1e-3
            instance.must("SetTime", 1e-4)
            instance.must("SetContinuousStates", np.ctypeslib.as_ctypes(states), len(states))
            if instance is terminated:
                instance.must("Terminate")
            found = [*instance.vector("GetDerivatives", library.states), *instance.get(*library.names("output"))]
            values.append([*found, *instance.vector("GetEventIndicators", library.indicators)])
    assert values[0] == values[1]
