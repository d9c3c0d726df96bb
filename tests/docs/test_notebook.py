"""What a notebook shows of systems, parts and results."""

from __future__ import annotations

import math
from dataclasses import replace

import html5lib
import numpy as np
import pytest

from friction_fmus import fmu
from friction_fmus.identification import Estimate, Identification, ModelComparison, Score
from harness import CallablePart, FmuPart, Port, System
from harness.notebook import Listing


def cells(html: str) -> list[str]:
    """The texts of all cells; the HTML must be valid."""
    tree = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parseFragment(html)
    return ["".join(cell.itertext()) for cell in tree.iter() if cell.tag in ("th", "td")]


def identification(model: str = "LuGre", *, validated: bool = True) -> Identification:
    """Made-up figures."""
    score = Score(rms=0.5, relative_percent=2.5, fit_percent=97.0, samples=10)
    empty = np.zeros(0)
    return Identification(
        model=model,
        method="output-error",
        parameters={
            "Fc": Estimate("Fc", 20.123456789, 0.1, "N"),
            "delta": Estimate("delta", 2.0, math.nan, "1"),
        },
        initial={},
        fixed={},
        correlation=empty,
        t=empty,
        measured=empty,
        predicted=empty,
        signal="force",
        unit="N",
        train=score,
        validation=score if validated else None,
        aic=1.0,
        bic=123.4,
        weak={"delta": "a < b & c"},
        warnings=(),
        seconds=1.0,
        simulations=1,
    )


def test_a_system_and_its_parts() -> None:
    source = CallablePart("source", lambda t, u, x: t, outputs=[Port("v", "m/s")])
    with System(
        [source, FmuPart("friction", fmu("Viscous"))],
        ["source.v -> friction.v"],
        start={"friction.Fv": 2.5},
        name="<b>bench</b>",
    ) as system:
        assert repr(system) == "<System '<b>bench</b>': 2 parts (source, friction), 1 connection>"
        shown = system._repr_html_()
        assert "<b>" not in shown
        assert cells(shown)[4:8] == ["source", "CallablePart", "", "v [m/s]"]
        assert cells(shown)[16:20] == ["source.v", "friction.v", "1", "0"]
        assert cells(shown)[-3:] == ["friction.Fv", "2.5", "N.s/m"]
        part = system.parts["friction"]
        assert repr(part) == "<FmuPart 'friction': 1 input, 1 output, 2 parameters>"
        found = cells(part._repr_html_())
        assert found[5:7] == ["v", "input"]
        assert "N.s/m" in found


def test_an_identification() -> None:
    result = identification()
    assert repr(result) == "<Identification of LuGre: 2 parameters, validation error 0.5 N (2.5 %)>"
    found = cells(result._repr_html_())
    assert found[5:10] == ["Fc", "20.123", "0.1", "N", ""]
    assert found[10:15] == ["delta", "2", "unknown", "", "poorly identifiable"]
    assert found[-2:] == ["delta", "a < b & c"]
    assert "fit error" in repr(identification(validated=False))


def test_a_comparison_of_models() -> None:
    survey = ModelComparison((identification(), identification("Dahl")), {"GMS": "no samples"}, "validation error")
    assert repr(survey) == "<ModelComparison of 2 models by validation error: LuGre, Dahl>"
    found = cells(survey._repr_html_())
    assert found[8:16] == ["LuGre", "output-error", "0.5", "2.50", "2.50", "123", "1 of 2", "1.0 s"]
    assert found[-2:] == ["GMS", "no samples"]
    assert "Not identified" not in replace(survey, failed={})._repr_html_()


@pytest.mark.parametrize("cell", ["<script>", "a & b", '"quoted"'])
def test_texts_are_escaped(cell: str) -> None:
    shown = Listing(cell, [cell], [[cell]]).html()
    assert cells(shown) == [cell, cell]
    assert "<script>" not in shown
