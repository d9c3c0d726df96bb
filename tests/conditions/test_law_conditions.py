"""Conditions of one number, and those that the documentation names."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from friction_fmus import conditions
from friction_fmus.blocks.catalogue import catalogue
from friction_fmus.conditions import break_away, dither_stroke, encoder_count, fed_back_stiffness

TS = 1e-3


def test_bounds_of_one_number() -> None:
    assert break_away(1.6, 1.5).ok
    assert not break_away(1.4, 1.5).ok
    assert fed_back_stiffness(1e5, 1.1e5).ok
    assert not fed_back_stiffness(1.2e5, 1.1e5).ok
    # 50 N at 200 Hz move 1 kg by 31.7 um
    assert dither_stroke(50.0, 200.0, 1.0, 1.5, 1e5).value == pytest.approx(31.66e-6, rel=1e-3)
    # 600 N.s/m on counts of 3 um in 1 ms
    assert encoder_count(3e-6, 12e3, 600.0, 1.5, TS).value == pytest.approx(1.836)
    assert encoder_count(3e-6, 12e3, 600.0, 1.5, math.inf).ok


def test_the_conditions_of_blocks_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the table of the documentation."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs")
    from needs import CONDITIONS

    assert CONDITIONS.keys() <= catalogue().keys()
    for names in CONDITIONS.values():
        for name in names:
            assert name in conditions.__all__
            assert (getattr(conditions, name).__doc__ or "").split("\n\n")[0].endswith(".")
