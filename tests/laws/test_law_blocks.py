"""Every law as a block of block.h: it compiles, and its sample is casadi's."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from shell.selection import EACH_FEATURE
from thorough import few, nightly, some

from friction_fmus.blocks.axis_units import SLIDING
from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.blocks.probe import read_variables
from friction_fmus.fmi.model_description import base_unit
from friction_fmus.lawkit.law import BOOLEANS, VECTORS, Kind, Law, LawVariable, Unit, block_source, discover_laws

LAWS = discover_laws(laws_folder())
SOME_LAWS = [law for law in LAWS if law.name in EACH_FEATURE]
VECTOR_LAW = '''
from casadi import SX, dot, if_else
from friction_fmus.lawkit.law import *

@law("Elements", 'Sum of "elements" \\\\ why??)', source="none", Ts=1e-3, outputs={"u": Output(FORCE, "sum")})
def elements(
    x: SX = Input(LENGTH, 0.5, "displacement"),
    on: SX = Command(True, "on"),
    k: SX = Parameter(STIFFNESS, (5e4, 3e4, 0.1), "stiffness of the elements", min=0.0),
    z: SX = State(LENGTH, 0.0, "memory"),
    w: SX = State(LENGTH, 1.0, "memory of the memory"),
    line: SX = State(LENGTH, (2.0, 3.0), "a line of values", nominal=1e-3),
    m: SX = Parameter(MASS, 1.0, "a name that C code likes to use"),
    t1: SX = Parameter(TIME, 1.0, "a name that the emitter likes to use"),
    Ts: SX = SampleTime(),
) -> dict[str, SX]:
    """Elements /* in a comment */ of a ??/ C file.

        u = k1 x + k2 z + k3 w + line2

    That is all.
    """
    return {"u": on * (k[0] * x + k[1] * z + k[2] * w) + m * t1 * Ts + line[1], "z": w, "w": z, "line": [x, line[0]]}
'''


def element(variable: LawVariable, i: int) -> str:
    """Name of a scalar in the block."""
    return f"{variable.name}[{i + 1}]" if variable.kind in VECTORS else variable.name


def library_of(law: Law, workshop, *flags: str) -> Path:
    """The block without optimisation, with which `test_emit.py` compiles the same expressions."""
    return workshop.library(block_source(law), "-O0", "-fno-sanitize=undefined", *flags)


def check(law: Law, workshop, different_bits) -> None:
    """At random points: the block's values after a sample are what casadi makes of the same point."""
    library = library_of(law, workshop)
    reference = {variable.name: variable.reference for variable in read_variables(library).variables}
    evaluate = ctypes.CDLL(str(library)).block_evaluate
    evaluate.restype = None
    rng = np.random.default_rng(1)
    for _ in range(few(200)):
        values = np.zeros(max(reference.values()) + 1)
        arguments = []
        for variable in law.given:
            for i, start in enumerate(variable.starts):
                boolean = variable.kind in BOOLEANS
                value = (
                    float(rng.integers(0, 2)) if boolean else start + (abs(start) or variable.nominal) * rng.normal()
                )
                arguments.append(min(max(value, variable.min), variable.max))
                values[reference[element(variable, i)]] = arguments[-1]
        evaluate(values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), 0)
        found = values[[reference[element(v, i)] for v in law.results for i in range(len(v.starts))]]
        expected = np.array([float(value) for value in law.function.call(arguments)])
        assert not different_bits(found, expected).any()


@pytest.mark.parametrize("law", some(LAWS, SOME_LAWS), ids=lambda law: law.name)
def test_the_blocks_sample_is_casadis(law, workshop, different_bits):
    check(law, workshop, different_bits)


def test_vectors_swapped_states_and_awkward_texts(workshop, different_bits, tmp_path):
    path = tmp_path / "elements.py"
    path.write_text(VECTOR_LAW, encoding="utf-8")
    (law,) = discover_laws(path)
    check(law, workshop, different_bits)
    rows = {variable.name: variable for variable in read_variables(library_of(law, workshop)).variables}
    assert [rows[f"k[{i}]"].start for i in (1, 2, 3)] == [5e4, 3e4, 0.1]
    assert rows["line[2]"].start == 3.0
    assert law.evaluate({"k": (1.0, 2.0, 3.0), "x": 1.0, "z": 10.0, "w": 100.0, "line": (5.0, 9.0)}) == {
        "u": 330.001,
        "z": 100.0,
        "w": 10.0,
        "line": (1.0, 5.0),
    }
    assert law.dependencies("line") == ("x", "line")


