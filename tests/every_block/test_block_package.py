"""What every FMU of the catalogue is as a file: valid, complete, reproducible, and true to its binary."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
import zipfile
from collections.abc import Mapping, Sequence
from itertools import chain, pairwise, product
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree
from shell.instance import EXCHANGE_SIGNATURES, SIGNATURES, Instance, Library, RefusedError, signals
from shell.selection import CONTINUOUS_BLOCKS, SAMPLED_BLOCKS, of_each_branch, one_of_each

from friction_fmus import catalogue
from harness.compiling import toolchain

PACKAGER = {"block_rows", "block_evaluate", "block_violated", "blockDirect"}  # blockDirect: see direct.h
BASE = ("kg", "m", "s", "rad", "A")
SI = {  # unit -> exponents of BASE
    "kg": (1, 0, 0, 0, 0),
    "m": (0, 1, 0, 0, 0),
    "s": (0, 0, 1, 0, 0),
    "rad": (0, 0, 0, 1, 0),
    "A": (0, 0, 0, 0, 1),
    "Hz": (0, 0, -1, 0, 0),
    "N": (1, 1, -2, 0, 0),
    "J": (1, 2, -2, 0, 0),
    "W": (1, 2, -3, 0, 0),
    "V": (1, 2, -3, 0, -1),
    "Ohm": (1, 2, -3, 0, -2),
    "1": (0, 0, 0, 0, 0),
}


def exponents(unit: str) -> tuple[int, ...]:
    """Exponents of a unit in FMI's notation: at most one slash, factors joined by dots, powers as digits."""
    above, *below = unit.split("/")
    assert len(below) <= 1, unit
    below = [re.sub(r"^\((.*)\)$", r"\1", part) for part in below]
    total = np.zeros(len(BASE), int)
    for sign, part in [(1, above), *((-1, part) for part in below)]:
        for factor in part.split("."):
            name, power = re.fullmatch(r"([A-Za-z]+|1)(-?\d*)", factor).groups()
            total += sign * int(power or 1) * np.array(SI[name])
    return tuple(int(power) for power in total)


@pytest.fixture
def xml(library: Library) -> etree._Element:
    return etree.parse(library.folder / "modelDescription.xml").getroot()


@one_of_each
def test_fmpy_finds_no_fault(library: Library) -> None:
    assert validate_fmu(str(library.fmu)) == []


def test_the_xml_meets_the_schema(library: Library) -> None:
    schema = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.parse(library.folder / "modelDescription.xml"))


def test_simulates_its_default_experiment(library: Library) -> None:
    result = fmpy.simulate_fmu(str(library.fmu))
    experiment = library.description.defaultExperiment
    assert result["time"][-1] == pytest.approx(float(experiment.stopTime))
    for name in result.dtype.names:
        assert np.isfinite(result[name]).all(), name


def test_the_archive_is_as_section_2_3_of_the_standard_wants_it(library: Library) -> None:
    with zipfile.ZipFile(library.fmu) as archive:
        names = archive.namelist()
        assert archive.testzip() is None
        for entry in archive.infolist():
            assert entry.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
            assert entry.extract_version <= 20
            assert not entry.filename.startswith(("/", "./")) and "\\" not in entry.filename
            assert ".." not in entry.filename.split("/")
    assert names == sorted(names) and len(set(names)) == len(names)
    for wanted in (
        "modelDescription.xml",
        "model.png",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/icon.svg",
    ):
        assert wanted in names
    assert not [name for name in names if re.search(r"fmi2(Functions|FunctionTypes|TypesPlatform)\.h", name)]


def test_no_path_of_the_building_machine_is_in_the_binary(library: Library) -> None:
    content = library.binary.read_bytes()
    for path in (Path.cwd(), Path.home(), library.fmu.parent, Path(fmpy.__file__).parent):
        assert str(path).encode() + b"/" not in content


@pytest.mark.skipif(shutil.which("nm") is None, reason="lists symbols with nm")
def test_only_the_functions_of_the_standard_and_of_the_project_are_exported(library: Library) -> None:
    listing = subprocess.run(
        ["nm", "-D", "--defined-only", library.binary], capture_output=True, text=True, check=True
    ).stdout
    symbols = {line.split()[-1].split("@")[0] for line in listing.splitlines()}
    assert library.exchanges == (catalogue()[library.identifier].no_exchange == "")
    functions = {*SIGNATURES, *EXCHANGE_SIGNATURES} if library.exchanges else {*SIGNATURES}
    assert symbols == {f"fmi2{name}" for name in functions} | PACKAGER
    assert len(functions) == (44 if library.exchanges else 34)


def test_a_warning_of_the_compiler_ends_a_build() -> None:
    """So each build in these tests is one without a warning; test_source_code.py has the sources without a prefix."""
    assert "-Werror" in toolchain.FLAGS


