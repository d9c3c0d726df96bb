""".ssp archives of other tools: nested systems, units, transformations."""

from __future__ import annotations

import logging
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from ssp_files import NAMESPACES, POND, UNITS, component, connection, pack, ssd, system

from harness import Experiment, FmuPart, System, SystemFileError, UnconnectedError, UnitError, Wire
from harness.ssp import read_ssp

SUB = (
    '<ssd:Connectors><ssd:Connector name="force" kind="input"><ssc:Real unit="kN"/></ssd:Connector>'
    '<ssd:Connector name="result" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>'
)
LINEAR = '<ssc:LinearTransformation factor="{}" offset="{}"/>'


def nested(outer: str, inner: str) -> str:
    """q.y -> sub.force, a connector in kN, -> sub.p.u; the contents of the two connections."""
    sub = system(component("p"), connection("force", "p.u", inner) + connection("p.y", "result"), SUB)
    return system(component("q") + f'<ssd:System name="sub">{sub}</ssd:System>', outer)


@pytest.fixture
def archive(probe: Path, tmp_path: Path) -> Callable[..., Path]:
    def make(content: str, rest: str = UNITS, **fmus: Path) -> Path:
        members: dict[str, str | bytes | Path] = {
            "SystemStructure.ssd": ssd(content, rest),
            "resources/probe.fmu": probe,
        }
        members |= {f"resources/{name}.fmu": path for name, path in fmus.items()}
        return pack(tmp_path / "foreign.ssp", members)

    return make


def wires(path: Path) -> tuple[Wire, ...]:
    return read_ssp(path, None).wires


def test_nested_systems_are_dissolved(archive: Callable[..., Path]) -> None:
    back = connection("sub.result", "q.u")
    with System.from_ssp(archive(nested(connection("q.y", "sub.force"), ""))) as read:
        assert list(read.parts) == ["q", "sub_p"]
        assert read.wires == (Wire("q.y", "sub_p.u"),)  # through kN and back is exactly 1
    loop = wires(archive(nested(connection("q.y", "sub.force") + back, "")))
    assert set(loop) == {Wire("q.y", "sub_p.u"), Wire("sub_p.y", "q.u")}


def test_ends_in_the_other_order(archive: Callable[..., Path]) -> None:
    content = nested(connection("sub.force", "q.y", LINEAR.format(2, 0)), LINEAR.format(3, 7))
    assert wires(archive(content)) == (Wire("q.y", "sub_p.u", 6.0, 7.0),)


def test_a_connector_feeds_several_inputs(archive: Callable[..., Path]) -> None:
    inner = connection("force", "p.u") + connection("force", "r.u")
    sub = system(component("p") + component("r"), inner, SUB)
    content = system(component("q") + f'<ssd:System name="s">{sub}</ssd:System>', connection("q.y", "s.force"))
    assert set(wires(archive(content))) == {Wire("q.y", "s_p.u"), Wire("q.y", "s_r.u")}


def test_an_empty_name_of_an_element_is_the_system(archive: Callable[..., Path]) -> None:
    inner = connection("force", "p.u").replace("startConnector", 'startElement="" startConnector')
    back = connection("p.y", "result").replace("endConnector", 'endElement="" endConnector')
    sub = system(component("p"), inner + back, SUB)
    content = system(component("q") + f'<ssd:System name="s">{sub}</ssd:System>', connection("q.y", "s.force"))
    assert wires(archive(content)) == (Wire("q.y", "s_p.u"),)


def test_an_fmu_of_both_kinds_that_is_wanted_for_model_exchange(
    archive: Callable[..., Path], make_fmu: Callable[..., Path], caplog: pytest.LogCaptureFixture
) -> None:
    both = make_fmu(("<CoSimulation", '<ModelExchange modelIdentifier="probe"/><CoSimulation'), name="both.fmu")
    content = system(component("p", source="resources/both.fmu")).replace(
        "source=", 'implementation="ModelExchange" source='
    )
    with caplog.at_level(logging.WARNING), System.from_ssp(archive(content, both=both)) as read:
        read.run(stop=1.0, step=0.5)
    assert "component 'p' in" in caplog.text and "both.fmu is run by its co-simulation" in caplog.text


