"""A short form of the search for runs that are wrong without a warning; `coupling_search.py` is the long one."""

from __future__ import annotations

import pytest
from coupling_search import draw, judge


@pytest.mark.parametrize("seed", [30, 93, 117, 119])
def test_no_run_is_wrong_without_a_warning(seed: int) -> None:
    """Systems that the search found to be wrong before the checks at the start were tightened, and one other."""
    case = draw(seed)
    with case.system:
        verdicts = judge(case, ["newton", "adaptive"])
    assert verdicts, "the references differ"
    assert "wrong, silent" not in verdicts.values(), verdicts