def test_one_source_file_is_compiled(library: Library) -> None:
    files = [str(element.get("name")) for element in etree.parse(library.folder / "modelDescription.xml").iter("File")]
    assert files == [f"{library.identifier}.c"] * (2 if library.exchanges else 1)  # for each kind of FMU


# ---- the XML and the binary agree


def test_start_values_of_the_xml_are_those_of_the_binary(library: Library, instance: Instance) -> None:
    instance.setup()
    instance.must("EnterInitializationMode")
    started = [v.name for v in library.variables.values() if v.start is not None]
    assert started or not library.names("input", "parameter")
    for name, value in zip(started, instance.get(*started), strict=True):
        assert value == library.start(name), name


def test_every_parameter_and_input_has_a_start_value(library: Library) -> None:
    for v in library.variables.values():
        assert (v.start is not None) == (v.causality in ("input", "parameter") or v.initial == "exact"), v.name


def test_units_are_defined_and_right(library: Library, xml: etree._Element) -> None:
    defined = {unit.get("name"): unit.find("BaseUnit") for unit in xml.iter("Unit")}
    for v in library.variables.values():
        if v.unit is not None:
            base = defined[v.unit]
            found = tuple(int(base.get(name, "0")) for name in BASE)
            assert found == exponents(v.unit), v.name
            assert float(base.get("factor", "1")) == 1.0 and float(base.get("offset", "0")) == 0.0
    used = {v.unit for v in library.variables.values()}
    assert set(defined) <= used, "a unit is defined that no variable has"


def test_a_derivative_has_the_unit_of_its_state_per_second(library: Library) -> None:
    for v in library.variables.values():
        if v.derivative is not None:
            state, rate = exponents(v.derivative.unit or "1"), exponents(v.unit or "1")
            assert rate == (*state[:2], state[2] - 1, *state[3:]), v.name
            assert v.name == f"der({v.derivative.name})"


def test_the_header_of_the_xml_is_filled(library: Library, xml: etree._Element) -> None:
    for name in ("description", "author", "version", "copyright", "license", "generationTool"):
        assert xml.get(name), name
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", xml.get("generationDateAndTime"))
    assert xml.get("fmiVersion") == "2.0" and xml.get("variableNamingConvention") == "structured"
    for v in library.variables.values():
        assert v.description, f"{v.name} has no description"


def test_structure_is_complete_and_in_order(library: Library, xml: etree._Element) -> None:
    variables = list(library.variables.values())

    def listed(group: str) -> list[int]:
        return [int(unknown.get("index")) for unknown in xml.iterfind(f"ModelStructure/{group}/Unknown")]

    outputs = [i for i, v in enumerate(variables, start=1) if v.causality == "output"]
    derivatives = [i for i, v in enumerate(variables, start=1) if v.derivative is not None]
    states = [i for i, v in enumerate(variables, start=1) if any(w.derivative is v for w in variables)]
    unsettled = {i for i in (*outputs, *derivatives, *states) if variables[i - 1].initial in ("approx", "calculated")}
    assert listed("Outputs") == outputs
    assert listed("Derivatives") == derivatives
    assert listed("InitialUnknowns") == sorted(unsettled)
    for unknown in xml.iter("Unknown"):
        known = [int(i) for i in unknown.get("dependencies").split()]
        assert known == sorted(set(known))
        assert all(1 <= i <= len(variables) for i in known)


def test_value_references_are_unique_and_time_is_the_independent_variable(library: Library) -> None:
    for type in ("Real", "Integer", "Boolean"):
        references = [library.variables[name].valueReference for name in library.names(type=type)]
        assert len(set(references)) == len(references)
    (time,) = library.names("independent")
    assert (time, library.variables[time].unit) == ("time", "s")


# ---- who depends on whom


def dependencies(xml: etree._Element, library: Library, group: str) -> dict[str, set[str]]:
    names = list(library.variables)
    return {
        names[int(unknown.get("index")) - 1]: {names[int(i) - 1] for i in unknown.get("dependencies").split()}
        for unknown in xml.iterfind(f"ModelStructure/{group}/Unknown")
    }


def another_value(library: Library, name: str, draw: random.Random) -> float:
    """A value of a parameter, mostly other than its start value and of any size that its limits allow."""
    v, start = library.variables[name], library.start(name)
    if v.type == "Boolean":
        return float(draw.random() < 0.5)
    low, high = float(v.min or "-inf"), float(v.max or "inf")
    if v.type == "Integer":
        return float(draw.randint(int(max(low, start - 2)), int(min(high, start + 3))))
    if draw.random() < 0.2:
        return start
    size = 10.0 ** draw.uniform(-3.0, 0.5)
    if start < 0.0 < high:
        size *= draw.choice((-1.0, 1.0))  # a negative value may stand for "not given"
    value = start * size if start else draw.choice((-1.0, 1.0)) * size
    return min(max(value, low), high)