def test_transformations_follow_conversions(archive: Callable[..., Path]) -> None:
    # y N = y/1000 kN; 2 y/1000 + 0.5 kN = 2 y + 500 N; 3 (2 y + 500) + 7 N
    outer = connection("q.y", "sub.force", LINEAR.format(2, 0.5))
    (wire,) = wires(archive(nested(outer, LINEAR.format(3, 7))))
    assert (wire.gain, wire.offset) == pytest.approx((6.0, 1507.0), rel=1e-15)


def test_suppressed_conversion(archive: Callable[..., Path]) -> None:
    # the number of N is taken for one of kN
    (wire,) = wires(archive(nested(connection("q.y", "sub.force", suppressUnitConversion="true"), "")))
    assert (wire.gain, wire.offset) == pytest.approx((1000.0, 0.0), rel=1e-15)


INCH = ('<Unit name="N">', '<Unit name="inch"><BaseUnit m="1" factor="0.0254"/></Unit><Unit name="N">')
IN_INCH = ('push"><Real unit="N"', 'push"><Real unit="inch"')


@pytest.mark.parametrize(
    ("content", "attributes", "gain", "offset"),
    [
        ("", {}, 1.0, 0.0),  # the wire converts by itself
        (LINEAR.format(2, 3), {}, 2.0, 3.0),
        ("", {"suppressUnitConversion": "1"}, 1 / 7920, 0.0),  # a furlong has 7920 inches
        (LINEAR.format(7920, 3), {"suppressUnitConversion": "true"}, 1.0, 3.0),
    ],
)
def test_ports_in_different_units(
    archive: Callable[..., Path],
    make_fmu: Callable[..., Path],
    content: str,
    attributes: dict[str, str],
    gain: float,
    offset: float,
) -> None:
    x = '<ssd:Connector name="x" kind="output"/>'
    elements = component("q", connectors=x) + component("p", source="resources/inch.fmu")
    path = archive(
        system(elements, connection("q.x", "p.u", content, **attributes)), inch=make_fmu(INCH, IN_INCH, name="inch.fmu")
    )
    (wire,) = wires(path)
    assert (wire.gain, wire.offset) == pytest.approx((gain, offset), rel=1e-12)


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (1 / 3, -0.7), (-0.1, 1e9)])
def test_conversion_is_written_for_tools_without_units(
    make_fmu: Callable[..., Path], tmp_path: Path, gain: float, offset: float
) -> None:
    parts = {"q": FmuPart("q", make_fmu()), "p": FmuPart("p", make_fmu(INCH, IN_INCH, name="inch.fmu"))}
    wire = Wire("q.x", "p.u", gain, offset, delay=2)
    rest = {"q.u": 0.0, "q.n": 0, "q.b": False, "p.n": 0, "p.b": False}
    System(parts.values(), [wire], rest).to_ssp(tmp_path / "a.ssp")
    assert wires(tmp_path / "a.ssp") == (wire,)
    with zipfile.ZipFile(tmp_path / "a.ssp") as archive:
        text = archive.read("SystemStructure.ssd").decode()
    found = re.search(
        r'<ssd:Connection [^>]*suppressUnitConversion="true">\s*<ssc:L\w+ factor="(.*?)" offset="(.*?)"', text
    )
    assert found is not None
    # a furlong has 7920 inches
    assert [float(number) for number in found.groups()] == pytest.approx([7920 * gain, offset], rel=1e-12)
    # somebody else changes the transformation: what it says counts
    changed = text.replace(f'factor="{found[1]}"', f'factor="{float(found[1]) * 2!r}"')
    members = {
        "SystemStructure.ssd": changed,
        **{f"resources/{path.name}": path for path in (parts[n].path for n in "pq")},
    }
    (doubled,) = wires(pack(tmp_path / "b.ssp", members))
    assert (doubled.gain, doubled.offset, doubled.delay) == pytest.approx((2 * gain, offset, 2), rel=1e-12)


def test_units_that_only_the_file_states(archive: Callable[..., Path], make_fmu: Callable[..., Path]) -> None:
    # the FMU has no unit, so that the wire cannot know the conversion and has to be told
    bare = make_fmu(('push"><Real unit="N"', 'push"><Real'), name="bare.fmu")
    u = '<ssd:Connector name="u" kind="input"><ssc:Real unit="inch"/></ssd:Connector>'
    x = '<ssd:Connector name="x" kind="output"/>'
    elements = component("q", connectors=x) + component("p", source="resources/bare.fmu", connectors=u)
    (wire,) = wires(archive(system(elements, connection("q.x", "p.u")), bare=bare))
    assert (wire.gain, wire.offset) == pytest.approx((7920.0, 0.0), rel=1e-12)


