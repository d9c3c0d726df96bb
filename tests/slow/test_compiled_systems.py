"""Random systems of all blocks and laws, with the loop compiled for them and with that for all systems."""

from __future__ import annotations

import os
from collections import Counter

import pytest
from composite.composite_systems import random_seed_settings, random_systems
from hypothesis import given, reject, seed, settings
from hypothesis import strategies as st
from thorough import nightly

from friction_fmus import catalogue
from harness import HarnessError, Result, System

BLOCKS = sorted(catalogue())
_MET: Counter[str] = Counter()


def run(system: System, engine: str) -> Result | str:
    try:
        return system.run(master="gauss-seidel", record=["*"], engine=engine)
    except HarnessError as error:
        return str(error)


@nightly
@seed(20261128)
@settings(random_seed_settings(int(os.environ.get("COMPILED_SYSTEMS", "60"))))
@given(data=st.data())
def test_random_systems_are_the_same(data: st.DataObject) -> None:
    try:
        system = data.draw(random_systems(BLOCKS, plain=True))
    except HarnessError:
        reject()
    with system:
        general, compiled = run(system, "general"), run(system, "compiled")
    if isinstance(general, str) or isinstance(compiled, str):
        _MET["failed"] += 1
        assert general == compiled
    else:
        _MET["ran"] += 1
        assert general.equals(compiled)
        assert general.attrs == compiled.attrs


@nightly
def test_many_of_them_ran() -> None:
    if not _MET:
        pytest.skip("it follows the other test")
    assert _MET["ran"] > _MET["failed"]
