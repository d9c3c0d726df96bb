"""Start values from the parameter bindings of .ssp archives."""

from __future__ import annotations

import io
import logging
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from ssp_files import NAMESPACES, POND, UNITS, component, connection, inline, pack, parameter_set, real, ssd, system

from friction_fmus import fmu
from harness import StartValueError, System, SystemFileError, UnitError
from harness.parts.part import StartValue
from harness.ssp import read_ssp

KILO = '<ssv:Units><ssc:Unit name="kN"><ssc:BaseUnit kg="1" m="1" s="-2" factor="1000"/></ssc:Unit></ssv:Units>'
STATUS = (
    (
        "<LogCategories>",
        '<TypeDefinitions><SimpleType name="Status"><Enumeration><Item name="Warning" value="1"/>'
        '<Item name="Error" value="3"/></Enumeration></SimpleType></TypeDefinitions><LogCategories>',
    ),
    ('<Integer start="3"/>', '<Enumeration declaredType="Status" start="3"/>'),
)


@pytest.fixture
def start(probe: Path, tmp_path: Path) -> Callable[..., dict[str, StartValue]]:
    """The start values of an archive, without those that the FMU states itself."""

    def read(content: str, fmu: Path = probe, rest: str = UNITS, **files: str) -> dict[str, StartValue]:
        members: dict[str, str | bytes | Path] = {
            "SystemStructure.ssd": ssd(content, rest),
            "resources/probe.fmu": fmu,
        }
        members |= {f"resources/{name.replace('_', '.')}": text for name, text in files.items()}
        found = read_ssp(pack(tmp_path / "foreign.ssp", members), None).start
        return {name: value for name, value in found.items() if value not in (0, False)}

    return read


def mapping(*entries: str) -> str:
    return f'<ssm:ParameterMapping {NAMESPACES} version="1.0">{"".join(entries)}</ssm:ParameterMapping>'


def entry(source: str, target: str, content: str = "", **attributes: str) -> str:
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f'<ssm:MappingEntry source="{source}" target="{target}"{text}>{content}</ssm:MappingEntry>'


def mapped(binding: str, content: str, **attributes: str) -> str:
    """A binding with a mapping in it."""
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return binding.replace(
        "</ssd:ParameterBinding>",
        f"<ssd:ParameterMapping{text}>{content}</ssd:ParameterMapping></ssd:ParameterBinding>",
    )


def bound(*bindings: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(bindings)}</ssd:ParameterBindings>"


def test_all_types(start: Callable[..., dict[str, StartValue]], make_fmu: Callable[..., Path]) -> None:
    typed = (
        '<ssv:Parameter name="n"><ssv:Integer value="-2"/></ssv:Parameter>'
        '<ssv:Parameter name="b"><ssv:Boolean value="1"/></ssv:Parameter>'
        '<ssv:Parameter name="label"><ssv:String value="x y"/></ssv:Parameter>'
        '<ssv:Parameter name="fail_status"><ssv:Enumeration value="Warning"/></ssv:Parameter>'
        '<ssv:Parameter name="gain"><ssv:Integer value="2"/></ssv:Parameter>'
    )
    found = start(system(component("p", inline(typed))), make_fmu(*STATUS, name="status.fmu"))
    assert found == {"p.n": -2, "p.b": True, "p.label": "x y", "p.fail_status": 1, "p.gain": 2.0}
    assert type(found["p.gain"]) is float


def test_files_and_units(start: Callable[..., dict[str, StartValue]]) -> None:
    binding = '<ssd:ParameterBinding source="resources/set.ssv"/>'
    files = {"set_ssv": parameter_set(real("u", 2.0, "kN") + real("gain", 3.0), KILO)}
    assert start(system(component("p", binding)), **files) == {"p.u": 2000.0, "p.gain": 3.0}


def test_a_unit_that_is_only_a_name(start: Callable[..., dict[str, StartValue]]) -> None:
    assert start(system(component("p", inline(real("u", 2.0, "mN"))))) == {"p.u": 0.002}
    for unit, force in (("lbf", 4.4482216152605), ("kgf", 9.80665)):
        assert start(system(component("p", inline(real("u", 2.0, unit))))) == {"p.u": pytest.approx(2.0 * force)}
    with pytest.raises(UnitError, match=r"the value of p\.u in .*\.ssp is in 'pond', which is not a known unit"):
        start(system(component("p", inline(real("u", 2.0, "pond")))))
    for unit in ("Nm", "rpm", "inch"):
        with pytest.raises(UnitError, match="measure different quantities"):
            start(system(component("p", inline(real("u", 2.0, unit)))))


def test_units_of_the_document_around_the_parameters(start: Callable[..., dict[str, StartValue]]) -> None:
    content = system(component("p", inline(real("u", 2.0, "pond"))))
    assert start(content, rest=POND) == {"p.u": pytest.approx(0.0196133)}


