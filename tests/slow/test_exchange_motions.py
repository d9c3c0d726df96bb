"""Model exchange against co-simulation over many random motions: `EXCHANGE_MOTIONS=100` each night."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from exchange.cases import CASES, agreement

MOTIONS = int(os.environ.get("EXCHANGE_MOTIONS", "3"))


@pytest.mark.parametrize("name", CASES)
def test_random_motions(name: str, build_fmu: Callable[..., Path]) -> None:
    faults = []
    for seed in range(10, 10 + MOTIONS):
        try:
            agreement(CASES[name], build_fmu, seed)
        except (AssertionError, RuntimeError) as fault:
            faults.append(f"{seed}: {str(fault).splitlines()[0]}")
    assert faults == []
