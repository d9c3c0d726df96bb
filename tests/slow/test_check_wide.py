"""A check takes time in proportion to the size of the FMU, and names of any length."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from check.broken import XML, zipped
from check.libraries import BINARY, HERE, Library
from thorough import nightly, slowness, some

from friction_fmus.check import check
from friction_fmus.check.findings import as_json, as_sarif

LONG = 1_000_000
"""Characters of a name."""

NAMES = {
    "letters": "n" * LONG,
    "indices": "n[" + "1," * (LONG // 2) + "1]",
    "open": "n[" + "1," * (LONG // 2),
    "dots": "n." * (LONG // 2) + "n",
    "quoted": "'" + "a" * LONG + "'",
    "escaped": "'" + "\\\\" * (LONG // 2),
    "derivatives": "der(" * (LONG // 4),
    "blanks": " " * LONG,
}


@pytest.fixture
def wide(faulty: Library, tmp_path: Path) -> Callable[[int], Path]:
    """The FMU in order with that many aliases more: half of them outputs, half of them local."""

    def make(count: int) -> Path:
        xml = (HERE / "faulty.xml").read_text(encoding="utf-8")
        row = '<ScalarVariable name="{}{}" valueReference="{}" causality="{}"><Real/></ScalarVariable>\n'
        outputs = "".join(row.format("y", k, 2, "output") for k in range(count // 2))
        locals = "".join(row.format("l", k, 5, "local") for k in range(count // 2))
        unknowns = "".join(f'<Unknown index="{k + 8}" dependencies="2"/>' for k in range(count // 2))
        xml = xml.replace("</ModelVariables>", f"{outputs}{locals}</ModelVariables>")
        xml = xml.replace("</Outputs>", f"{unknowns}</Outputs>").replace(
            "</InitialUnknowns>", f"{unknowns}</InitialUnknowns>"
        )
        members = {XML: xml.encode(), BINARY: faulty(), "documentation/index.html": b"<html/>"}
        return zipped(members, tmp_path / "wide.fmu")

    return make


def seconds_of(path: Path) -> float:
    """Processor time of a check without findings, its processes included; other work on the machine does not count."""
    before = os.times()
    assert check(path, time_limit=300.0) == []
    return sum(os.times()[:4]) - sum(before[:4])


@nightly
def test_a_hundred_thousand_variables(wide: Callable[[int], Path]) -> None:
    assert seconds_of(wide(100_000)) < 30.0 * slowness()


@nightly
def test_twice_the_variables_take_twice_the_time(wide: Callable[[int], Path]) -> None:
    assert seconds_of(wide(40_000)) < 3.0 * seconds_of(wide(20_000))


def test_an_enumeration_of_many_items(faulty: Library, tmp_path: Path) -> None:
    """Every variable of a type needs its items."""
    count = 5000
    items = "".join(f'<Item name="i{k}" value="{k}"/>' for k in range(count))
    types = f'<TypeDefinitions><SimpleType name="T"><Enumeration>{items}</Enumeration></SimpleType></TypeDefinitions>'
    rows = "".join(
        f'<ScalarVariable name="e{k}" valueReference="{k}" causality="parameter" variability="fixed">'
        f'<Enumeration declaredType="T" start="{k}"/></ScalarVariable>\n'
        for k in range(count)
    )
    xml = (HERE / "faulty.xml").read_text(encoding="utf-8")
    xml = xml.replace("</UnitDefinitions>", f"</UnitDefinitions>{types}").replace(
        "</ModelVariables>", f"{rows}</ModelVariables>"
    )
    path = zipped({XML: xml.encode(), BINARY: faulty(), "documentation/index.html": b"<html/>"}, tmp_path / "a.fmu")
    before = os.times()
    assert check(path, static=True) == []
    assert sum(os.times()[:2]) - sum(before[:2]) < 5.0


@pytest.mark.parametrize("convention", some(["structured", "flat"], ["structured"]))
@pytest.mark.parametrize("name", NAMES)
def test_a_name_of_a_million_characters(faulty: Library, tmp_path: Path, name: str, convention: str) -> None:
    xml = (HERE / "faulty.xml").read_text(encoding="utf-8")
    xml = xml.replace('name="u"', f'name="{NAMES[name]}"').replace('"structured"', f'"{convention}"')
    path = zipped({XML: xml.encode(), BINARY: faulty(), "documentation/index.html": b"<html/>"}, tmp_path / "a.fmu")
    before = os.times()
    found = check(path)
    assert sum(os.times()[:4]) - sum(before[:4]) < 10.0
    assert {finding.rule for finding in found} <= {"variable-name"}
    assert len(as_json({path: found}) + as_sarif({path: found})) < 100_000
