"""Each rule of modelDescription.xml finds the fault that it is for, and no other rule does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from check.broken import (
    XML,
    Edit,
    append,
    contents,
    edited,
    index_of,
    remove,
    twice,
    typed,
    unknown,
    variable,
    zipped,
)
from fmpy.model_description import ValidationError
from lxml import etree

from friction_fmus.check import RULES, check

ENUMERATION = '<SimpleType name="Kind"><Enumeration>{}</Enumeration></SimpleType>'
ONE, TWO = '<Item name="one" value="1"/>', '<Item name="two" value="2"/>'


def add_type(root: etree._Element, text: str) -> None:
    append(root, "TypeDefinitions", text)


def add_variable(root: etree._Element, text: str) -> None:
    append(root, "ModelVariables", text)


def enumerated(root: etree._Element, items: str, start: int = 1) -> None:
    """A parameter of a new enumeration."""
    add_type(root, ENUMERATION.format(items))
    add_variable(
        root,
        '<ScalarVariable name="kind" valueReference="900" causality="parameter" variability="fixed">'
        f'<Enumeration declaredType="Kind" start="{start}"/></ScalarVariable>',
    )


def add_tools(root: etree._Element, *names: str) -> None:
    annotations = root.find("VendorAnnotations")
    assert annotations is not None
    annotations.extend(etree.fromstring(f'<Tool name="{name}"><x/></Tool>') for name in names)


def swap_initial(root: etree._Element) -> None:
    parent = root.find("ModelStructure/InitialUnknowns")
    parent.append(parent[0])


def experiment(**values: str) -> Edit:
    return lambda root: root.find("DefaultExperiment").attrib.update(values)


def real(name: str, /, **values: str) -> Edit:
    return lambda root: typed(root, name).attrib.update(values)


def scalar(name: str, /, **values: str) -> Edit:
    return lambda root: variable(root, name).attrib.update(values)


def simulation(**values: str) -> Edit:
    return lambda root: root.find("CoSimulation").attrib.update(values)


def base(**values: str) -> Edit:
    """Of the unit N."""
    return lambda root: root.find("UnitDefinitions/Unit[@name='N']/BaseUnit").attrib.update(values)


def unit(name: str) -> Callable[[etree._Element], etree._Element]:
    return lambda root: root.find(f"UnitDefinitions/Unit[@name='{name}']")


# rule -> faults; each is one edit, and what the message must name
FAULTS: dict[str, list[tuple[Edit, str]]] = {
    "schema": [
        (lambda root: root.attrib.pop("guid"), "guid"),
        (lambda root: root.find("ModelVariables").append(etree.Element("Surprise")), "Surprise"),
        (experiment(stepSize="short"), "short"),
    ],
    "fmi-version": [
        (lambda root: root.set("fmiVersion", "1.0"), "1.0"),
        (lambda root: root.set("fmiVersion", "2.0.5"), "2.0.5"),
        (lambda root: setattr(root, "tag", "model"), "model"),
    ],
    "no-interface": [
        (
            lambda root: (remove(root.find("CoSimulation")), remove(root.find("ModelExchange"))),
            "neither CoSimulation nor ModelExchange",
        )
    ],
    "model-identifier": [
        (simulation(modelIdentifier="3 bad"), "3 bad"),
        (simulation(modelIdentifier="Lu.Gre"), "Lu.Gre"),
        (simulation(modelIdentifier="double"), "double"),
    ],
    "guid-empty": [(lambda root: root.set("guid", " "), "hash")],
    "generation-date": [
        (lambda root: root.set("generationDateAndTime", "2026-11-20T10:00:00+01:00"), "in UTC"),
        (lambda root: root.set("generationDateAndTime", "2026-11-20T10:00:00"), "2026-12-31T23:59:59Z"),
    ],
    "metadata-missing": [(lambda root: root.attrib.pop("license"), "license")],
    "needs-tool": [(simulation(needsExecutionTool="true"), "tool")],
    "serialize-without-state": [(simulation(canGetAndSetFMUstate="false"), "canSerializeFMUstate")],
    "duplicate-source-file": [(lambda root: twice(root.find("CoSimulation/SourceFiles/File")), "LuGre.c")],
    "duplicate-category": [(lambda root: twice(root.find("LogCategories/Category")), "logStatusWarning")],
    "duplicate-annotation": [(lambda root: add_tools(root, "a", "b", "a"), "'a'")],
    "experiment": [
        (experiment(startTime="2", stopTime="1"), "stopTime 1"),
        (experiment(stopTime="0"), "stopTime 0"),
        (experiment(stepSize="2"), "stepSize 2"),
        (experiment(stepSize="0"), "positive"),
        (experiment(tolerance="-1"), "positive"),
        (experiment(stopTime="INF"), "not finite"),
    ],
    "duplicate-unit": [
        (lambda root: twice(unit("N")(root)), "'N'"),
        (lambda root: twice(unit("m/s")(root).find("DisplayUnit")), "mm/s"),
    ],
    "unit-undefined": [
        (
            lambda root: (
                remove(unit("N.s/m")(root))
                or remove(root.find(".//SimpleType[@name='TranslationalDamping']"))
                or [v.attrib.pop("declaredType") for v in root.iter("Real") if v.get("unit") == "N.s/m"]
            ),
            "N.s/m",
        ),
        (real("delta", unit=""), "omit the attribute"),
    ],
    "display-unit-undefined": [(real("v", displayUnit="km/h"), "km/h")],
    "unit-exponents": [(base(kg="2"), "kg2"), (base(s="2"), "s2")],
    "unit-factor": [(base(factor="1000"), "1000"), (base(offset="273"), "273")],
    "unit-without-base": [(lambda root: remove(unit("N")(root).find("BaseUnit")), "'N'")],
    "duplicate-type": [(lambda root: twice(root.find("TypeDefinitions/SimpleType")), "Time")],
    "type-and-variable": [
        (lambda root: add_type(root, '<SimpleType name="Fc"><Real/></SimpleType>'), "'Fc'"),
    ],
    "type-unknown": [(real("Fc", declaredType="Phlogiston"), "Phlogiston")],
    "type-mismatch": [
        (lambda root: typed(root, "asymmetric").set("declaredType", "Force"), "asymmetric"),
    ],
    "enumeration-items": [
        (lambda root: enumerated(root, ONE + TWO.replace('"2"', '"1"')), "value '1'"),
        (lambda root: enumerated(root, ONE + TWO.replace('"two"', '"one"')), "name 'one'"),
    ],
    "duplicate-variable": [(scalar("Fs", name="Fc"), "'Fc'")],
    "variable-name": [
        (scalar("Fs", name="der(-)"), "der(-)"),
        (scalar("Fs", name="123"), "123"),
        (scalar("Fs", name="'\\z'"), "'\\\\z'"),
        (scalar("Fs", name="a..b"), "a..b"),
        (scalar("asymmetric", name="der(asymmetric)"), "its type is Boolean"),
        (
            lambda root: (
                root.attrib.pop("variableNamingConvention")
                and scalar("Fs", name="a&#10;b".replace("&#10;", "\n"))(root)
            ),
            "a\\nb",
        ),
    ],
    "variability": [
        (scalar("Fc", variability="continuous"), "fixed or tunable"),
        (scalar("v", variability="fixed"), "continuous or discrete"),
        (scalar("time", variability="discrete"), "continuous"),
        (
            lambda root: add_variable(
                root, '<ScalarVariable name="n" valueReference="900"><Integer/></ScalarVariable>'
            ),
            "the default",
        ),
    ],
    "initial": [
        (scalar("v", initial="exact"), "nothing"),
        (scalar("Fc", initial="approx"), "exact"),
        (scalar("time", initial="exact"), "nothing"),
    ],
    "start-missing": [
        (lambda root: typed(root, "Fc").attrib.pop("start"), "Fc"),
        (lambda root: typed(root, "v").attrib.pop("start"), "v"),
    ],
    "start-forbidden": [(real("F", start="0"), "F"), (real("time", start="0"), "time")],
    "start-outside-limits": [
        (real("Fc", start="-1"), "below its min"),
        (real("delta", start="101"), "above its max"),
        (lambda root: enumerated(root, ONE + TWO, start=3), "not an item"),
    ],
    "number-not-finite": [
        (real("Fc", start="NaN"), "NaN"),
        (real("v", start="INF"), "INF"),
        (real("v", max="INF"), "max"),
    ],
    "limits-reversed": [
        (real("v", min="2", max="-2"), "min 2 above max -2"),
        (lambda root: root.find(".//SimpleType[@name='Time']/Real").attrib.update({"min": "2", "max": "1"}), "Time"),
    ],
    "nominal": [(real("z", nominal="0"), "nominal 0"), (real("z", nominal="-1"), "nominal -1")],
    "value-reference-shared": [
        (lambda root: variable(root, "Fs").set("valueReference", variable(root, "Fc").get("valueReference")), "Fc, Fs"),
        (
            lambda root: variable(root, "der(z)").set("valueReference", variable(root, "F").get("valueReference")),
            "unit",
        ),
        (
            lambda root: add_variable(
                root,
                f'<ScalarVariable name="z2" valueReference="{variable(root, "z").get("valueReference")}" '
                'variability="discrete"><Real unit="m"/></ScalarVariable>',
            ),
            "variability",
        ),
    ],
    "independent": [
        (
            lambda root: add_variable(
                root,
                '<ScalarVariable name="t2" valueReference="900" causality="independent" '
                'variability="continuous"><Real/></ScalarVariable>',
            ),
            "t2",
        ),
    ],
    "time-name": [(scalar("time", name="clock"), "'clock'")],
    "derivative-of": [
        (real("der(z)", derivative="99"), "99"),
        (lambda root: typed(root, "der(z)").set("derivative", index_of(root, "der(z)")), "der(z)"),
    ],
    "multiple-set": [(scalar("Fc", canHandleMultipleSetPerTimeInstant="false"), "Fc")],
    "reinit": [(lambda root: (remove(root.find("ModelExchange")), real("z", reinit="true")(root)), "z")],
    "structure-index": [
        (lambda root: append(root, "ModelStructure/Outputs", '<Unknown index="99"/>'), "99"),
        (lambda root: append(root, "ModelStructure/Outputs", '<Unknown index="0"/>'), "count from 1"),
        (lambda root: twice(unknown(root, "Outputs", "F")), "twice"),
    ],
    "outputs": [
        (lambda root: remove(root.find("ModelStructure/Outputs")), "does not list F"),
        (lambda root: append(root, "ModelStructure/Outputs", f'<Unknown index="{index_of(root, "z")}"/>'), "lists z"),
    ],
    "derivatives": [
        (lambda root: append(root, "ModelStructure/Derivatives", f'<Unknown index="{index_of(root, "z")}"/>'), "z in"),
    ],
    "derivatives-missing": [
        (
            lambda root: (
                remove(unknown(root, "InitialUnknowns", "der(z)")),
                remove(root.find("ModelStructure/Derivatives")),
            ),
            "does not list der(z)",
        ),
    ],
    "initial-unknowns-missing": [(lambda root: remove(unknown(root, "InitialUnknowns", "F")), "does not list F")],
    "initial-unknowns-extra": [
        (
            lambda root: root.find("ModelStructure/InitialUnknowns").insert(
                0, etree.Element("Unknown", index=index_of(root, "v"))
            ),
            "lists v (input",
        ),
    ],
    "initial-unknowns-order": [(swap_initial, "sort it")],
    "dependencies-index": [
        (lambda root: unknown(root, "Outputs", "F").set("dependencies", "2 99"), "99"),
        (lambda root: unknown(root, "Outputs", "F").set("dependencies", "2 2"), "repeated"),
    ],
    "dependencies-order": [(lambda root: unknown(root, "Outputs", "F").set("dependencies", "3 2"), "not sorted")],
    "dependencies-impossible": [
        (lambda root: unknown(root, "Outputs", "F").set("dependencies", f"2 {index_of(root, 'Fc')}"), "Fc (parameter)"),
        (
            lambda root: unknown(root, "InitialUnknowns", "F").set("dependencies", f"2 {index_of(root, 'der(z)')}"),
            "der(z)",
        ),
    ],
    "dependencies-kind": [
        (lambda root: unknown(root, "Outputs", "F").set("dependenciesKind", "dependent"), "one word"),
        (
            lambda root: unknown(root, "InitialUnknowns", "der(z)").attrib.update(
                {"dependencies": "2", "dependenciesKind": "fixed"}
            ),
            "fixed",
        ),
    ],
}

# what cannot be said without saying the other
COMPANIONS = {
    "schema": {"guid-empty"},
    "model-identifier": {"binary-misnamed"},
    "initial": {"dependencies-impossible"},
    "independent": {"time-name"},
    "unit-undefined": {"type-unknown"},
    "type-mismatch": {"schema"},
    "dependencies-index": {"dependencies-order"},
    "structure-index": {"outputs"},
    "start-missing": {"schema"},
    "derivative-of": {"dependencies-impossible", "derivatives"},
    "limits-reversed": {"start-outside-limits"},
    "number-not-finite": {"start-outside-limits"},
    "variability": {"initial"},
    "derivatives": {"initial-unknowns-missing"},
}
OTHERWISE = {"xml-malformed", "xml-entities", "xml-encoding", "fmpy"}
"""Tested below, and in test_check_damaged.py."""

CASES = [
    pytest.param(rule, edit, words, id=f"{rule}-{k}")
    for rule, cases in FAULTS.items()
    for k, (edit, words) in enumerate(cases)
]


@pytest.fixture(scope="session")
def lugre(build_fmu: Callable[..., Path]) -> Path:
    return build_fmu("LuGre")


def test_every_rule_has_a_fault() -> None:
    described = {rule.id for rule in RULES.values() if rule.kind in ("description", "both")}
    assert set(FAULTS) | OTHERWISE == described


@pytest.mark.parametrize(("rule", "edit", "words"), CASES)
def test_a_fault_is_found_by_its_rule_and_no_other(
    lugre: Path, tmp_path: Path, rule: str, edit: Edit, words: str
) -> None:
    found = check(edited(lugre, tmp_path / "LuGre.fmu", edit), static=True)
    own = [finding for finding in found if finding.rule == rule]
    assert any(words in finding.message for finding in own), found
    assert all(finding.file == XML and finding.severity == RULES[rule].severity for finding in own)
    assert {finding.rule for finding in found} - {rule} <= COMPANIONS.get(rule, set()), found


def test_a_finding_names_variable_and_line(lugre: Path, tmp_path: Path) -> None:
    members = contents(lugre)
    text = members[XML].decode()
    line = next(k for k, row in enumerate(text.splitlines(), start=1) if 'name="Fc"' in row)
    assert 'min="1e-09" start="1"' in text.splitlines()[line]
    rows = text.splitlines(keepends=True)
    rows[line] = rows[line].replace('start="1"', 'start="0"')
    (finding,) = check(zipped(members | {XML: "".join(rows).encode()}, tmp_path / "a.fmu"), static=True)
    assert (finding.rule, finding.variable, finding.line) == ("start-outside-limits", "Fc", line)
    place, text = (
        f"modelDescription.xml:{line}",
        "Fc starts at 0, below its min 1e-09; choose a value inside the limits",
    )
    assert str(finding) == f"{place}: error start-outside-limits: {text}"


@pytest.mark.parametrize(
    "data", [b"", b"<a", b"<a></b>", b"\xff\xfe\x00", b'<?xml version="1.0" encoding="nobody"?><a/>']
)
def test_what_is_not_well_formed(lugre: Path, tmp_path: Path, data: bytes) -> None:
    (finding,) = check(zipped(contents(lugre) | {XML: data}, tmp_path / "a.fmu"))
    assert (finding.rule, finding.file) == ("xml-malformed", XML)


def test_entities_are_refused_and_not_read(lugre: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("do not tell")
    members = contents(lugre)
    text = members[XML].decode()
    start = text.index("<fmiModelDescription")
    for doctype in (
        f'<!DOCTYPE x [<!ENTITY e SYSTEM "{secret.as_uri()}">]>',
        '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        '<!DOCTYPE x SYSTEM "http://localhost:1/x.dtd">',
    ):
        data = text[:start] + doctype + text[start:].replace("friction force", "&e;" if "&e;" in doctype else "F", 1)
        (finding,) = check(zipped(members | {XML: data.encode()}, tmp_path / "a.fmu"))
        assert finding.rule == "xml-entities"
        assert "do not tell" not in str(finding)


def test_fmpy_is_asked_where_nothing_else_is_wrong(
    lugre: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise ValidationError(["something  new"])

    monkeypatch.setattr("friction_fmus.check.parse_description", refuse)
    (finding,) = check(lugre, static=True)
    assert (finding.rule, finding.message) == ("fmpy", "fmpy reports: something new")
    (other,) = check(edited(lugre, tmp_path / "a.fmu", real("Fc", start="-1")), static=True)
    assert other.rule == "start-outside-limits"


def test_true_aliases_are_no_fault(lugre: Path, tmp_path: Path) -> None:
    def alias(root: etree._Element) -> None:
        reference = variable(root, "z").get("valueReference")
        add_variable(
            root,
            f'<ScalarVariable name="bristle" valueReference="{reference}" causality="local" variability="continuous">'
            '<Real unit="m"/></ScalarVariable>',
        )

    assert check(edited(lugre, tmp_path / "a.fmu", alias), static=True) == []


def test_angles_may_count_as_numbers(lugre: Path, tmp_path: Path) -> None:
    """Some tools leave rad out of the exponents."""

    def rotational(root: etree._Element) -> None:
        append(root, "UnitDefinitions", '<Unit name="rad/s"><BaseUnit s="-1"/></Unit>')

    assert check(edited(lugre, tmp_path / "a.fmu", rotational), static=True) == []
