"""A short form of the search with the Modelica library as the reference; `modelica_search.py` is the long one."""

from __future__ import annotations

from pathlib import Path

import pytest
from coupling_search import Composites, References, draw, judge
from modelica.library import Library
from modelica_search import compared, in_modelica
from thorough import landing, some

from friction_fmus.export.targets.modelica import write


@landing
@pytest.mark.parametrize("seed", some([2, 3, 4, 5, 9, 13, 15, 25], [2]))
def test_harness_and_modelica_agree(seed: int, tmp_path: Path) -> None:
    """Stiction, ElastoPlastic, Stribeck, Dahl, LoadDependentDahl, GMS, MaxwellSlip and LuGre under a mass."""
    case = in_modelica(draw(seed), Library(write(tmp_path)))
    answers = References(case)
    assert answers.found
    assert compared(draw(seed), case) in ("right", "none")
    assert judge(case, answers, "adaptive", Composites(tmp_path)) in ("right", "warned")
