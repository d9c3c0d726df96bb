"""Rotational twins: their units and words, and ports that fit each other."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from zipfile import ZipFile

import pytest
from lxml import etree
from thorough import some

from friction_fmus import catalogue, fmu
from friction_fmus.blocks.customise import rotational
from friction_fmus.blocks.probe import DERIVATIVE, BlockVariable
from friction_fmus.export.block_fmu import describe_block
from harness import FmuPart, System

BLOCKS = catalogue()
NORMAL = {"Fn", "Fn0"}
"""Normal forces, which are forces in the twin too."""
LOADS = ("EfficiencyLoad", "TransmissionLoad", "LoadFeedforward")
CONTACTS = ("Bristle", "GenericAsperity", "RateAndState")
OTHERS = (
    *("Actuator", "Belt", "BlimanSorine", "DCMotor", "DisturbanceObserver", "FrenkelKontorova", "LoadDependentDahl"),
    *("SecondOrderFilter", "SwitchMass", "TwoMass"),
)

names = pytest.mark.parametrize("name", some(tuple(BLOCKS), (*LOADS, *CONTACTS, *OTHERS)))


@cache
def variables(name: str, *, twin: bool) -> tuple[BlockVariable, ...]:
    """Return the variables as the library states them."""
    block = BLOCKS[name]
    return describe_block(replace(block, code=rotational(block.code)) if twin else block).variables


def turned(unit: str) -> str:
    """Return the unit of the twin: rad for m, N.m for N, kg.m2 for kg."""
    for symbol, other in ((r"m", "rad"), (r"N", "N.m"), (r"kg", "kg.m2")):
        unit = re.sub(rf"(?<![A-Za-z]){symbol}(?![A-Za-z])", other, unit)
    return unit


@names
def test_units_of_a_twin_are_those_of_a_rotation(name: str) -> None:
    for v, w in zip(variables(name, twin=False), variables(name, twin=True), strict=True):
        expected = v.unit if v.name in NORMAL else turned(v.unit)
        assert re.sub("[()]", "", w.unit) == re.sub("[()]", "", expected), v.name


@names
def test_a_derivative_is_described_without_the_remarks_on_its_state(name: str) -> None:
    """Not: time derivative of the position; 0: the spring is relaxed."""
    for v in variables(name, twin=False):
        assert v.role != DERIVATIVE or not re.search(r"[;,] ", v.text), v.text


@names
def test_a_description_needs_no_other(name: str) -> None:
    """Tools show variables in another order, and one alone: not "the same for the cosine"."""
    for v in variables(name, twin=False):
        assert not re.match(r"(optional: )?(the same|its|half of their|wavelength of this)\b", v.text), v.text


@pytest.mark.parametrize("name", BLOCKS)
def test_the_description_of_a_twin_speaks_of_torques_and_inertias(name: str) -> None:
    text = BLOCKS[name].rotary_summary.replace("normal force", "")
    chain = name.startswith("FrenkelKontorova")  # without units
    assert chain or not re.search(r"\b(force|mass)", text, re.IGNORECASE), text


@pytest.mark.parametrize(
    ("name", "description"),
    [("DCMotor", "Torque of a direct-current motor"), ("Belt", "Inertia on a moving belt")],
)
def test_a_twin_states_its_description_and_how_to_read_its_page(name: str, description: str) -> None:
    with ZipFile(fmu(name, "rotational")) as archive:
        root = etree.fromstring(archive.read("modelDescription.xml"))
        page = archive.read("documentation/index.html").decode()
    assert str(root.get("description")).startswith(description)
    assert f"<strong>{description}" in page and "forces but Fn are torques" in page


@pytest.mark.parametrize("contact", ["RateAndState", "Bristle"])
def test_a_load_fits_every_contact(contact: str) -> None:
    """Fn of a load is in N, also in the twin; another unit of the contact would be refused."""
    parts = [FmuPart("load", fmu("EfficiencyLoad", "rotational")), FmuPart("contact", fmu(contact, "rotational"))]
    start = {"load.v": 1e-3, "load.F_load": -2.0, "load.F_ext": 0.0, "load.base": 1.0, "contact.v": 1e-3}
    loaded = System(parts, ["load.Fn -> contact.Fn"], start).run(0.01, step=1e-3)
    alone = System(parts[1:], [], {"contact.v": 1e-3}).run(0.01, step=1e-3)
    assert float(loaded["contact.F"][-1]) == pytest.approx(3.0 * float(alone["contact.F"][-1]), rel=1e-12)
