""".ssp archives of SSP 2.0 with FMUs of FMI 3.0: types, arrays, sizes. The expected values are from the standard."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import pytest
from ssp_files import NAMESPACES, connection, inline, pack, parameter_set, ssd, system
from types3 import types3

from harness import StartValueError, System, SystemFileError, Wire
from harness.parts.part import StartValue
from harness.ssp import read_ssp
from harness.system.system_file import SystemDescription

# the output sum becomes an array, so that the FMU has one
GRID = (
    '<Float64 name="sum" valueReference="4" causality="output"/>',
    '<Float64 name="grid" valueReference="4" causality="output"><Dimension start="2"/><Dimension start="3"/></Float64>',
)
SIZE = '<ssc:Dimension size="2"/><ssc:Dimension size="3"/>'
ROWS = [f"[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)]
LINEAR = '<ssc:LinearTransformation factor="2" offset="1"/>'
METRES = (
    '<ssv:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssv:Units>',
    ("<ModelVariables>", '<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions><ModelVariables>'),
    ('name="matrix" ', 'name="matrix" unit="m" '),
)


def two(text: str) -> str:
    return text.replace('version="1.0"', 'version="2.0"')


def port(name: str, kind: str, content: str = "") -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}">{content}</ssd:Connector>'


def ports(*connectors: str) -> str:
    return f"<ssd:Connectors>{''.join(connectors)}</ssd:Connectors>" if connectors else ""


def part(name: str, *connectors: str, bindings: str = "") -> str:
    bound = f"<ssd:ParameterBindings>{two(bindings)}</ssd:ParameterBindings>" if bindings else ""
    return f'<ssd:Component name="{name}" source="resources/types.fmu">{ports(*connectors)}{bound}</ssd:Component>'


def inner(name: str, content: str) -> str:
    return f'<ssd:System name="{name}">{content}</ssd:System>'


MATRIX, OUT = port("matrix", "input", f"<ssc:Float64/>{SIZE}"), port("grid", "output", f"<ssc:Float64/>{SIZE}")


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., SystemDescription]:
    """The system of an archive of SSP 2.0."""

    def make(content: str, *changes: tuple[str, str], grid: bool = True, **files: str) -> SystemDescription:
        members: dict[str, str | bytes | Path] = {
            "SystemStructure.ssd": two(ssd(content, "")),
            "resources/types.fmu": types3(tmp_path / "types.fmu", *((GRID,) if grid else ()), *changes),
        }
        members |= {f"resources/{name.replace('_', '.')}": two(text) for name, text in files.items()}
        return read_ssp(pack(tmp_path / "two.ssp", members), None)

    return make


@pytest.fixture
def start(read: Callable[..., SystemDescription]) -> Callable[..., dict[str, StartValue]]:
    """Some start values of the part p."""

    def values(bindings: str, *names: str, **files: str) -> dict[str, StartValue]:
        found = read(system(part("p", bindings=bindings)), **files).start
        return {name: found[f"p.{name}"] for name in names}

    return values


def value(name: str, kind: str, text: str, *sizes: int) -> str:
    shape = "".join(f'<ssc:Dimension size="{size}"/>' for size in sizes)
    return f'<ssv:Parameter name="{name}"><ssv:{kind} value="{text}"/>{shape}</ssv:Parameter>'


def values(name: str, kind: str, *texts: str) -> str:
    inside = "".join(f'<ssv:Value value="{text}"/>' for text in texts)
    return (
        f'<ssv:Parameter name="{name}"><ssv:{kind}>{inside}</ssv:{kind}>'
        f'<ssc:Dimension size="{len(texts)}"/></ssv:Parameter>'
    )


# ---- connections


def test_arrays_are_connected_element_by_element(read: Callable[..., SystemDescription]) -> None:
    found = read(system(part("a", OUT) + part("b", MATRIX), connection("b.matrix", "a.grid", LINEAR)))
    assert found.wires == tuple(Wire(f"a.grid{index}", f"b.matrix{index}", 2.0, 1.0) for index in ROWS)


def test_indices_select_elements(read: Callable[..., SystemDescription]) -> None:
    u, y = port("u", "input", "<ssc:Float64/>"), port("y", "output", "<ssc:Float64/>")
    joined = (
        connection("a.y", "b.matrix", endIndices="2 1")
        + connection("b.matrix", "a.grid", startIndices="1 3", endIndices="2 2")
        + connection("a.grid", "b.u", startIndices="1 1")
    )
    found = read(system(part("a", OUT, y) + part("b", MATRIX, u), joined))
    assert found.wires == (
        Wire("a.y", "b.matrix[2,1]"),
        Wire("a.grid[2,2]", "b.matrix[1,3]"),
        Wire("a.grid[1,1]", "b.u"),
    )


@pytest.mark.parametrize(
    "shape",
    [
        SIZE,
        "<ssc:Dimension/><ssc:Dimension/>",
        '<ssc:Dimension sizeConnector="rows"/><ssc:Dimension size="3"/>',
    ],
)
def test_arrays_pass_through_nested_systems(read: Callable[..., SystemDescription], shape: str) -> None:
    before = ports(port("rows", "structuralParameter", "<ssc:UInt64/>"), port("m", "input", shape))
    sub = inner("s", system(part("b", MATRIX), connection("m", "b.matrix"), before))
    found = read(system(part("a", OUT) + sub, connection("a.grid", "s.m")))
    assert found.wires == tuple(Wire(f"a.grid{index}", f"s_b.matrix{index}") for index in ROWS)


def test_all_types_of_connectors(read: Callable[..., SystemDescription]) -> None:
    kinds = {
        **{"single": "Float32", "i8": "Int8", "u8": "UInt8", "i16": "Int16", "u16": "UInt16"},
        **{"i32": "Int32", "u32": "UInt32", "i64": "Int64", "u64": "UInt64"},
    }
    listed = [
        port(name + end, kind, f"<ssc:{typed}/>")
        for name, typed in kinds.items()
        for end, kind in (("", "input"), ("_y", "output"))
    ]
    listed += [
        port("any", "output", "<ssc:Boolean/>"),
        port("flags", "input", '<ssc:Boolean/><ssc:Dimension size="2"/>'),
    ]
    listed += [port("blob", "input", '<ssc:Binary mime-type="a/b"/>'), port("text", "parameter", "<ssc:String/>")]
    joined = "".join(connection(f"a.{name}_y", f"b.{name}") for name in kinds)
    joined += connection("a.any", "b.flags", endIndices="2")
    found = read(system(part("a", *listed) + part("b", *listed), joined))
    assert found.wires == (*(Wire(f"a.{name}_y", f"b.{name}") for name in kinds), Wire("a.any", "b.flags[2]"))


# ---- parameters


def test_values_of_all_types(start: Callable[..., dict[str, StartValue]]) -> None:
    numbers = {
        **{"i8": ("Int8", "-128"), "u8": ("UInt8", "255"), "i16": ("Int16", "-32768"), "u16": ("UInt16", "65535")},
        **{"i32": ("Int32", "-2147483648"), "u32": ("UInt32", "4294967295"), "i64": ("Int64", "-9007199254740992")},
        **{"u64": ("UInt64", "9007199254740992"), "u": ("Float64", "0.1"), "single": ("Float32", "0.1")},
    }
    text = "".join(value(name, kind, number) for name, (kind, number) in numbers.items())
    text += value("text", "String", "b c") + value("gear", "Enumeration", "second")
    found = start(inline(text), *numbers, "text", "gear")
    single = 13421773 / 2**27  # the number of single precision next to 0.1
    assert found == {
        **{"i8": -128, "u8": 255, "i16": -(2**15), "u16": 2**16 - 1, "i32": -(2**31), "u32": 2.0**32 - 1},
        **{"i64": -(2.0**53), "u64": 2.0**53, "u": 0.1, "single": single, "text": "b c", "gear": 2},
    }


def test_arrays_are_in_row_major_order(start: Callable[..., dict[str, StartValue]]) -> None:
    text = value("matrix", "Float64", " 1 2\n3 4 5 6 ", 2, 3) + value("flags", "Boolean", "true 0", 2)
    found = start(inline(text), *(f"matrix{index}" for index in ROWS), "flags[1]", "flags[2]")
    assert list(found.values()) == [1, 2, 3, 4, 5, 6, True, False]


def test_units_prefixes_and_mappings_of_arrays(read: Callable[..., SystemDescription]) -> None:
    entries = f'<ssm:ParameterMapping {NAMESPACES} version="1.0"><ssm:MappingEntry source="x.M" target="p.matrix">'
    entries += f"{LINEAR}</ssm:MappingEntry></ssm:ParameterMapping>"
    units, *changes = METRES
    text = f'<ssv:Parameter name="M"><ssv:Float64 value="1 2 3 4 5 6" unit="mm"/>{SIZE}</ssv:Parameter>'
    binding = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/set.ssv" prefix="x.">'
        '<ssd:ParameterMapping source="resources/map.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
    )
    content = system(part("p"), before=binding)
    found = read(content, *changes, set_ssv=parameter_set(text, units), map_ssm=entries).start
    # k mm = k/1000 m, then 2 x + 1
    assert [found[f"p.matrix{index}"] for index in ROWS] == pytest.approx(
        [2e-3 * k + 1 for k in range(1, 7)], rel=1e-15
    )


def test_arrays_of_texts_and_items(
    read: Callable[..., SystemDescription], start: Callable[..., dict[str, StartValue]]
) -> None:
    texts = ('<Start value="a"/>', '<Dimension start="2"/><Start value="a"/><Start value="b"/>')
    gears = ('causality="input" start="1"/>', 'causality="input" start="1 1"><Dimension start="2"/></Enumeration>')
    bindings = inline(values("text", "String", "x  y", "") + values("gear", "Enumeration", "second", "first"))
    found = read(system(part("p", bindings=bindings)), texts, gears).start
    assert [found[f"p.{name}"] for name in ("text[1]", "text[2]", "gear[1]", "gear[2]")] == ["x  y", "", 2, 1]
    single = value("text", "String", "z") + '<ssv:Parameter name="gear"><ssv:Enumeration><ssv:Value value="second"/>'
    assert start(inline(single + "</ssv:Enumeration></ssv:Parameter>"), "text", "gear") == {"text": "z", "gear": 2}


VECTOR = value("vector", "Float64", "5 4 3 2 1", 5)


def test_sizes_come_from_bindings(read: Callable[..., SystemDescription], caplog: pytest.LogCaptureFixture) -> None:
    fixed = port("vector", "parameter", '<ssc:Dimension sizeConnector="n"/>')
    with caplog.at_level(logging.WARNING):
        found = read(system(part("p", fixed, bindings=inline(value("n", "UInt64", "5") + VECTOR))), grid=False)
    assert "no variable" not in caplog.text
    assert found.start["p.n"] == 5 and [found.start[f"p.vector[{k}]"] for k in range(1, 6)] == [5, 4, 3, 2, 1]
    with System(found.parts, found.wires, found.start) as made:
        result = made.run(stop=0.1, step=0.1, master="jacobi")
    assert float(result["p.weighted"][-1]) == 15


def test_sizes_pass_through_connectors(read: Callable[..., SystemDescription]) -> None:
    before = ports(port("count", "structuralParameter", "<ssc:UInt64/>"))
    p = part("p", port("n", "structuralParameter", "<ssc:UInt64/>"), bindings=inline(VECTOR))
    sub = inner("s", system(p, connection("count", "p.n"), before))
    outer = two(inline(value("s.count", "UInt64", "5")))
    found = read(system(sub, before=f"<ssd:ParameterBindings>{outer}</ssd:ParameterBindings>")).start
    assert (found["s_p.n"], found["s_p.vector[5]"]) == (5, 1)


def test_an_array_fits_an_fmu_with_a_variable_for_each_element(make_fmu: Callable[..., Path], tmp_path: Path) -> None:
    """Parameter sets of SSP 2.0 serve FMUs of FMI 2.0 as well."""
    fmu = make_fmu(('name="gain" valueReference="3"', 'name="gain[1]" valueReference="3"'))
    content = part("p", bindings=inline(value("gain", "Float64", "2.5", 1))).replace("types.fmu", "probe.fmu")
    path = pack(tmp_path / "a.ssp", {"SystemStructure.ssd": two(ssd(system(content), "")), "resources/probe.fmu": fmu})
    assert read_ssp(path, None).start["p.gain[1]"] == 2.5


# ---- what is refused

U, Y = port("u", "input", "<ssc:Float64/>"), port("y", "output", "<ssc:Float64/>")
BLOB = port("blob", "input", "<ssc:Binary/>"), port("bytes", "output", "<ssc:Binary/>")
UNKNOWN = ports(port("m", "input", "<ssc:Dimension/>"))
HUGE = ports(port("m", "input", f'<ssc:Dimension size="{2**64 - 1}"/>' * 3))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            system(part("a", OUT, Y) + part("b", MATRIX), connection("a.y", "b.matrix")),
            "joins a scalar and an array of",
        ),
        (
            system(part("a", OUT) + part("b", U), connection("a.grid", "b.u")),
            r"joins an array of size 2 x 3 and a scalar: connect arrays of equal size",
        ),
        (
            system(part("a", Y) + part("b", MATRIX), connection("a.y", "b.matrix", endIndices="0 1")),
            "has the indices 0 1, but 'b.matrix' is an array of size 2 x 3: give one index from 1 for each",
        ),
        (
            system(part("a", Y) + part("b", MATRIX), connection("a.y", "b.matrix", endIndices="2 4")),
            "has the indices 2 4",
        ),
        (system(part("a", Y) + part("b", MATRIX), connection("a.y", "b.matrix", endIndices="2")), "has the indices 2,"),
        (
            system(part("a", Y) + part("b", U), connection("a.y", "b.u", endIndices="1")),
            "has the indices 1, but 'b.u' is a scalar",
        ),
        (
            system(part("a", Y) + part("b", MATRIX), connection("a.y", "b.matrix", endIndices="1 1") * 2),
            r"drives 'b.matrix\[1,1\]' twice",
        ),
        (
            system(part("a", OUT) + part("b", MATRIX.replace('"3"', '"4"'))),
            "'b.matrix' is an array of size 2 x 4 in .* but an array of size 2 x 3 in its FMU: correct its Dimension",
        ),
        (
            system(part("a", OUT) + part("b", port("matrix", "input")), connection("a.grid", "b.matrix")),
            "'b.matrix' is a scalar in .* but an array of size 2 x 3 in its FMU",
        ),
        (
            system(part("b", port("u", "input", '<ssc:Dimension size="1"/>'))),
            "'b.u' is an array of size 1 in .* but a scalar in its FMU",
        ),
        (
            system(part("b", port("matrix", "input", '<ssc:Dimension size="2" sizeConnector="n"/>'))),
            "'b.matrix' in .* has a Dimension with both size and sizeConnector: remove one",
        ),
        (
            system(
                inner(
                    "s", system(part("b", port("odd", "input", "<ssc:Dimension/>")), connection("m", "b.odd"), UNKNOWN)
                )
            ),
            "'s.m' in .* is an array of unknown size: state the size",
        ),
        (system(inner("s", system(part("b"), before=HUGE))), "more than 1000000 elements: choose smaller arrays"),
        (
            system(part("b", port("clock", "input", "<ssc:Clock/>"))),
            "the connector 'b.clock' in .* is a clock, which is",
        ),
        (
            system(part("a", *BLOB) + part("b", *BLOB), connection("a.bytes", "b.blob")),
            "connects 'a.bytes' to 'b.blob' of type Binary, which is not supported: remove the connection",
        ),
        (
            system(part("a", port("z", "unspecified")) + part("b", U), connection("a.z", "b.u")),
            "connects 'a.z', which is of the kind unspecified: make it an input or output",
        ),
        (
            system(part("a", Y) + part("b", port("n", "structuralParameter")), connection("a.y", "b.n")),
            "connects 'a.y' to the parameter 'b.n', which is not supported: give the parameter a value instead",
        ),
        (system('<ssd:Component name="a"/>'), "component 'a' in .* has no source: add its FMU to the archive"),
        (
            system('<ssd:Component name="a" source="resources/types.fmu" implementation="ScheduledExecution"/>'),
            "component 'a' in .* asks for ScheduledExecution",
        ),
        (system(part("a", port("u", "input", "<ssc:Float16/>"))), "is not valid SSP 2.0: .*Float16"),
        (
            system(part("a", OUT) + part("b", MATRIX), connection("a.grid", "b.matrix", startIndices="x")),
            "not valid SSP 2.0",
        ),
    ],
)
def test_systems_that_are_refused(read: Callable[..., SystemDescription], content: str, message: str) -> None:
    with pytest.raises(SystemFileError, match=message) as caught:
        read(content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        (
            value("matrix", "Float64", "1 2 3", 2, 3),
            SystemFileError,
            "'matrix' in .* array of size 2 x 3, but has 3 values",
        ),
        (value("u", "Float64", "1 2"), SystemFileError, "'u' in .* is a scalar, but has 2 values"),
        (value("u", "Float64", ""), SystemFileError, "is a scalar, but has 0 values"),
        (
            value("vector", "Float64", "1 2 3 4", 4),
            SystemFileError,
            "has an array of size 4 for 'p.vector', which is an array of size 3: correct its Dimension",
        ),
        (
            value("matrix", "Float64", "1"),
            SystemFileError,
            "has a scalar for 'p.matrix', which is an array of size 2 x 3",
        ),
        (
            value("vector", "Float64", "1 2 3").replace("</ssv:P", "<ssc:Dimension/></ssv:P"),
            SystemFileError,
            "has a Dimension without a size",
        ),
        (
            value("vector", "Float64", "1 2 3").replace("</ssv:P", '<ssc:Dimension sizeConnector="n"/></ssv:P'),
            SystemFileError,
            "has a Dimension without a size",
        ),
        (
            value("vector", "Float64", "1", *[2**64 - 1] * 50),
            SystemFileError,
            "but has 1 values",
        ),
        (
            '<ssv:Parameter name="text"><ssv:String value="a"><ssv:Value value="b"/></ssv:String></ssv:Parameter>',
            SystemFileError,
            "has its value twice",
        ),
        ('<ssv:Parameter name="text"><ssv:String/></ssv:Parameter>', SystemFileError, "has 0 values"),
        (
            value("blob", "Binary", "00"),
            SystemFileError,
            "'blob' in .* is of type Binary, which no start value can have",
        ),
        (value("single", "Float32", "1e39"), SystemFileError, r"is 1e\+39, which is too large for Float32"),
        (value("u64", "UInt64", str(2**53 + 1)), StartValueError, "p.u64 is 9007199254740993, which is not exact"),
        (value("u8", "UInt8", "256"), SystemFileError, "is not valid SSP 2.0"),
        (value("i8", "Float64", "1"), StartValueError, "not of type Integer"),
        (
            value("vector", "Float64", "1 2 3", 3) + value("vector[2]", "Float64", "1"),
            SystemFileError,
            r"the parameter 'vector\[2\]' twice",
        ),
        (value("n", "Float64", "2.5"), StartValueError, "start value 2.5 of p.n is not a whole number: give a size"),
    ],
)
def test_values_that_are_refused(
    read: Callable[..., SystemDescription], parameters: str, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message) as caught:
        read(system(part("p", bindings=inline(parameters))))
    assert "\n" not in str(caught.value)


def test_arrays_are_unknown_to_ssp_1(tmp_path: Path) -> None:
    text = ssd(system(part("b", MATRIX)), "")
    path = pack(
        tmp_path / "a.ssp", {"SystemStructure.ssd": text, "resources/types.fmu": types3(tmp_path / "types.fmu")}
    )
    with pytest.raises(SystemFileError, match=r"is not valid SSP 1\.0"):
        System.from_ssp(path)