def test_a_connector_in_a_unit_that_nobody_defines(archive: Callable[..., Path], make_fmu: Callable[..., Path]) -> None:
    outside = SUB.replace('"kN"', '"pond"')
    sub = system(component("p"), connection("force", "p.u"), outside)
    content = system(component("q") + f'<ssd:System name="sub">{sub}</ssd:System>', connection("q.y", "sub.force"))
    with pytest.raises(UnitError, match=r"the connector 'sub\.force' in .* is in 'pond', which is not a known unit"):
        wires(archive(content))
    assert wires(archive(content, POND)) == (Wire("q.y", "sub_p.u"),)
    # a unit that the FMU defines
    x = '<ssd:Connector name="x" kind="output"><ssc:Real unit="furlong"/></ssd:Connector>'
    elements = component("q", connectors=x) + component("p", source="resources/inch.fmu")
    path = archive(system(elements, connection("q.x", "p.u")), "", inch=make_fmu(INCH, IN_INCH, name="inch.fmu"))
    assert wires(path) == (Wire("q.x", "p.u"),)


def test_units_with_an_offset(archive: Callable[..., Path], make_fmu: Callable[..., Path]) -> None:
    warm = make_fmu(
        (
            '<Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>',
            '<Unit name="C"><BaseUnit K="1" offset="273.15"/></Unit>',
        ),
        ('push"><Real unit="N"', 'push"><Real unit="C"'),
        ('gain times u"><Real unit="N"', 'gain times u"><Real unit="C"'),
        name="warm.fmu",
    )
    connectors = (
        '<ssd:Connectors><ssd:Connector name="t" kind="input"><ssc:Real unit="K"/></ssd:Connector></ssd:Connectors>'
    )
    sub = system(component("p", source="resources/warm.fmu"), connection("t", "p.u"), connectors)
    elements = component("q", source="resources/warm.fmu") + f'<ssd:System name="s">{sub}</ssd:System>'
    units = '<ssd:Units><ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit></ssd:Units>'
    plain = archive(system(elements, connection("q.y", "s.t")), units, warm=warm)
    assert wires(plain) == (Wire("q.y", "s_p.u"),)
    # 2 (C + 273.15) K = 2 C + 546.3 K = 2 C + 273.15 degrees Celsius
    (wire,) = wires(archive(system(elements, connection("q.y", "s.t", LINEAR.format(2, 0))), units, warm=warm))
    assert (wire.gain, wire.offset) == pytest.approx((2.0, 273.15), rel=1e-12)


def test_inputs_that_nothing_drives_keep_their_start_value(
    archive: Callable[..., Path], make_fmu: Callable[..., Path]
) -> None:
    started = make_fmu(('<Real unit="N" start="0"/>', '<Real unit="N" start="2.5"/>'), name="started.fmu")
    outside = '<ssd:Connectors><ssd:Connector name="in" kind="input"/></ssd:Connectors>'
    path = archive(
        system(component("p", source="resources/started.fmu"), connection("in", "p.u"), outside), started=started
    )
    with System.from_ssp(path) as read:
        assert read.start == {"p.u": 2.5, "p.n": 0, "p.b": False}
        assert float(read.run(stop=1.0, step=1.0)["p.y"][0]) == 2.5


@pytest.mark.parametrize(
    ("rest", "experiment"),
    [
        ("", None),
        ('<ssd:DefaultExperiment startTime="1" stopTime="3"/>', None),
        ('<ssd:DefaultExperiment startTime="1" stopTime="3">{}</ssd:DefaultExperiment>', Experiment(3.0, 0.5, 1.0)),
        ('<ssd:DefaultExperiment stopTime="3">{}</ssd:DefaultExperiment>', Experiment(3.0, 0.5)),
        ("<ssd:DefaultExperiment>{}</ssd:DefaultExperiment>", None),
    ],
)
def test_experiment_of_other_tools(archive: Callable[..., Path], rest: str, experiment: Experiment | None) -> None:
    osp = (
        '<ssd:Annotations><ssc:Annotation type="com.other"><x/></ssc:Annotation>'
        '<ssc:Annotation type="com.opensimulationplatform">'
        '<osp:Algorithm xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">'
        '<osp:FixedStepAlgorithm baseStepSize="0.5"/></osp:Algorithm></ssc:Annotation></ssd:Annotations>'
    )
    assert read_ssp(archive(system(component("p")), rest.format(osp)), None).experiment == experiment


