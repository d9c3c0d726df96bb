"""Parameter sets on their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import pytest
from fmpy.ssp.ssd import read_ssv as fmpy_read_ssv
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from ssp_files import parameter_set, real
from thorough import few

from harness import (
    BaseUnit,
    FmuPart,
    HarnessError,
    OutputError,
    Parameter,
    ParameterSet,
    StartValueError,
    System,
    SystemFileError,
    UnitError,
    UnknownNameError,
    read_ssv,
    write_ssv,
)
from harness.ssp.package import SSV, parse_document
from harness.ssp.ssv import parse_ssv, ssv_bytes

FURLONG = BaseUnit((0, 1, 0, 0, 0, 0, 0, 0), 201.168)
WARM = BaseUnit((0, 0, 0, 0, 1, 0, 0, 0), 5 / 9, 459.67 * 5 / 9)
SET = ParameterSet(
    "identified & good",
    {
        "p.gain": Parameter(0.1 + 0.2),
        "p.length": Parameter(-0.0, "furlong", FURLONG, 'the "length"'),
        "p.heat": Parameter(70.0, "F", WARM),
        "p.force": Parameter(5e-324, "kN"),
        "p.n": Parameter(-(2**31)),
        "p.b": Parameter(True),
        "p.label": Parameter(" a\n\tb "),
        "p.mode": Parameter("Warning", item=True),
    },
    "from <there>",
)


def test_round_trip(tmp_path: Path) -> None:
    write_ssv(SET, tmp_path / "set.ssv")
    read = read_ssv(tmp_path / "set.ssv")
    assert (read.name, read.description) == (SET.name, SET.description)
    assert list(read.parameters) == list(SET.parameters)
    for name, parameter in SET.parameters.items():
        other = read.parameters[name]
        assert (other.value, other.unit, other.description, other.item) == (
            parameter.value,
            parameter.unit,
            parameter.description,
            parameter.item,
        )
        assert type(other.value) is type(parameter.value)
    assert read.parameters["p.length"].base == FURLONG
    assert read.parameters["p.heat"].base == WARM
    write_ssv(read, tmp_path / "again.ssv")
    assert (tmp_path / "again.ssv").read_bytes() == (tmp_path / "set.ssv").read_bytes()


NOT_IN_XML = [*(chr(code) for code in range(0x20) if chr(code) not in "\t\n\r"), "\ufffe", "\uffff"]
in_xml = st.characters(exclude_categories=["Cs"], exclude_characters=NOT_IN_XML)


@settings(max_examples=few(200), deadline=None)
@given(
    st.dictionaries(
        st.text(in_xml, min_size=1),
        st.one_of(
            st.floats(allow_nan=False, allow_infinity=False),
            st.integers(-(2**31), 2**31 - 1),
            st.booleans(),
            st.text(in_xml),
        ),
    )
)
def test_any_values(values: dict[str, float | int | bool | str]) -> None:
    """What is written is read back exactly."""
    given_set = ParameterSet("set", {name: Parameter(value) for name, value in values.items()})
    data = ssv_bytes(given_set)
    read = parse_ssv(parse_document(data, SSV, "set"), "set").parameters
    assert {name: repr(parameter.value) for name, parameter in read.items()} == {
        name: repr(value) for name, value in values.items()
    }


@pytest.mark.parametrize("character", NOT_IN_XML, ids=ascii)
def test_characters_that_xml_cannot_carry_are_refused(character: str) -> None:
    for values in ({"x": Parameter(f"a{character}b")}, {f"a{character}b": Parameter(1.0)}):
        with pytest.raises(SystemFileError, match="remove its control characters"):
            ssv_bytes(ParameterSet("set", values))


def test_fmpy_reads_it_and_it_is_valid(tmp_path: Path) -> None:
    write_ssv(SET, tmp_path / "set.ssv")
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureParameterValues.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(etree.parse(tmp_path / "set.ssv"))
    found = {p.name: (p.type, p.value, p.unit) for p in fmpy_read_ssv(str(tmp_path / "set.ssv")).parameters}
    assert found["p.force"] == ("Real", "5e-324", "kN")
    assert found["p.mode"] == ("Enumeration", "Warning", None)


def test_a_number_with_a_unit_is_real(tmp_path: Path) -> None:
    write_ssv(ParameterSet("set", {"x": Parameter(2, "m")}), tmp_path / "set.ssv")
    value = read_ssv(tmp_path / "set.ssv").parameters["x"].value
    assert value == 2.0 and type(value) is float


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"x": Parameter(math.nan)}, SystemFileError, "'x' is nan"),
        ({"x": Parameter(-math.inf, "m")}, SystemFileError, "'x' is -inf"),
        ({"x": Parameter(1.0, "pond")}, SystemFileError, "the unit 'pond' of the parameter 'x' is unknown"),
        ({"x": Parameter("\x01")}, SystemFileError, "control characters"),
        ({"x": Parameter(1.0, "F", WARM), "y": Parameter(1.0, "F")}, UnitError, "has two meanings"),
    ],
)
def test_what_cannot_be_written(
    tmp_path: Path, parameters: dict[str, Parameter], error: type[HarnessError], message: str
) -> None:
    with pytest.raises(error, match=message):
        write_ssv(ParameterSet("set", parameters), tmp_path / "set.ssv")
    assert list(tmp_path.iterdir()) == []


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(SystemFileError, match="cannot read the parameters"):
        read_ssv(tmp_path / "none.ssv")
    with pytest.raises(OutputError, match="cannot write"):
        write_ssv(SET, tmp_path / "none" / "set.ssv")


@pytest.fixture
def system(make_fmu: Callable[..., Path]) -> Iterator[System]:
    path = make_fmu(('name="gain" valueReference="3"', 'name="gain[1]" valueReference="3"'))
    with System([FmuPart("p", path)], start={"p.u": 1.0, "p.n": 0, "p.b": False}) as made:
        yield made


def test_parameters_for_a_system(system: System, tmp_path: Path) -> None:
    units = '<ssv:Units><ssc:Unit name="kilo"><ssc:BaseUnit kg="1" m="1" s="-2" factor="1000"/></ssc:Unit></ssv:Units>'
    (tmp_path / "set.ssv").write_text(parameter_set(real("u", 2.5, "kilo") + real("gain[1]", 3.0), units))
    changed = system.with_parameters(tmp_path / "set.ssv", prefix="p.")
    assert changed.start == {"p.u": 2500.0, "p.gain[1]": 3.0, "p.n": 0, "p.b": False}
    assert float(changed.run(stop=1.0, step=1.0)["p.y"][0]) == 7500.0
    assert system.start["p.u"] == 1.0


def test_parameters_from_python(system: System) -> None:
    changed = system.with_parameters({"p.u": Parameter(3, "mN"), "p.n": 4, "p.x": Parameter(402.336, "m")})
    assert changed.start == {"p.u": 0.003, "p.n": 4, "p.b": False, "p.x": pytest.approx(2.0, rel=1e-15)}


@pytest.mark.parametrize(
    ("name", "parameter", "error", "message"),
    [
        ("p.u", Parameter(1.0, "m"), UnitError, r"p.u joins \[m\] and \[kg.m.s-2\]"),
        ("p.n", Parameter(1.0), StartValueError, "p.n is 1.0, which is not of type Integer"),
        ("p.y", Parameter(1.0), StartValueError, "p.y is computed by its part"),
        ("p.gian[1]", Parameter(1.0), UnknownNameError, r"did you mean 'gain\[1\]'"),
        ("q.u", Parameter(1.0), UnknownNameError, "there is no part 'q'"),
    ],
)
def test_parameters_that_do_not_fit(
    system: System, name: str, parameter: Parameter, error: type[HarnessError], message: str
) -> None:
    with pytest.raises(error, match=message):
        system.with_parameters({name: parameter})
