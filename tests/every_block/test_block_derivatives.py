"""Derivatives of every block: zero where nothing is declared, and asking for them changes nothing."""

from __future__ import annotations

import math

import pytest
from lxml import etree
from shell.instance import Instance, Library
from shell.selection import SAMPLED_BLOCKS


def test_held_inputs_are_constant(library: Library, running: Instance) -> None:
    names = library.names("input")
    before = running.get(*names)
    running.step(0.01, 0.01)
    assert running.get(*names) == before


@pytest.mark.parametrize("library", SAMPLED_BLOCKS, indirect=True)
def test_outputs_of_sampled_blocks_stay_between_samples(library: Library, running: Instance) -> None:
    outputs = library.names("output", type="Real")
    assert running.output_derivatives(*outputs) == [0.0] * len(outputs)


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
