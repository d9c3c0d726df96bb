"""Each case of the reference set finds exactly the planted faults that it names.

``python tests/reference_set/fault_matrix.py --write`` enters them.
"""

from __future__ import annotations

import pytest
from reference_set.built_set import built, names
from reference_set.fault_matrix import found_by, verdict
from thorough import nightly

from friction_fmus.reference.tool_runs import PASSED


@nightly
@pytest.mark.parametrize("name", names())
def test_a_case_names_the_faults_that_it_finds(name: str) -> None:
    case = built(name)
    assert verdict(case)[0] == PASSED
    assert sorted(found_by(name)) == sorted(case.faults)