def test_experiment_that_does_not_fit(archive: Callable[..., Path], caplog: pytest.LogCaptureFixture) -> None:
    own = (
        '<ssd:DefaultExperiment stopTime="1"><ssd:Annotations><ssc:Annotation type="friction-fmus.harness">'
        '<h:Experiment xmlns:h="urn:friction-fmus:harness" master="jacobi" decimate="1" step="{}"/>'
        "</ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>"
    )
    with caplog.at_level(logging.WARNING):
        assert read_ssp(archive(system(component("p")), own.format("0.3")), None).experiment is None
    assert "does not divide" in caplog.text
    with pytest.raises(SystemFileError, match="malformed experiment"):
        read_ssp(archive(system(component("p")), own.format("often")), None)


def test_names_with_dots(archive: Callable[..., Path]) -> None:
    path = archive(system(component("a.b") + component("q"), connection("q.y", "a.b.u")))
    assert wires(path) == (Wire("q.y", "a_b.u"),)


DICTIONARY = '<ssd:SignalDictionaries><ssd:SignalDictionary name="d" source="d.ssb"/></ssd:SignalDictionaries>'
PARAMETER = '<ssd:Connector name="gain" kind="parameter"/>'
TABLE = '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/></ssc:IntegerMappingTransformation>'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (system(component("p")) + DICTIONARY, "has signal dictionaries"),
        (system('<ssd:SignalDictionaryReference name="r" dictionary="d"/>'), "has signal dictionaries"),
        (system(component("p")).replace("source=", 'type="application/x-ssp-package" source='), "type .*x-ssp-package"),
        (system(component("p")).replace("source=", 'implementation="ModelExchange" source='), "only offers CoSimul"),
        (system(component("p", source="http://host/p.fmu")), "not a file in the archive"),
        (system(component("p", source="../p.fmu")), "not a file in the archive"),
        (system(component("p", source="%2e%2e/p.fmu")), "not a file in the archive"),
        (system(component("p", source="/etc/passwd")), "not a file in the archive"),
        (system(component("p", source="#other")), "not a file in the archive"),
        (system(component("p", source="resources/none.fmu")), "which is not in the archive"),
        (system(component("p") + component("p")), "two elements 'p'"),
        (system(component("p.a") + component("p_a")), "would be called 'p_a', like 'p.a'"),
        (system(component("p"), connection("p.y", "q.u")), "connects 'q.u', which is not a connector"),
        (system(component("p"), connection("p.y", "p.twice_n")), "of which both give a value"),
        (system(component("p"), connection("p.u", "p.n")), "of which none gives a value"),
        (system(component("p"), connection("p.y", "p.u") * 2), "drives 'p.u' twice"),
        (system(component("p") + component("q"), connection("p.twice_n", "q.n", TABLE)), "maps values by a table"),
        (
            system(
                component("p", connectors='<ssd:Connector name="fail_time" kind="calculatedParameter"/>')
                + component("q", connectors=PARAMETER),
                connection("p.fail_time", "q.gain"),
            ),
            "to the parameter 'q.gain'",
        ),
        (system(component("p")).replace('name="p"', ""), "not valid SSP 1.0"),
        (system(component("p")).replace('kind="input"', 'kind="inputs"'), "not valid SSP 1.0"),
    ],
)
def test_what_cannot_be_read(archive: Callable[..., Path], content: str, message: str) -> None:
    with pytest.raises(SystemFileError, match=message) as caught:
        System.from_ssp(archive(content))
    assert "\n" not in str(caught.value)


