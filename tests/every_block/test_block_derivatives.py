"""Derivatives of every block: zero where nothing is declared, and asking for them changes nothing."""

from __future__ import annotations

import math
import random

import pytest
from lxml import etree
from shell.exchanging import SITUATIONS, go_to, need
from shell.instance import MODEL_EXCHANGE, Instance, Library
from shell.selection import SAMPLED_BLOCKS, of_each_branch

AMPLITUDE = {"m": 1e-3, "m/s": 5e-3, "m/s2": 0.5, "rad": 1e-3, "rad/s": 5e-3}


def test_held_inputs_are_constant(library: Library, running: Instance) -> None:
    names = library.names("input")
    before = running.get(*names)
    running.step(0.01, 0.01)
    assert running.get(*names) == before


@pytest.mark.parametrize("library", of_each_branch(SAMPLED_BLOCKS), indirect=True)
def test_outputs_of_sampled_blocks_stay_between_samples(library: Library, running: Instance) -> None:
    outputs = library.names("output", type="Real")
    assert running.output_derivatives(*outputs) == [0.0] * len(outputs)


@pytest.mark.parametrize("library", of_each_branch(SAMPLED_BLOCKS), indirect=True)
def test_inputs_do_not_move_the_outputs_of_sampled_blocks_between_samples(library: Library, running: Instance) -> None:
    """An importer that solves a loop by these derivatives, not by those of the next sample, finds what it will read."""
    inputs, outputs = library.names("input", type="Real"), library.names("output", type="Real")
    before = running.get(*outputs)
    running.set({name: value + 0.1 for name, value in zip(inputs, running.get(*inputs), strict=True)})
    assert running.get(*outputs) == before
    for name in inputs:
        assert running.directional(outputs, {name: 1.0}) == [0.0] * len(outputs), name


def test_asking_for_output_derivatives_changes_nothing(library: Library, running: Instance) -> None:
    before = running.everything(), running.serialised()
    running.output_derivatives(*library.names("output", type="Real"))
    assert (running.everything(), running.serialised()) == before


def test_directional_derivatives_are_zero_where_nothing_is_declared(library: Library, running: Instance) -> None:
    root = etree.parse(library.folder / "modelDescription.xml").getroot()
    names = list(library.variables)
    for unknown in root.iterfind("ModelStructure/Outputs/Unknown"):
        output = names[int(unknown.get("index")) - 1]
        declared = {names[int(i) - 1] for i in unknown.get("dependencies").split()}
        if library.variables[output].type == "Real":
            for known in library.names("input", type="Real"):
                (value,) = running.directional([output], {known: 1.0})
                assert math.isfinite(value)
                assert value == 0.0 or known in declared


def test_asking_for_directional_derivatives_changes_nothing(library: Library, running: Instance) -> None:
    before = running.everything(), running.serialised()
    running.directional(library.names("output", type="Real"), dict.fromkeys(library.names("input", type="Real"), 1.0))
    assert (running.everything(), running.serialised()) == before


def point(library: Library, seed: int) -> dict[str, float]:
    """Inputs and states away from zero, where decisions change, and of one sign: none is due."""
    draw = random.Random(f"{library.identifier} {seed}")
    values, side = {}, (1.0, -1.0)[seed % 2]
    for v in library.variables.values():
        size = side * draw.uniform(0.3, 1.0)
        if v.causality == "input" and v.type == "Real":
            values[v.name] = size * AMPLITUDE.get(v.unit, 1.0)
        elif v.derivative is not None and v.derivative.initial == "exact":
            values[v.derivative.name] = size * 0.3 * float(v.derivative.nominal or 1.0)
        elif v.name in ("x0", "v0"):
            values[v.name] = size
    return values


@pytest.mark.parametrize("situation", [name for name, kind in SITUATIONS.items() if kind == MODEL_EXCHANGE])
def test_directional_derivatives_in_model_exchange_are_those_of_co_simulation(library: Library, situation: str) -> None:
    """At the same point, of outputs and state derivatives with respect to inputs and states.

    A quantiser is constant up to its next step; with steps far below the distance of the differences, co-simulation
    gives the mean slope of the staircase.
    """
    need(library, MODEL_EXCHANGE)
    variables = library.variables.values()
    states = [v.derivative.name for v in variables if v.derivative is not None]
    unknowns = [v.name for v in variables if v.derivative is not None] + library.names("output", type="Real")
    for seed in range(3):
        values = point(library, seed)
        with Instance(library).initialise(**values) as slave, Instance(library, kind=MODEL_EXCHANGE) as model:
            model.exchange(**values)
            if library.sampled:
                slave.step(0.0, library.start("Ts"))
            go_to(model, situation)
            before = model.serialised()
            for known in (*library.names("input", type="Real"), *states):
                stairs = library.identifier == "Quantiser"
                expected = [0.0] if stairs else slave.directional(unknowns, {known: 1.0})
                assert model.directional(unknowns, {known: 1.0}) == pytest.approx(expected, rel=1e-7, abs=1e-12), known
            assert model.serialised() == before