@one_of_each
def test_every_parameter_matters(library: Library) -> None:
    """Two runs that differ in this parameter alone differ in an output; steps of few samples are tried first.

    The inputs are of their usual sizes, then of any smaller ones.
    """
    draw, usual = random.Random(1), signals(library, 1, 25)
    small = [
        [{key: value * 10.0 ** draw.uniform(-8.0, 0.0) for key, value in row.items()} for row in usual]
        for _ in range(10)
    ]
    for name in library.names("parameter"):
        tries = chain(product([30.0], [usual] * 300), product([np.inf], [usual] * 1000 + small * 100))
        assert any(_outputs_differ(library, name, draw, given, most) for most, given in tries), (
            f"{name} changes nothing"
        )


def _outputs_differ(
    library: Library, name: str, draw: random.Random, given: Sequence[Mapping[str, float]], most: float
) -> bool:
    outputs = library.names("output")
    others = {other: another_value(library, other, draw) for other in library.names("parameter")}
    h = min(10.0 ** draw.uniform(-4.0, -1.0), most * others.get("Ts", 1.0))
    with Instance(library) as one, Instance(library) as other:
        for run, value in ((one, others[name]), (other, another_value(library, name, draw))):
            try:
                run.initialise(**(others | {name: value}))
            except RefusedError as error:
                assert "must satisfy" in str(error)  # a relation of parameters: other values
                return False
        for k, inputs in enumerate(given):
            for run in (one, other):
                run.set(inputs)
                run.step(h * k, h)
            if one.get(*outputs) != other.get(*outputs):
                return True
    return False


@pytest.mark.parametrize("library", of_each_branch(CONTINUOUS_BLOCKS), indirect=True)
def test_parameters_of_continuous_blocks_are_declared_as_dependencies(library: Library, xml: etree._Element) -> None:
    declared = set().union(*dependencies(xml, library, "InitialUnknowns").values())
    in_steps = (
        {"seed"} if "kT" in library.names("parameter") and "R" in library.variables else set()
    )  # its first draw acts in the first step
    assert declared >= set(library.names("parameter")) - in_steps


def test_what_is_not_declared_as_dependency_has_no_influence(library: Library, xml: etree._Element) -> None:
    """In initialization mode, for all parameters, inputs and states with a start value, at random places."""
    draw = random.Random(2)
    declared = dependencies(xml, library, "InitialUnknowns")
    known = [name for name, v in library.variables.items() if v.start is not None]
    unknown = list(declared)
    with Instance(library) as run:
        run.setup()
        run.must("EnterInitializationMode")
        for inputs in signals(library, 2, 20):
            run.set({name: another_value(library, name, draw) for name in library.names("parameter")} | inputs)
            before = dict(zip(unknown, run.get(*unknown), strict=True))
            for name in known:
                held = run.get1(name)
                run.set({name: another_value(library, name, draw)})
                after = dict(zip(unknown, run.get(*unknown), strict=True))
                run.set({name: held})
                for output in unknown:
                    assert before[output] == after[output] or name in declared[output], (output, name)


def test_outputs_in_a_run_depend_at_once_on_declared_inputs_only(library: Library, xml: etree._Element) -> None:
    declared = dependencies(xml, library, "Outputs")
    outputs = library.names("output")
    with Instance(library) as run:
        run.initialise()
        for k, inputs in enumerate(signals(library, 3, 20)):
            before = run.get(*outputs)
            for name, value in inputs.items():
                held = run.get1(name)
                run.set({name: value})
                for output, old, new in zip(outputs, before, run.get(*outputs), strict=True):
                    assert old == new or name in declared[output], (output, name)
                run.set({name: held})
            run.set(inputs)
            run.step(0.01 * k, 0.01)


@pytest.mark.parametrize("library", of_each_branch(SAMPLED_BLOCKS), indirect=True)
def test_outputs_of_a_sample_depend_on_declared_inputs_only(library: Library, xml: etree._Element) -> None:
    """The same sample is taken again with one other input: a reset acts on what earlier samples have left."""
    declared, outputs, draw = dependencies(xml, library, "Outputs"), library.names("output"), random.Random(4)
    counts = library.names("parameter", type="Integer")
    for n in range(10):
        values = {name: float(library.variables[name].min) + draw.randint(0, 2) for name in counts}
        Ts = library.start("Ts")
        with Instance(library) as run:
            run.initialise(**values)
            for k, (inputs, others) in enumerate(pairwise(signals(library, 4 + n, 21))):
                run.set(inputs)
                state = run.serialised()
                run.step(k * Ts, Ts)
                after = run.get(*outputs)
                for name in inputs:
                    boolean = library.variables[name].type == "Boolean"
                    run.restore(state)
                    run.set({name: 1.0 - inputs[name] if boolean else others[name]})
                    run.step(k * Ts, Ts)
                    for output, old, new in zip(outputs, after, run.get(*outputs), strict=True):
                        assert old == new or name in declared[output], (output, name)
                run.restore(state)
                run.step(k * Ts, Ts)


def test_the_catalogue_is_not_empty() -> None:
    assert {"LuGre", "Stribeck", "Mass"} <= set(catalogue())
