"""Model exchange under fmpy's CVode against co-simulation: two independent computations of the same model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from exchange.cases import CASES, Case, agreement, covered, wanted
from exchange.solver import Exchange
from fmpy import extract

from friction_fmus import build

SEEDS = (1, 2)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", CASES)
def test_both_kinds_agree(name: str, seed: int, build_fmu: Callable[..., Path]) -> None:
    """Within 1e-6 of the force level; decisions at the same times to 1e-6 s."""
    agreement(CASES[name], build_fmu, seed)


def test_every_block_is_compared() -> None:
    assert covered() == wanted()


@pytest.mark.parametrize("name", ["LuGre", "GMS", "Coulomb", "KarnoppMass"])
def test_rotational_twins_agree(name: str, tmp_path: Path) -> None:
    agreement(CASES[name], lambda block, **_: build(block, tmp_path, domain="rotational"), 3)


@pytest.mark.parametrize(("name", "state", "start"), [("Leuven", "z", {}), ("KarnoppMass", "w", {"v0": 0.05})])
def test_states_that_an_event_changes_are_marked(
    name: str, state: str, start: dict[str, float], build_fmu: Callable[..., Path]
) -> None:
    """A reversal; a mass that comes to rest. The other cases of this file check that no other state changes."""
    nodes = np.array([0.0, 0.1, 0.2])
    lines = {"v": np.array([1e-3, -1e-3, 0.0]), "Fn": np.ones(3)} if name == "Leuven" else {"F_ext": np.zeros(3)}
    fmu = build_fmu(name, **start)
    run = Exchange(Path(extract(str(fmu), str(fmu.with_suffix(".marked")))), nodes, lines, {})
    run.model_exchange(["time"])
    assert run.jumps == 1
    assert run.reinitialised == [state]


HELD = {name: case for name, case in CASES.items() if "v" in case.inputs}


@pytest.mark.parametrize("name", HELD)
def test_standstill_takes_no_events_and_no_time(name: str, build_fmu: Callable[..., Path]) -> None:
    """1e6 s at v = 0 after a reversal: few events while it moves, at most one when it stops, none at rest."""
    case: Case = HELD[name]
    fmu = build_fmu(case.block, **case.start)
    nodes = np.array([0.0, 0.01, 0.02, 0.03, 0.04, 1e6])
    lines: Mapping[str, np.ndarray] = {
        key: np.array([0.0, 1e-3, 0.0, -1e-3, 0.0, 0.0]) if key == "v" else np.full(6, value)
        for key, value in case.inputs.items()
    }
    run = Exchange(Path(extract(str(fmu), str(fmu.with_suffix(".held")))), nodes, lines, {})
    _, events = run.model_exchange(case.outputs, step=None)
    stops = [t for t in events if t > 0.04 - 1e-9]
    assert len(stops) <= 3 and all(t < 0.04 + 1e-6 for t in stops)
