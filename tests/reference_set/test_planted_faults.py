"""The right importer passes the cases, and each planted fault is found by the case that says so."""

from __future__ import annotations

import pytest
from reference_set.built_set import built, is_long, names
from reference_set.fault_matrix import verdict
from reference_set.planted_faults import FAULTS
from thorough import THOROUGH, landing

from friction_fmus.reference.case import CASES, ReferenceCase, read_cases
from friction_fmus.reference.tool_runs import PASSED

SET: list[ReferenceCase] = read_cases(CASES)
SHORT = [name for name in names() if not is_long(name)]
FINDERS = {fault: [case.name for case in SET if fault in case.faults] for fault in FAULTS}
"""Fault -> the cases that name it; the nightly test compares both with what is found."""


@landing
@pytest.mark.parametrize("name", SHORT)
def test_the_right_importer_passes(name: str) -> None:
    found, reason = verdict(built(name))
    assert found == PASSED, reason


def test_cases_name_no_other_faults() -> None:
    assert {fault for case in SET for fault in case.faults} <= set(FAULTS)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_case_finds_the_fault(fault: str) -> None:
    """Where only a case with many steps finds it, the night runs the case."""
    finders = [name for name in FINDERS[fault] if THOROUGH or not is_long(name)]
    assert FINDERS[fault], "no case finds it"
    assert not finders or verdict(built(finders[0]), [fault])[0] != PASSED
