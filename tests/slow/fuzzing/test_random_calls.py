"""Random sequences of calls, on every block: no crash, the statuses of the standard, no change by a refused call."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from call_machine import run
from shell.elsewhere import Elsewhere

from friction_fmus import catalogue


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(run)
    yield made
    made.end()


@pytest.mark.parametrize("name", catalogue())
def test_random_calls(name: str, build_fmu: Callable[..., Path], elsewhere: Elsewhere, tmp_path: Path) -> None:
    elsewhere.run(build_fmu(name), tmp_path / "calls.txt", 12)
