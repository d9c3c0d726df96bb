"""Equations on the pages of the blocks: plain text becomes MathML, and nothing of it is lost."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest
from lxml import etree

from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.blocks.macros import paragraphs

ROOT = Path(__file__).parents[2]


@pytest.fixture
def equations(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    return importlib.import_module("equations")


def cells(html: str) -> list[str]:
    """Text of each cell, without blanks."""
    return [re.sub(r"\s", "", "".join(cell.itertext())) for cell in etree.fromstring(html)]


def test_a_line_has_a_condition_a_left_hand_side_and_the_rest(equations: ModuleType) -> None:
    lines = ["v != 0:  F = load Fc sign(v) + Fv v", "dz/dt = v - sigma0 |v| z / g(v)", "      + 1/2 F_hat^2"]
    html = equations.equations(lines, {"F", "load", "Fc", "Fv", "v", "z", "sigma0"})
    assert cells(html) == [
        *("v≠0:", "F", "=loadFcsign(v)+Fvv"),
        *("", "dzdt", "=v−σ0|v|z/g(v)"),
        *("", "", "+12F^2"),
    ]
    tree = etree.fromstring(html)
    assert [etree.tostring(each).decode() for each in tree.iter("mfrac")] == [
        "<mfrac><mrow><mi>d</mi><mi>z</mi></mrow><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>",
        "<mfrac><mn>1</mn><mn>2</mn></mfrac>",
    ]
    assert "<msub><mi>σ</mi><mrow><mn>0</mn></mrow></msub>" in html
    assert "<msub><mi>F</mi><mrow><mi>c</mi></mrow></msub>" in html


def test_derivatives_of_the_reference_have_dots(equations: ModuleType) -> None:
    html = equations.equations(["u = m rdd + Fv rd"], {"u", "m", "rdd", "Fv", "rd"})
    assert cells(html) == ["", "u", "=mr¨+Fvr˙"]
    assert '<mover accent="true"><mi>r</mi><mo stretchy="false">˙</mo></mover>' in html


def test_words_are_text_and_names_have_indices(equations: ModuleType) -> None:
    html = equations.equations(["I_next = I while u is limited, |d_i| >= 1e-3, sqrt(k/m) at a jump"], {"I", "u"})
    texts = [each.text for each in etree.fromstring(html).iter("mtext")]
    assert [text for text in texts if text != "next"] == ["while", "is", "limited", "at", "a", "jump"]
    assert "<msqrt><mrow><mi>k</mi>" in html and "<mn>1e-3</mn>" in html and "≥" in html


@pytest.mark.parametrize("name", [name for name, block in catalogue().items() if "    " in block.notes])
def test_nothing_of_the_equations_of_a_block_is_lost(name: str, equations: ModuleType) -> None:
    """Letters and digits of the text are those of the MathML, in the order of the text but for hats."""
    greek = {letter: word for word, letter in equations.GREEK.items() if word not in ("eps", "th")}
    for paragraph in paragraphs(catalogue()[name].notes):
        if paragraph.equations:
            shown = "".join(cells(equations.equations(paragraph.lines, ())))
            shown = "".join(greek.get(letter, letter) for letter in shown).replace("∑", "sum").replace("epsilon", "eps")
            lines = re.sub(r"\brdd?(?=\b|_)", "r", " ".join(paragraph.lines))  # with dots
            written = re.sub(r"_hat|\bsqrt|(?<=\w)_|\bth(?=_)", "", re.sub(r"th_", "theta_", lines))
            assert re.sub(r"\W", "", shown) == re.sub(r"\W|_", "", written), name
