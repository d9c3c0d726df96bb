"""The exported C as a reviewer reads it: names, equations, no operations without effect."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from casadi import SX
from shell.selection import EACH_FEATURE
from thorough import some

from friction_fmus.blocks.catalogue import laws_folder
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import equations_of, numbered
from friction_fmus.codegen.sources import header, implementation
from friction_fmus.lawkit.law import discover_laws
from friction_fmus.lawkit.results import labelled

LAWS = [law.name for law in discover_laws(laws_folder())]


def body(name: str) -> str:
    """The function `sample`."""
    text = implementation(make_export(name))
    return text[text.index("static void sample") : text.index("\n}\n", text.index("static void sample"))]


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE))
def test_no_value_is_without_a_name_of_the_law(name: str) -> None:
    text = body(name)
    assert not re.search(r"\bt\d+\b", text)
    assert max(len(line.strip()) for line in text.splitlines()) <= 120


def test_the_example_in_the_documentation_is_what_codegen_writes() -> None:
    """`friction-fmus codegen ExtendedStateObserver -o c` writes both files, `docs/generated` has copies."""
    folder, export = Path(__file__).parents[2] / "docs" / "generated", make_export("ExtendedStateObserver")
    assert (folder / "law.c").read_text(encoding="utf-8") == implementation(export)
    assert (folder / "law.h").read_text(encoding="utf-8") == header(export)


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE))
def test_every_equation_is_a_comment_with_its_number(name: str) -> None:
    export = make_export(name)
    comments = re.findall(r"/\* \((\d+)\) (.*?) \*/", body(name), re.DOTALL)
    shown = {int(number): " ".join(text.split()) for number, text in comments}
    assert len(shown) == len(comments)
    head = " ".join(header(export).split())
    equations = equations_of(export.law.documentation)
    assert sorted(shown) == [equation.number for equation in equations]
    for equation in equations:
        text = " ".join(" ".join(equation.lines).split())
        assert shown[equation.number] == text.rstrip(",")
        assert f"{text} ({equation.number})" in head


def test_intermediate_results_have_the_names_of_the_law() -> None:
    """The local variables of lugre_feedforward.py, and the arguments of the Stribeck curve, which it calls twice."""
    text = body("LuGreFeedforward")
    for name in ("dr", "g", "now", "stretching", "viscous", "friction", "own_0", "own_1", "ratio_0", "ratio_1"):
        assert len(re.findall(rf"^ *(?:const \w+ )?{name} = ", text, re.MULTILINE)) >= 1, name
    place = text.index("double now;")
    assert "(4) z becomes t + (z - t) exp(-sigma0 |dr| / g(w)) */" in text[place - 120 : place]


@pytest.mark.parametrize("name", some(LAWS, EACH_FEATURE))
def test_no_zero_is_added(name: str) -> None:
    assert not re.search(r"\+ 0\.0f?\b(?!\d)", body(name))


def test_names_are_recorded_in_order_and_the_trace_ends() -> None:
    def helper(speed: SX) -> SX:
        ratio = speed / 2.0
        return ratio + 1.0

    def equations(x: SX) -> SX:
        total = SX(0.0)
        for i in range(3):
            total += helper(x + i)
        parts = [x * 2.0, x * 3.0]
        return total + parts[0]

    before = sys.gettrace()
    _, labels = labelled(equations, {"x": SX.sym("x")})
    assert sys.gettrace() is before
    found = [(label.name, label.depth, label.assigned) for label in labels]
    once = [("speed", 1, False), ("ratio", 1, True), ("helper", 0, False), ("total", 0, True)]
    # x + 0 is x, an argument
    assert found == [*once[1:], *once, *once, ("parts_0", 0, False), ("parts_1", 0, False)]
    with pytest.raises(ZeroDivisionError):
        labelled(lambda x: 1 / 0, {"x": SX.sym("x")})
    assert sys.gettrace() is before


def test_equations_are_read_from_the_documentation() -> None:
    text = "Title.\n\n    a  = b +\n         c\n    stick:  Fi becomes 1\n    g(v) = 2,\n\nText: d = 3\n    for all v\n"
    assert [(equation.name, equation.text) for equation in equations_of(text)] == [
        ("a", "(1) a = b + c"),
        ("Fi", "(2) stick: Fi becomes 1"),
        ("g", "(3) g(v) = 2"),
    ]
    assert numbered(text).splitlines()[2:6] == [
        *("    a  = b +", "         c   (1)", "    stick:  Fi becomes 1   (2)", "    g(v) = 2,   (3)"),
    ]
