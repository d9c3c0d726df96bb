"""Random sequences of calls, on every block: no crash, the statuses of the standard, no change by a refused call."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from call_machine import run
from shell.elsewhere import Elsewhere

from friction_fmus import catalogue, fmu
from harness import System

EXAMPLE = Path(__file__).parents[3] / "examples" / "stick_slip.toml"


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(run)
    yield made
    made.end()


@pytest.mark.parametrize("name", catalogue())
def test_random_calls(name: str, build_fmu: Callable[..., Path], elsewhere: Elsewhere, tmp_path: Path) -> None:
    elsewhere.run(build_fmu(name), tmp_path / "calls.txt", 12)


def test_random_calls_on_a_composite(elsewhere: Elsewhere, tmp_path: Path) -> None:
    with System.from_toml(EXAMPLE, resolve=fmu) as system:
        system.to_fmu(tmp_path / "StickSlip.fmu")
    elsewhere.run(tmp_path / "StickSlip.fmu", tmp_path / "calls.txt", 60)
