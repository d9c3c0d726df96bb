"""Every FMU in fmpy: simulate_fmu, a loop by hand with FMU2Slave, and its container."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from graphlib import TopologicalSorter
from pathlib import Path

import attrs
import fmpy
import numpy as np
import pytest
from fmpy.container_fmu.cli import create_container_fmu
from fmpy.container_fmu.config import Component, Configuration, Connection
from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable, Unknown
from interop.importers import ALONE, SMALL, default_experiment, deviation, in_fmpy, slave, without_start
from interop.loops import EVERY, STEP, STOP, Loop, Trajectories, beside_each_other, description, of_loop, ports


def test_every_fmu_simulates_its_default_experiment(fmus: Mapping[str, Path]) -> None:
    for block, fmu in fmus.items():
        rows = fmpy.simulate_fmu(str(fmu))
        assert rows["time"][-1] == pytest.approx(1.0)
        for name, (value,) in default_experiment(fmu).items():
            last = rows[name.removeprefix(f"{ALONE}.")][-1]
            assert last == pytest.approx(value, rel=1e-9, abs=1e-9 * SMALL), (block, name)


def by_hand(loop: Loop, folder: Path) -> Trajectories:
    """A master in the manner of Jacobi: all parts step, then all outputs are exchanged."""
    outputs = {part: ports(fmu, "output", "Real") for part, fmu in loop.fmus.items()}
    references = {part: [loop.variable(f"{part}.{name}").valueReference for name in outputs[part]] for part in outputs}
    with ExitStack() as stack:
        slaves = {part: stack.enter_context(slave(part, fmu, folder / part)) for part, fmu in loop.fmus.items()}

        def put(name: str, value: float) -> None:
            setter = getattr(slaves[name.split(".")[0]], f"set{loop.variable(name).type}")
            setter([loop.variable(name).valueReference], [value])

        def exchange() -> list[float]:
            values = [value for part in slaves for value in slaves[part].getReal(references[part])]
            found = dict(zip(loop.outputs(), values, strict=True))
            for source, target in loop.wires:
                put(target, found[source])
            return values

        for part in slaves.values():
            part.setupExperiment(startTime=0.0)
        for name, value in loop.start.items():
            put(name, value)
        for part in slaves.values():
            part.enterInitializationMode()
        for _ in slaves:  # as often as there are parts that a value may pass through
            exchange()
        for part in slaves.values():
            part.exitInitializationMode()
        rows = []
        for k in range(round(STOP / STEP)):
            for part in slaves.values():
                part.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
            values = exchange()
            if (k + 1) % EVERY == 0:
                rows.append(values)
        for part in slaves.values():
            part.terminate()
    return dict(zip(loop.outputs(), np.array(rows).T, strict=True))


def test_every_fmu_in_a_loop_by_hand_gives_the_trajectory_of_jacobi(loops: Mapping[str, Loop], tmp_path: Path) -> None:
    errors = {
        block: deviation(by_hand(x, tmp_path / block), without_start(x.jacobi), x.outputs())
        for block, x in loops.items()
    }
    assert {block: error for block, error in errors.items() if not error < 1e-8} == {}


def in_order(loop: Loop) -> list[tuple[str, str]]:
    """The wires so that an output is read before an input that feeds through to it is set."""
    reads = loop.feed_through()
    first: dict[tuple[str, str], list[tuple[str, str]]] = {wire: [] for wire in loop.wires}
    for wire in loop.wires:
        for later in loop.wires:
            if later[1] in reads.get(wire[0], ()):
                first[later].append(wire)
    return list(TopologicalSorter(first).static_order())


def container(loop: Loop, folder: Path, step: float = STEP) -> Path:
    """A container of a loop with all its outputs, and its start values as inputs and parameters."""
    parts = {part: Component(part, fmu, description(fmu)) for part, fmu in loop.fmus.items()}
    model = ModelDescription(
        fmiVersion="2.0",
        modelName="container",
        instantiationToken="{container}",
        coSimulation=CoSimulation(fixedInternalStepSize=step, canHandleVariableCommunicationStepSize=True),
        # the library of the container counts from the second variable on
        modelVariables=[ModelVariable("time", type="Real", causality="independent", variability="continuous")],
    )
    inside = {}

    def expose(name: str, causality: str, **more: str) -> ModelVariable:
        v = loop.variable(name)
        made = ModelVariable(name, type=v.type, causality=causality, variability=v.variability, **more)
        model.modelVariables.append(made)
        inside[made] = [(parts[name.split(".")[0]], v)]
        return made

    for name, value in loop.start.items():
        expose(name, loop.variable(name).causality, start=str(value).lower())
    for name in loop.outputs():
        unknown = Unknown(variable=expose(name, "output", initial="calculated"))
        model.outputs.append(unknown)
        model.initialUnknowns.append(unknown)
    wires = [
        Connection(
            parts[source.split(".")[0]],
            [attrs.evolve(loop.variable(source), type="Float64")],  # it writes the type as it stands, and reads this
            parts[target.split(".")[0]],
            [loop.variable(target)],
        )
        for source, target in in_order(loop)
    ]
    folder.mkdir(parents=True)
    path = folder.with_suffix(".fmu")
    create_container_fmu(Configuration(False, model, list(parts.values()), wires, inside), folder, path)
    return path


def test_every_fmu_in_a_container_gives_the_trajectory_of_jacobi(loops: Mapping[str, Loop], tmp_path: Path) -> None:
    """It couples part by part at the beginning of a step, and reads as late as ecos: the states are compared."""
    together = beside_each_other(loops)
    first = {f"{block}_{name}": value for block, x in loops.items() for name, value in x.first_inputs().items()}
    rows = in_fmpy(
        container(replace(together, start=together.start | first), tmp_path / "container"),
        tmp_path / "unpacked",
        stop_time=STOP,
        step_size=STEP,
        output_interval=EVERY * STEP,
        output=together.outputs(),
    )
    found = {name: rows[name][1:] for name in together.outputs()}
    errors = {
        block: deviation(of_loop(block, found), without_start(x.jacobi), x.states()) for block, x in loops.items()
    }
    assert {block: error for block, error in errors.items() if not error < 1e-8} == {}
