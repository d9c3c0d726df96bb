"""Systems with FMUs of FMI 3.0 written as .ssp archives: SSP 2.0 where it is needed, exact when read back."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from test_fmi3_parts import INPUTS, servo, three
from thorough import some
from types3 import types3

import harness.ssp
from friction_fmus import fmu
from harness import Experiment, FmuPart, Parameter, ParameterSet, System, SystemFileError, Wire, read_ssv, write_ssv

SCHEMAS = Path(harness.ssp.__file__).parent / "schema"
SPACES = {
    name: f"http://ssp-standard.org/SSP1/SystemStructure{rest}"
    for name, rest in {"ssd": "Description", "ssc": "Common", "ssv": "ParameterValues"}.items()
}
START = {
    **INPUTS,
    **{f"matrix[{i},{j}]": 0.1 * i + j for i in (1, 2) for j in (1, 2, 3)},
    **{"n": 4, "vector[1]": 1 / 3, "vector[2]": -0.0, "vector[3]": 5e-324, "vector[4]": 1e308},
    **{"i8": -128, "u64": 2.0**53, "i64": -(2.0**53), "u32": 2.0**32 - 1, "single": 0.1, "gear": 2, "flags[2]": True},
    **{"text": 'a "<b>" ä\n', "fault": 0},
}


def content(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("SystemStructure.ssd"))


def check(root: etree._Element) -> None:
    """Raise an error if the document or a parameter set in it violates the schemas of the standard."""
    etree.XMLSchema(etree.parse(SCHEMAS / "SystemStructureDescription.xsd")).assertValid(root)
    for found in root.iterfind(".//ssv:ParameterSet", SPACES):
        etree.XMLSchema(etree.parse(SCHEMAS / "SystemStructureParameterValues.xsd")).assertValid(found)


@pytest.fixture
def system(tmp_path: Path) -> Iterator[System]:
    part, other = (FmuPart(name, types3(tmp_path / "types.fmu")) for name in "pq")
    wires = [
        Wire("p.y", "q.matrix[2,1]", gain=0.1, offset=1 / 3, delay=2, initial=1 / 7),
        Wire("p.single_y", "q.single"),
        Wire("p.any", "q.flags[2]"),
        Wire("p.gear_y", "q.gear"),
    ]
    driven = {wire.target for wire in wires}
    start = {f"p.{name}": value for name, value in START.items()}
    start |= {f"q.{name}": value for name, value in START.items() if f"q.{name}" not in driven}
    with System([part, other], wires, start, Experiment(stop=0.1, step=0.01), name="two") as made:  # type: ignore[arg-type]
        yield made


def test_round_trip_is_exact(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "a.ssp")
    with System.from_ssp(tmp_path / "a.ssp") as copy:
        assert (copy.name, copy.wires, copy.experiment) == (system.name, system.wires, system.experiment)
        assert copy.start == system.start
        copy.to_ssp(tmp_path / "b.ssp")
    assert (tmp_path / "a.ssp").read_bytes() == (tmp_path / "b.ssp").read_bytes()


def test_a_read_system_runs_like_the_written_one(tmp_path: Path) -> None:
    part = FmuPart("p", types3(tmp_path / "types.fmu"))
    values = {**START, "u64": 5, "i64": -5, "vector[4]": 1e3}
    with System([part], [], {f"p.{k}": v for k, v in values.items()}, Experiment(stop=0.1, step=0.01)) as written:  # type: ignore[misc]
        written.to_ssp(tmp_path / "a.ssp")
        with System.from_ssp(tmp_path / "a.ssp") as read:
            assert read.run().identical(written.run())


def test_the_file_is_as_the_standard_says(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "a.ssp")
    root = content(tmp_path / "a.ssp")
    check(root)
    assert root.get("version") == "2.0"
    listed = root.findall(".//ssd:Component[@name='q']/ssd:Connectors/ssd:Connector", SPACES)
    found = {
        each.get("name"): (each.get("kind"), [etree.QName(x).localname + x.get("size", "") for x in each])
        for each in listed
    }
    assert found["matrix"] == ("input", ["Float64", "Dimension2", "Dimension3"])
    assert found["flags"] == ("input", ["Boolean", "Dimension2"])
    assert found["single"] == ("input", ["Float32"])
    assert found["u64_y"] == ("output", ["UInt64"])
    assert found["gear"] == ("input", [])
    joined = root.findall(".//ssd:Connection", SPACES)
    assert [
        [each.get(key) for key in ("startConnector", "startIndices", "endConnector", "endIndices")] for each in joined
    ] == [
        ["y", None, "matrix", "2 1"],
        ["single_y", None, "single", None],
        ["any", None, "flags", "2"],
        ["gear_y", None, "gear", None],
    ]
    path = ".//ssd:Component[@name='p']//ssv:Parameter"
    typed = {
        each.get("name"): (etree.QName(each[0]).localname, each[0].get("value"), [x.get("size") for x in each[1:]])
        for each in root.iterfind(path, SPACES)
    }
    assert typed["vector"] == ("Float64", "0.3333333333333333 -0.0 5e-324 1e+308", ["4"])
    assert typed["matrix"][1:] == (" ".join(repr(0.1 * i + j) for i in (1, 2) for j in (1, 2, 3)), ["2", "3"])
    assert typed["flags"] == ("Boolean", "false true", ["2"])
    assert typed["n"] == ("UInt64", "4", [])
    assert typed["u64"] == ("UInt64", "9007199254740992", [])
    assert typed["i8"] == ("Int8", "-128", [])
    assert typed["gear"] == ("Enumeration", "second", [])
    assert typed["single"] == ("Float64", "0.1", [])  # as Float32 it would not be 0.1


def test_a_number_of_single_precision_keeps_its_type(tmp_path: Path) -> None:
    values = {f"p.{name}": value for name, value in {**INPUTS, "single": 0.375}.items()}
    with System([FmuPart("p", types3(tmp_path / "types.fmu"))], [], values) as made:  # type: ignore[arg-type]
        made.to_ssp(tmp_path / "a.ssp")
    (value,) = content(tmp_path / "a.ssp").findall(".//ssv:Parameter[@name='single']/ssv:Float32", SPACES)
    assert value.get("value") == "0.375"


def test_the_rest_of_an_array_has_the_values_of_the_fmu(tmp_path: Path) -> None:
    values = {f"p.{name}": value for name, value in {**INPUTS, "vector[2]": 20.0}.items()}
    with System([FmuPart("p", types3(tmp_path / "types.fmu"))], [], values) as made:  # type: ignore[arg-type]
        made.to_ssp(tmp_path / "a.ssp")
    (vector,) = content(tmp_path / "a.ssp").findall(".//ssv:Parameter[@name='vector']/ssv:Float64", SPACES)
    assert vector.get("value") == "1.0 20.0 3.0"
    bigger = {f"p.{name}": value for name, value in {**INPUTS, "n": 5, "vector[5]": 50.0}.items()}
    with (
        System([FmuPart("p", types3(tmp_path / "types.fmu"))], [], bigger) as made,  # type: ignore[arg-type]
        pytest.raises(SystemFileError, match=r"p.vector\[4\] has no start value: give one for each element"),
    ):
        made.to_ssp(tmp_path / "b.ssp")
    assert not (tmp_path / "b.ssp").exists()


ROWS = [f"[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)]
GRID = (
    '<Float64 name="sum" valueReference="4" causality="output"/>',
    '<Float64 name="grid" valueReference="4" causality="output"><Dimension start="2"/><Dimension start="3"/></Float64>',
)


@pytest.mark.parametrize(
    ("wires", "number"),
    [
        ([Wire(f"p.grid{i}", f"q.matrix{i}", 2.0, delay=1) for i in ROWS], 1),
        ([Wire(f"p.grid{i}", f"q.matrix{i}", 2.0 + (i == "[2,3]")) for i in ROWS], 6),
        ([Wire(f"p.grid{i}", f"q.matrix{i}") for i in reversed(ROWS)], 6),
        ([Wire(f"p.grid{i}", f"q.matrix{k}") for i, k in zip(reversed(ROWS), ROWS, strict=True)], 6),
        ([Wire(f"p.grid{i}", f"q.matrix{i}") for i in ROWS[:5]], 5),
    ],
)
def test_whole_arrays_are_one_connection(tmp_path: Path, wires: list[Wire], number: int) -> None:
    parts = [FmuPart(name, types3(tmp_path / "types.fmu", GRID)) for name in "pq"]
    driven = {wire.target for wire in wires}
    start = {f"{p}.{name}": value for p in "pq" for name, value in INPUTS.items() if f"{p}.{name}" not in driven}
    with System(parts, wires, start) as made:  # type: ignore[arg-type]
        made.to_ssp(tmp_path / "a.ssp")
    root = content(tmp_path / "a.ssp")
    check(root)
    assert len(root.findall(".//ssd:Connection", SPACES)) == number
    with System.from_ssp(tmp_path / "a.ssp") as copy:
        assert copy.wires == tuple(wires)


def test_ssp_1_is_kept_where_it_suffices(tmp_path: Path) -> None:
    """FMUs of FMI 3.0 with scalar Float64, Int32, Boolean and String values have a place in SSP 1.0."""
    texts = []
    for kinds in ((fmu, fmu, fmu), (three, three, three)):
        with servo(kinds) as made:
            made.to_ssp(tmp_path / "a.ssp")
        root = content(tmp_path / "a.ssp")
        assert root.get("version") == "1.0"
        assert {each.get("version") for each in root.iterfind(".//ssv:ParameterSet", SPACES)} == {"1.0"}
        texts.append(etree.tostring(root))
    assert texts[0] == texts[1]


def test_blocks_with_vectors_need_ssp_2(tmp_path: Path) -> None:
    """A GMS block of FMI 3.0 with four elements runs after the round trip as the one of FMI 2.0."""
    start = {"gms.v": 1e-3, "gms.N": 4, **{f"gms.k[{k}]": 1e4 * k for k in (1, 2, 3, 4)}}

    def run(system: System) -> bytes:
        return np.asarray(system.run(stop=0.05, step=1e-3, master="jacobi")["gms.F"]).tobytes()

    with System([FmuPart("gms", three("GMS"))], [], start) as made:
        made.to_ssp(tmp_path / "a.ssp")
    check(content(tmp_path / "a.ssp"))
    with System.from_ssp(tmp_path / "a.ssp") as read, System([FmuPart("gms", fmu("GMS"))], [], start) as flat:
        assert run(read) == run(flat)


def test_a_mixed_system(tmp_path: Path) -> None:
    parts = [FmuPart("gms", three("GMS")), FmuPart("mass", fmu("Mass"))]
    start = {"gms.k[2]": 2e4, "gms.v": 0.0, "mass.F_drive": 0.0}
    with System(parts, ["gms.F -> mass.F_friction"], start) as made:
        made.to_ssp(tmp_path / "a.ssp")
        root = content(tmp_path / "a.ssp")
        check(root)
        (velocity,) = root.findall(".//ssd:Component[@name='mass']//ssd:Connector[@name='v']/ssc:Real", SPACES)
        (force,) = root.findall(".//ssd:Component[@name='gms']//ssd:Connector[@name='F']/ssc:Float64", SPACES)
        assert (velocity.get("unit"), force.get("unit")) == ("m/s", "N")
        with System.from_ssp(tmp_path / "a.ssp") as copy:
            assert copy.wires == made.wires
            assert all(copy.start[name] == value for name, value in made.start.items())


# ---- parameter sets

SET = ParameterSet(
    "set",
    {
        **{f"k[{i},{j}]": Parameter(i + 0.1 * j, "N/mm") for i in (1, 2) for j in (1, 2)},
        **{f"label[{k}]": Parameter(text) for k, text in ((1, "a b"), (2, ""))},
        **{f"on[{k}]": Parameter(k == 2) for k in (1, 2, 3)},
        **{"n": Parameter(2**64 - 1, type="UInt64"), "m": Parameter(-7), "f": Parameter(0.25, "m", type="Float32")},
        "mode[1]": Parameter("fast", item=True),
    },
    arrays={"k": (2, 2), "label": (2,), "on": (3,), "mode": (1,)},
)


def test_parameter_sets(tmp_path: Path) -> None:
    write_ssv(SET, tmp_path / "a.ssv")
    root = etree.parse(tmp_path / "a.ssv").getroot()
    etree.XMLSchema(etree.parse(SCHEMAS / "SystemStructureParameterValues.xsd")).assertValid(root)
    assert root.get("version") == "2.0"
    read = read_ssv(tmp_path / "a.ssv")
    assert read.arrays == SET.arrays
    assert {name: (p.value, p.unit, p.type, p.item) for name, p in read.parameters.items()} == {
        name: (p.value, p.unit, p.type, p.item) for name, p in SET.parameters.items()
    }
    write_ssv(read, tmp_path / "b.ssv")
    assert (tmp_path / "a.ssv").read_bytes() == (tmp_path / "b.ssv").read_bytes()


def test_a_parameter_set_can_enlarge_an_array(tmp_path: Path) -> None:
    """The new elements are converted to the unit of the variable as well: 1 N/mm = 1000 N/m."""
    values = {f"k[{k}]": Parameter(float(k), "N/mm") for k in (1, 2, 3, 4)}
    given = ParameterSet("set", {**values, "N": Parameter(4, type="UInt64")}, arrays={"k": (4,)})
    write_ssv(given, tmp_path / "a.ssv")
    with System([FmuPart("gms", three("GMS"))], [], {"gms.v": 0.0}) as made:
        changed = made.with_parameters(tmp_path / "a.ssv", prefix="gms.").start
    assert [changed[f"gms.k[{k}]"] for k in (1, 2, 3, 4)] == [1000.0, 2000.0, 3000.0, 4000.0]


@pytest.mark.parametrize(
    ("parameters", "arrays", "message"),
    [
        ({"k[1]": Parameter(1.0)}, {"k": (2,)}, r"the array 'k' has no parameter 'k\[2\]': give all elements"),
        (
            {"k[1]": Parameter(1.0), "k[2]": Parameter(1)},
            {"k": (2,)},
            "the elements of the array 'k' have several types",
        ),
        ({"k[1]": Parameter(1.0, "N"), "k[2]": Parameter(1.0)}, {"k": (2,)}, "several types or units"),
        ({"k": Parameter(128, type="Int8")}, {}, "the parameter 'k' is 128, which Int8 cannot state"),
        ({"k": Parameter(-1, type="UInt64")}, {}, "which UInt64 cannot state"),
        ({"k": Parameter(2**31)}, {}, "which Integer cannot state"),
        ({"k": Parameter(1.5, type="Int32")}, {}, "which Int32 cannot state"),
        ({"k": Parameter(0.1, type="Float32")}, {}, "which Float32 cannot state"),
        ({"k": Parameter("a", type="Float64")}, {}, "which Float64 cannot state"),
        ({"k": Parameter(1.0, type="Decimal")}, {}, "which Decimal cannot state"),
        ({"k": Parameter(float("inf"), type="Float64")}, {}, "is inf: a parameter set needs finite values"),
    ],
)
def test_parameter_sets_that_are_refused(
    tmp_path: Path, parameters: dict[str, Parameter], arrays: dict[str, tuple[int, ...]], message: str
) -> None:
    with pytest.raises(SystemFileError, match=message) as caught:
        write_ssv(ParameterSet("set", parameters, arrays=arrays), tmp_path / "a.ssv")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


# ---- FMUs of other tools, damaged files


@pytest.mark.filterwarnings("ignore")
def test_an_fmu_of_pythonfmu3(tmp_path: Path) -> None:
    """An array output of one tool and a matrix of another one, element by element."""
    pytest.importorskip("pythonfmu3")
    source = Path(__file__).parent / "foreign" / "powers.py"
    command = [sys.executable, "-m", "pythonfmu3", "build", "-f", str(source), "-d", str(tmp_path)]
    subprocess.run(command, check=True, timeout=100, capture_output=True)
    wires = [f"one.powers[{k}] -> p.matrix[1,{k}]" for k in (1, 2, 3)]
    start = {f"p.{name}": value for name, value in INPUTS.items() if not name.startswith("matrix[1")}
    parts = [FmuPart("one", tmp_path / "Powers.fmu"), FmuPart("p", types3(tmp_path / "types.fmu"))]
    experiment = Experiment(stop=0.1, step=0.01)
    with System(parts, wires, {**start, "one.rate": 1.0}, experiment) as made:  # type: ignore[dict-item]
        made.to_ssp(tmp_path / "a.ssp")
        check(content(tmp_path / "a.ssp"))
        with System.from_ssp(tmp_path / "a.ssp") as read:
            assert read.run().identical(made.run())


HARMS: list[Callable[[str], str]] = [
    lambda text: text[: len(text) // 2],
    lambda text: text.replace('size="3"', 'size="99999999999999999999999"'),
    lambda text: text.replace('size="3"', 'size="-1"'),
    lambda text: text.replace('endIndices="2 1"', 'endIndices="2"'),
    lambda text: text.replace('endIndices="2 1"', 'endIndices="9 9"'),
    lambda text: text.replace('endIndices="2 1"', 'endIndices="18446744073709551615 1"'),
    lambda text: text.replace("Dimension", "Dimensions"),
    lambda text: text.replace('version="2.0"', 'version="2.1"'),
    lambda text: text.replace('version="2.0"', 'version="1.0"'),
    lambda text: text.replace('version="2.0"', ""),
    lambda text: re.sub(r'(ssv:Float64 value=")[^"]*', r"\1", text),
    lambda text: re.sub(r'(ssv:UInt64 value=")[^"]*', r"\g<1>99999", text),
    lambda text: re.sub(r'(ssv:UInt64 value=")[^"]*', r"\g<1>1e3", text),
    lambda text: text.replace("Float64", "Binary"),
    lambda text: text.replace("<ssc:Float64/>", "<ssc:Clock/>"),
    lambda text: text.replace('name="matrix"', 'name=""'),
]


@pytest.mark.parametrize("harm", some(HARMS, HARMS[::3]))
def test_damaged_archives(system: System, tmp_path: Path, harm: Callable[[str], str]) -> None:
    system.to_ssp(tmp_path / "a.ssp")
    with zipfile.ZipFile(tmp_path / "a.ssp") as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    text = members["SystemStructure.ssd"].decode()
    damaged = harm(text)
    assert damaged != text
    with zipfile.ZipFile(tmp_path / "b.ssp", "w") as archive:
        for name, data in (members | {"SystemStructure.ssd": damaged.encode()}).items():
            archive.writestr(name, data)
    with pytest.raises(harness.HarnessError) as caught:
        System.from_ssp(tmp_path / "b.ssp")
    assert "\n" not in str(caught.value)
