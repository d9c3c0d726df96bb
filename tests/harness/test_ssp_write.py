"""Systems written as .ssp archives and read back."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path

import fmpy
import pytest
from harness_parts import mass
from lxml import etree

from harness import (
    Bias,
    Delay,
    Experiment,
    FmuPart,
    Freeze,
    Noise,
    OutputError,
    SeriesPart,
    System,
    SystemFileError,
    Wire,
)

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
# fail_status becomes an enumeration, the input u is in a unit that only the FMU knows
CHANGES = (
    (
        "<LogCategories>",
        '<TypeDefinitions><SimpleType name="Status"><Enumeration><Item name="Warning" value="1"/>'
        '<Item name="Error" value="3"/></Enumeration></SimpleType></TypeDefinitions><LogCategories>',
    ),
    ('<Integer start="3"/>', '<Enumeration declaredType="Status" start="3"/>'),
)
EXPERIMENT = Experiment(
    start=-1.0,
    stop=1.0,
    step=1 / 64,
    master="jacobi",
    record=("a.x", "b.*"),
    decimate=4,
    tolerance=1e-7,
    order=("b", "c", "a"),
    extrapolation=2,
    loop_tolerance=1e-9,
    coupling_tolerance=1e-6,
    step_tolerance=0.01,
    manipulators=(
        Bias("b.u", 1 / 3, start=0.5),
        Noise("c.u", sigma=0.1, seed=7, stop=0.75),
        Freeze("c.u"),
        Delay("b.n"),
    ),
)


@pytest.fixture
def system(make_fmu: Callable[..., Path]) -> Iterator[System]:
    first = make_fmu(*CHANGES, name="first one.fmu")
    third = first.with_name("third.fmu")
    third.write_bytes(first.read_bytes())
    parts = [
        FmuPart("a", first),
        FmuPart("b", make_fmu(name="second.fmu"), every=2, model="Probe"),
        FmuPart("c", third),
    ]
    wires = [
        "a.y -> b.u",
        Wire("b.y", "c.u", gain=-0.1, offset=1 / 3),
        Wire("a.twice_n", "b.n"),
        Wire("b.twice_n", "c.n", delay=3, initial=2.0),
    ]
    start = {
        "a.u": 0.1 + 0.2,
        "a.gain": 5e-324,
        "a.fail_status": 1,
        "a.n": -(2**31),
        "a.b": True,
        "a.label": 'left "axis" <1> & äöü\n\tnext',
        "b.b": False,
        "b.label": "",
        "b.fail_time": 1.7976931348623157e308,
        "c.b": True,
    }
    with System(parts, wires, start, EXPERIMENT, name="bench & Co") as made:
        yield made


def content(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("SystemStructure.ssd"))


def test_round_trip_is_exact(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "bench.ssp")
    with System.from_ssp(tmp_path / "bench.ssp") as copy:
        assert copy.name == system.name
        assert copy.wires == system.wires
        assert copy.start == system.start
        assert {name: type(value) for name, value in copy.start.items()} == {
            name: type(value) for name, value in system.start.items()
        }
        assert copy.experiment == system.experiment
        assert list(copy.parts) == list(system.parts)
        for part, other in zip(copy.parts.values(), system.parts.values(), strict=True):
            assert isinstance(part, FmuPart) and isinstance(other, FmuPart)
            assert (part.every, part.model) == (other.every, other.model)
            assert (part.inputs, part.outputs, part.parameters) == (other.inputs, other.outputs, other.parameters)
            assert part.path.read_bytes() == other.path.read_bytes()
        copy.to_ssp(tmp_path / "again.ssp")
    assert (tmp_path / "again.ssp").read_bytes() == (tmp_path / "bench.ssp").read_bytes()


def test_a_read_system_runs_like_the_written_one(probe: Path, tmp_path: Path) -> None:
    start = {"p.gain": 3.0, "p.n": 2, "p.b": True, "q.n": 0, "q.b": False, "p.u": 0.5}
    experiment = Experiment(stop=1.0, step=0.25)
    with System([FmuPart("p", probe), FmuPart("q", probe)], ["p.y -> q.u"], start, experiment) as written:
        written.to_ssp(tmp_path / "run.ssp")
        with System.from_ssp(tmp_path / "run.ssp") as read:
            assert read.run().identical(written.run())


def test_no_setting_of_an_experiment_is_forgotten() -> None:
    defaults = Experiment(stop=1.0, step=1.0)
    kept = [
        field.name for field in fields(Experiment) if getattr(EXPERIMENT, field.name) == getattr(defaults, field.name)
    ]
    assert kept == ["stop"]  # so that the round trip would show it


def test_without_experiment_and_wires(probe: Path, tmp_path: Path) -> None:
    System([FmuPart("p", probe)], start={"p.u": 1.0, "p.n": 0, "p.b": False}).to_ssp(tmp_path / "one.ssp")
    copy = System.from_ssp(tmp_path / "one.ssp")
    assert (copy.experiment, copy.wires) == (None, ())
    System([]).to_ssp(tmp_path / "none.ssp")
    assert System.from_ssp(tmp_path / "none.ssp").parts == {}


def test_files_are_valid(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "bench.ssp")
    root = content(tmp_path / "bench.ssp")
    etree.XMLSchema(etree.parse(SCHEMAS / "SystemStructureDescription.xsd")).assertValid(root)
    sets = root.findall(".//ssv:ParameterSet", SPACES)
    assert len(sets) == 3
    for found in sets:
        etree.XMLSchema(etree.parse(SCHEMAS / "SystemStructureParameterValues.xsd")).assertValid(found)


def written(system: System, path: Path) -> etree._Element:
    """The description of the system in the archive that is written of it."""
    system.to_ssp(path)
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("SystemStructure.ssd"))


def test_components_state_their_type(system: System, tmp_path: Path) -> None:
    """The Python package of OMSimulator opens no component that leaves it out, though SSP 1.0 lets it."""
    components = written(system, tmp_path / "a.ssp").findall(".//ssd:Component", SPACES)
    assert [component.get("type") for component in components] == ["application/x-fmu-sharedlibrary"] * 3


@pytest.mark.parametrize(("tolerance", "stated"), [(1e-7, "1e-07"), (None, "0.0001")])
def test_step_stands_where_omsimulator_looks_for_it(
    system: System, tmp_path: Path, tolerance: float | None, stated: str
) -> None:
    """Its library reads the first annotation of the outermost system, as in the files that it writes itself."""
    assert system.experiment is not None
    system.experiment = replace(system.experiment, tolerance=tolerance)
    annotations = written(system, tmp_path / "a.ssp").find("ssd:System/ssd:Annotations", SPACES)
    assert annotations is not None
    annotation = annotations[0]
    assert annotation.get("type") == "org.openmodelica"
    master = annotation.find("oms:Annotations/oms:SimulationInformation/oms:FixedStepMaster", SPACES)
    assert master is not None
    assert dict(master.attrib) == {
        "description": "oms-ma",
        "stepSize": repr(1 / 64),
        "absoluteTolerance": stated,
        "relativeTolerance": stated,
    }


def test_units_types_and_items_stand_in_the_file(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "bench.ssp")
    root = content(tmp_path / "bench.ssp")
    furlong = root.find("ssd:Units/ssc:Unit[@name='furlong']/ssc:BaseUnit", SPACES)
    assert furlong is not None
    assert (furlong.get("m"), float(furlong.get("factor", ""))) == ("1", 201.168)
    connector = root.find(".//ssd:Component[@name='a']/ssd:Connectors/ssd:Connector[@name='x']/ssc:Real", SPACES)
    assert connector is not None and connector.get("unit") == "furlong"
    item = root.find(".//ssv:Parameter[@name='fail_status']/ssv:Enumeration", SPACES)
    assert item is not None and item.get("value") == "Warning"


def test_equal_fmus_are_packed_once(make_fmu: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    one, two = make_fmu(name="probe.fmu"), make_fmu(*CHANGES, name="other/probe.fmu")
    rest = {f"{part}.{port}": value for part in "pqr" for port, value in {"u": 0.0, "n": 0, "b": False}.items()}
    System([FmuPart("p", one), FmuPart("q", two), FmuPart("r", one)], start=rest).to_ssp(tmp_path / "a.ssp")
    with zipfile.ZipFile(tmp_path / "a.ssp") as archive:
        assert archive.namelist() == ["SystemStructure.ssd", "resources/probe.fmu", "resources/probe_2.fmu"]
        assert archive.read("resources/probe_2.fmu") == two.read_bytes()


def test_one_unit_name_with_two_meanings(make_fmu: Callable[..., Path], tmp_path: Path) -> None:
    long_mile = make_fmu(('factor="201.168"', 'factor="202.0"'), name="long.fmu")
    rest = {f"{part}.{port}": value for part in "pq" for port, value in {"u": 0.0, "n": 0, "b": False}.items()}
    System([FmuPart("p", make_fmu()), FmuPart("q", long_mile)], start=rest).to_ssp(tmp_path / "a.ssp")
    units = {
        name: [real.get("unit") for real in content(tmp_path / "a.ssp").iterfind(path, SPACES)]
        for name in "pq"
        for path in [f".//ssd:Component[@name='{name}']/ssd:Connectors/ssd:Connector[@name='x']/ssc:Real"]
    }
    assert units == {"p": ["furlong"], "q": [None]}  # the second one is as its FMU says
    System.from_ssp(tmp_path / "a.ssp").close()


def test_unpacked_files_vanish_with_the_parts(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "bench.ssp")
    copy = System.from_ssp(tmp_path / "bench.ssp")
    part = copy.parts["a"]
    assert isinstance(part, FmuPart)
    path = part.path
    del copy
    assert path.is_file()
    del part
    assert not path.parent.parent.exists()


def test_files_are_unpacked_to_a_folder(system: System, tmp_path: Path) -> None:
    system.to_ssp(tmp_path / "bench.ssp")
    System.from_ssp(tmp_path / "bench.ssp", tmp_path / "unpacked").close()
    names = sorted(path.name for path in (tmp_path / "unpacked" / "resources").iterdir())
    assert names == ["first_one.fmu", "second.fmu"]  # the third one is the first one


def test_what_has_no_place_in_an_archive(tmp_path: Path) -> None:
    for system in (System([mass()], start={"mass.F": 0.0}), System([SeriesPart("s", [0.0], {"x": [1.0]})])):
        with pytest.raises(SystemFileError, match=r"cannot be written to .*: an SSP archive contains FMUs only"):
            system.to_ssp(tmp_path / "out.ssp")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("a.gain", math.nan, "'gain' is nan"),
        ("a.gain", math.inf, "'gain' is inf"),
        ("a.gain", "fast", "'fast' of a.gain .* give a Real"),
        ("a.n", 1.5, "1.5 of a.n .* give a Integer"),
        ("a.fail_status", 2, "2 of a.fail_status .* give one of 1, 3"),
        ("a.label", "a\x00b", "control characters"),
    ],
)
def test_start_values_that_cannot_be_written(
    system: System, tmp_path: Path, name: str, value: float | str, message: str
) -> None:
    before = sorted(tmp_path.iterdir())
    with pytest.raises(SystemFileError, match=message) as caught:
        system.with_start({name: value}).to_ssp(tmp_path / "out.ssp")
    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.iterdir()) == before


def test_folder_that_does_not_exist(system: System, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot write"):
        system.to_ssp(tmp_path / "none" / "out.ssp")


def test_fmu_that_is_gone(system: System, tmp_path: Path) -> None:
    part = system.parts["a"]
    assert isinstance(part, FmuPart)
    part.path.unlink()
    with pytest.raises(SystemFileError, match=r"cannot read .*first one.fmu"):
        system.to_ssp(tmp_path / "out.ssp")
