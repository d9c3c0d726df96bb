"""Model exchange against co-simulation over many random motions: `EXCHANGE_MOTIONS=100` each night.

In slow presliding motions, where nothing decays, CVODE's own error adds up: at a tolerance of 1e-9 to as much as 2.5e-6
of the force level in one motion of 40, at 1e-11 to 1e-8.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from exchange.cases import CASES, agreement
from thorough import some

MOTIONS = int(os.environ.get("EXCHANGE_MOTIONS", "3"))
TOLERANCE = 1e-11


@pytest.mark.parametrize("name", some([*CASES], ["LuGre", "GMS", "KarnoppMass"]))
def test_random_motions(name: str, build_fmu: Callable[..., Path]) -> None:
    case = replace(CASES[name], tolerance=min(TOLERANCE, CASES[name].tolerance))
    faults = []
    for seed in range(10, 10 + MOTIONS):
        try:
            agreement(case, build_fmu, seed)
        except (AssertionError, RuntimeError) as fault:
            faults.append(f"{seed}: {str(fault).splitlines()[0]}")
    assert faults == []