def test_a_circle_of_system_connectors(archive: Callable[..., Path]) -> None:
    through = (
        '<ssd:Connectors><ssd:Connector name="i" kind="input"/><ssd:Connector name="o" kind="output"/></ssd:Connectors>'
        '<ssd:Connections><ssd:Connection startConnector="i" endConnector="o"/></ssd:Connections>'
    )
    round_ = connection("a.o", "b.i") + connection("b.o", "a.i")
    elements = f'<ssd:System name="a">{through}</ssd:System><ssd:System name="b">{through}</ssd:System>'
    System.from_ssp(archive(system(elements, round_))).close()  # nothing is in the circle
    tapped = connection("a.o", "p.u")
    with pytest.raises(SystemFileError, match="is part of a cycle"):
        System.from_ssp(archive(system(elements + component("p"), round_ + tapped)))


def test_different_quantities(archive: Callable[..., Path]) -> None:
    path = archive(
        system(
            component(
                "p", connectors=('<ssd:Connector name="x" kind="output"/><ssd:Connector name="u" kind="input"/>')
            ),
            connection("p.x", "p.u"),
        )
    )
    with pytest.raises(UnitError, match=r"the connection p.x -> p.u joins \[201.168 \* m\] and \[kg.m.s-2\]"):
        System.from_ssp(path)


@pytest.mark.parametrize("number", ['factor="0"', 'factor="INF"', 'factor="NaN"', 'offset="-INF"', 'm="100"'])
def test_a_unit_that_is_none(archive: Callable[..., Path], number: str) -> None:
    units = f'<ssd:Units><ssc:Unit name="odd"><ssc:BaseUnit {number}/></ssc:Unit></ssd:Units>'
    with pytest.raises(UnitError, match="the unit 'odd' is malformed") as caught:
        System.from_ssp(archive(system(component("p")), units))
    assert "\n" not in str(caught.value)


def test_file_and_fmu_disagree(archive: Callable[..., Path]) -> None:
    u = '<ssd:Connector name="u" kind="input"><ssc:Real unit="kN"/></ssd:Connector>'
    with pytest.raises(UnitError, match=r"'p.u' is in \[1000 \* kg.m.s-2\] .* but in \[kg.m.s-2\] in its FMU"):
        System.from_ssp(archive(system(component("p", connectors=u))))


@pytest.mark.parametrize(
    ("name", "members", "message"),
    [
        ("none.ssp", None, "cannot open"),
        ("a.ssp", {}, "it has no SystemStructure.ssd"),
        ("a.ssp", {"SystemStructure.ssd": "<ssd:"}, "is not XML"),
        ("a.ssp", {"SystemStructure.ssd": f"<ssv:ParameterSet {NAMESPACES}/>"}, "starts with"),
        (
            "a.ssp",
            {"SystemStructure.ssd": ssd("").replace('version="1.0"', 'version="3.0"')},
            "is of version 3.0: export it",
        ),
        ("a.ssp", {"SystemStructure.ssd": ssd(""), "../evil": ""}, "'../evil' points outside"),
        ("a.ssp", {"SystemStructure.ssd": ssd(""), "/evil": ""}, "'/evil' points outside"),
    ],
)
def test_archives_that_are_refused(
    tmp_path: Path, name: str, members: dict[str, str | bytes | Path] | None, message: str
) -> None:
    if members is not None:
        pack(tmp_path / name, members)
    with pytest.raises(SystemFileError, match=message) as caught:
        System.from_ssp(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_archive(tmp_path: Path) -> None:
    (tmp_path / "a.ssp").write_text("text")
    with pytest.raises(SystemFileError, match="not a zip archive"):
        System.from_ssp(tmp_path / "a.ssp")


def test_entities_of_the_file_system_are_not_read(archive: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("token")
    text = f'<!DOCTYPE d [<!ENTITY e SYSTEM "{(tmp_path / "secret").as_uri()}">]>' + ssd("").replace(
        '<ssd:System name="root">', '<ssd:System name="root">&e;'
    )
    path = pack(tmp_path / "entity.ssp", {"SystemStructure.ssd": text})
    with pytest.raises(SystemFileError, match="has a DOCTYPE"):
        System.from_ssp(path)


def test_errors_of_the_system_are_those_of_any_system(
    archive: Callable[..., Path], make_fmu: Callable[..., Path]
) -> None:
    silent = make_fmu(
        ('description="push"><Real unit="N" start="0"/>', 'description="push"><Real unit="N"/>'), name="s.fmu"
    )
    with pytest.raises(UnconnectedError, match=r"^p\S* is not connected"):
        System.from_ssp(archive(system(component("p", source="resources/s.fmu")), s=silent))