def test_a_number_for_a_variable_without_a_unit(
    start: Callable[..., dict[str, StartValue]], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert start(system(component("p", inline(real("gain", 2.0, "kN"))))) == {"p.gain": 2.0}
    assert "start value p.gain has no unit: the number 2.0 is taken as it is, in [1000 * kg.m.s-2]" in caplog.text


@pytest.mark.parametrize("elements", [3, 11])
def test_some_elements_of_an_array(start: Callable[..., dict[str, StartValue]], elements: int) -> None:
    values = " ".join(["1"] * elements)
    typed = f'<ssv:Parameter name="k"><ssv:Float64 value="{values}"/><ssc:Dimension size="{elements}"/></ssv:Parameter>'
    one = parameter_set(typed).replace('version="1.0"', 'version="2.0"')
    binding = '<ssd:ParameterBinding source="resources/set.ssv"/>'
    content = system(component("p", binding, connectors='<ssd:Connector name="v" kind="input"/>'))
    with pytest.raises(SystemFileError, match=rf"size {elements} for 'p\.k', which is an array of size 10"):
        start(content, fmu("GMS"), set_ssv=one)


def test_later_and_outer_bindings_win(start: Callable[..., dict[str, StartValue]]) -> None:
    inner = component("p", inline(real("gain", 1.0), real("u", 1.0), real("fail_time", 1.0)) + inline(real("u", 2.0)))
    sub = system(inner, before=bound(inline(real("p.fail_time", 3.0))))
    nested = f'<ssd:System name="s">{sub}</ssd:System>'
    outer = bound(inline(real("gain", 4.0), prefix="s.p."), inline(real("s.p.gain", 5.0)))
    assert start(system(nested, before=outer)) == {"s_p.gain": 5.0, "s_p.u": 2.0, "s_p.fail_time": 3.0}


def test_mapping(start: Callable[..., dict[str, StartValue]]) -> None:
    parameters = inline(real("Force", 2.0, "kN"), real("gain", 9.0), real("K", 0.5), units=KILO)
    linear = '<ssc:LinearTransformation factor="10" offset="1"/>'
    entries = mapping(entry("Force", "p.u", linear), entry("K", "p.gain"), entry("K", "q.gain", linear))
    content = system(component("p") + component("q"), before=bound(mapped(parameters, entries)))
    # 2 kN = 2000 N, then 10 x + 1; what is not mapped is not used
    assert start(content) == {"p.u": 20001.0, "p.gain": 0.5, "q.gain": 6.0}
    entries = mapping(entry("Force", "p.u", linear, suppressUnitConversion="true"))
    assert start(system(component("p"), before=bound(mapped(parameters, entries)))) == {"p.u": 21.0}


def test_mapping_in_a_file_with_prefix(start: Callable[..., dict[str, StartValue]]) -> None:
    parameters = '<ssd:ParameterBinding source="resources/set.ssv" prefix="x.">{}</ssd:ParameterBinding>'.format(
        '<ssd:ParameterMapping source="resources/map.ssm"/>'
    )
    files = {"set_ssv": parameter_set(real("k", 2.0)), "map_ssm": mapping(entry("x.k", "gain"))}
    assert start(system(component("p", parameters)), **files) == {"p.gain": 2.0}


def test_mapping_by_tables(start: Callable[..., dict[str, StartValue]], make_fmu: Callable[..., Path]) -> None:
    typed = (
        '<ssv:Parameter name="n"><ssv:Integer value="1"/></ssv:Parameter>'
        '<ssv:Parameter name="b"><ssv:Boolean value="false"/></ssv:Parameter>'
        '<ssv:Parameter name="e"><ssv:Enumeration value="bad"/></ssv:Parameter>'
    )
    rows = "<ssc:{0}MappingTransformation>{1}</ssc:{0}MappingTransformation>".format
    row = '<ssc:MapEntry source="{}" target="{}"/>'.format
    entries = mapping(
        entry("n", "n", rows("Integer", row(0, 5) + row(1, 7))),
        entry("b", "b", rows("Boolean", row("true", "false") + row("false", "true"))),
        entry("e", "fail_status", rows("Enumeration", row("good", "Warning") + row("bad", "Error"))),
    )
    content = system(component("p", mapped(inline(typed), entries)))
    assert start(content, make_fmu(*STATUS, name="s.fmu")) == {"p.n": 7, "p.b": True, "p.fail_status": 3}
    twice = mapping(entry("n", "n", rows("Integer", row(1, 5) + row(1, 7))))
    with pytest.raises(SystemFileError, match=r"the entry of 'n' in .* has a mapping with two entries for one source"):
        start(system(component("p", mapped(inline(typed), twice))))


def test_parameters_of_a_system_go_inside(start: Callable[..., dict[str, StartValue]]) -> None:
    connectors = (
        '<ssd:Connectors><ssd:Connector name="k" kind="parameter"/>'
        '<ssd:Connector name="force" kind="input"><ssc:Real unit="kN"/></ssd:Connector></ssd:Connectors>'
    )
    ports = '<ssd:Connector name="gain" kind="parameter"/><ssd:Connector name="u" kind="input"/>'
    joined = connection("k", "p.gain", '<ssc:LinearTransformation factor="2"/>') + connection("force", "p.u")
    sub = system(component("p", connectors=ports), joined, connectors)
    outer = bound(inline(real("s.k", 4.0), real("s.force", 3.0)))
    # a number without unit is in the unit of the connector: 3 kN
    assert start(system(f'<ssd:System name="s">{sub}</ssd:System>', before=outer)) == {"s_p.gain": 8.0, "s_p.u": 3000.0}


def test_parameters_in_the_fmu(start: Callable[..., dict[str, StartValue]], make_fmu: Callable[..., Path]) -> None:
    fmu = make_fmu(name="own.fmu", members={"resources/own.ssv": parameter_set(real("gain", 2.0)).encode()})
    binding = '<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component"/>'
    assert start(system(component("p", binding)), fmu) == {"p.gain": 2.0}
    with pytest.raises(SystemFileError, match="belongs to a system"):
        start(system(component("p"), before=bound(binding)), fmu)


def test_names_that_nothing_has(start: Callable[..., dict[str, StartValue]], caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        found = start(system(component("p", inline(real("Gain", 2.0))), before=bound(inline(real("p.y", 1.0)))))
    assert found == {}
    assert "there is no variable 'Gain', its value is ignored" in caplog.text


def test_start_values_of_connected_inputs_are_not_used(start: Callable[..., dict[str, StartValue]]) -> None:
    content = system(component("p", inline(real("u", 2.0))) + component("q"), connection("q.y", "p.u"))
    assert start(content) == {}


@pytest.mark.parametrize(
    ("bindings", "error", "message"),
    [
        (inline(real("u", 2.0, "kN").replace("kN", "m")), UnitError, r"joins \[m\] and \[kg.m.s-2\]"),
        (
            inline('<ssv:Parameter name="n"><ssv:Real value="2"/></ssv:Parameter>'),
            StartValueError,
            "2.0, .* not of type Integer",
        ),
        (
            inline('<ssv:Parameter name="u"><ssv:Boolean value="1"/></ssv:Parameter>'),
            StartValueError,
            "True, .* not of type Real",
        ),
        (
            inline('<ssv:Parameter name="n"><ssv:Enumeration value="on"/></ssv:Parameter>'),
            StartValueError,
            "p.n has no item 'on'",
        ),
        (
            inline('<ssv:Parameter name="n"><ssv:Binary value="00"/></ssv:Parameter>'),
            SystemFileError,
            "of type Binary",
        ),
        (inline(real("u", 1.0), real("u", 2.0)), SystemFileError, "the parameter 'u' twice"),
        (inline(real("u", 1.0), type="text/csv"), SystemFileError, "of type text/csv"),
        ('<ssd:ParameterBinding source="http://host/a.ssv"/>', SystemFileError, "not a file in the archive"),
        ('<ssd:ParameterBinding source="resources/none.ssv"/>', SystemFileError, "not in the archive"),
        ("<ssd:ParameterBinding/>", SystemFileError, "not a file in the archive"),
        (mapped(inline(real("u", 1.0)), "", type="text/csv", source="a"), SystemFileError, "mapping of type text/csv"),
        (
            mapped(inline(real("u", 1.0)), mapping(entry("u", "gain"), entry("v", "gain"))),
            SystemFileError,
            "maps two parameters to 'gain'",
        ),
        (
            mapped(
                inline(real("u", 1.0)),
                mapping(
                    entry(
                        "u",
                        "u",
                        '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
                        "</ssc:IntegerMappingTransformation>",
                    )
                ),
            ),
            StartValueError,
            "which its mapping does not contain",
        ),
    ],
)
def test_what_cannot_be_bound(
    start: Callable[..., dict[str, StartValue]], bindings: str, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message) as caught:
        start(system(component("p", bindings)))
    assert "\n" not in str(caught.value)


def test_a_broken_fmu_with_parameters(tmp_path: Path, probe: Path) -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("SystemStructure.ssd", ssd(system(component("p"))))
        archive.writestr("resources/probe.fmu", b"not an FMU")
    (tmp_path / "a.ssp").write_bytes(data.getvalue())
    with pytest.raises(Exception, match="is not an FMU"):
        System.from_ssp(tmp_path / "a.ssp")