SI = {
    **{"LENGTH": "m", "VELOCITY": "m/s", "ACCELERATION": "m/s2", "JERK": "m/s3", "FORCE": "N", "MASS": "kg"},
    **{"STIFFNESS": "N/m", "DAMPING": "N.s/m", "TIME": "s", "FREQUENCY": "Hz", "ANGLE": "rad", "NO_UNIT": ""},
}


def si_name(unit: Unit) -> str:
    """What the C expression of a unit says: quantities and string literals, joined."""
    return "".join(SI[word] if word in SI else word[1:-1] for word in re.findall(r'"[^"]*"|\w+', unit.c))


@pytest.mark.parametrize("law", some(LAWS, SOME_LAWS), ids=lambda law: law.name)
def test_the_table_says_what_the_law_says(law, workshop):
    rows = read_variables(library_of(law, workshop)).variables[1:]
    rows = [row for row in rows if row.name != "fault"]
    variables = [(variable, i) for variable in law.variables for i in range(len(variable.starts))]
    assert [row.name for row in rows] == [element(*pair) for pair in variables]
    for row, (variable, i) in zip(rows, variables, strict=True):
        optional = variable.kind in (Kind.OPTIONAL, Kind.COMMAND)
        assert row.text == ("optional: " if optional else "") + SLIDING.fill(variable.text)
        assert (row.unit, row.start) == (si_name(variable.unit), variable.starts[i])
        if variable.kind in (Kind.PARAMETER, Kind.VECTOR, Kind.SAMPLE_TIME):
            assert (row.min, row.max) == (variable.min, variable.max)
        if row.unit:
            base_unit(row.unit)


@nightly
@pytest.mark.parametrize("law", some(LAWS[::3], SOME_LAWS[:2]), ids=lambda law: law.name)
def test_the_rotational_twin_has_its_own_units(law, workshop):
    rows = read_variables(library_of(law, workshop, "-DROTATIONAL")).variables[1:]
    units = {row.name: row.unit for row in rows}
    twin = {"u": "N.m", "r": "rad", "rd": "rad/s", "Kp": "N.m/rad", "Ki": "N.m/(rad.s)", "m": "kg.m2", "kp": "1/s"}
    shared = twin.keys() & units.keys()
    assert {name: units[name] for name in shared} == {name: twin[name] for name in shared}


@pytest.mark.parametrize("name", ["ExtendedStateObserver", "ANDFC"])
def test_a_mass_in_kg_is_no_moment_of_inertia_although_a_bandwidth_is_in_rad_per_second(name, build_fmu, workshop):
    law = next(law for law in LAWS if law.name == name)
    twin = {row.name: row for row in read_variables(library_of(law, workshop, "-DROTATIONAL")).variables}
    plain = {v.name: v for v in read_model_description(str(build_fmu(name))).modelVariables}
    assert "rad/s" in {v.unit for v in plain.values()}
    for v, unit, mass in ((plain["m"], "kg", "moving mass"), (twin["m"], "kg.m2", "moment of inertia")):
        assert (v.unit, getattr(v, "description", None) or v.text) == (unit, mass)
    assert plain["u"].description == "control force, within u_min and u_max"
    assert twin["u"].text == "control torque, within u_min and u_max"


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_everything_the_law_reads_matters(law):
    used = {name for variable in law.results for name in law.dependencies(variable.name)}
    assert {variable.name for variable in law.given} - used <= {"Ts"}


def test_dependencies_see_through_decisions():
    law = next(law for law in LAWS if law.name == "PID")
    later = {"Ts", "held", "db", "db_ratio"}  # what only the next integral depends on
    assert law.dependencies("u_sat") == tuple(v.name for v in law.given if v.name not in later)
    assert {"Kp", "reset", "Ts", "u_max"} <= set(law.dependencies("integral"))
