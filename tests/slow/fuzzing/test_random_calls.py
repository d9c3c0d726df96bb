"""Random sequences of calls, on blocks and composites: no crash, the statuses of FMI, no change by a refused call."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from call_machine import run
from shell.elsewhere import Elsewhere
from shell.facade import IN_3, in_either
from shell.selection import COMPOSITES, ONE_OF_EACH, SHELL_BLOCKS
from thorough import THOROUGH, some

from friction_fmus import catalogue


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(run)
    yield made
    made.end()


@pytest.mark.parametrize("name", (*some(tuple(catalogue()), ONE_OF_EACH), *COMPOSITES))
def test_random_calls(name: str, build_fmu: Callable[..., Path], elsewhere: Elsewhere, tmp_path: Path) -> None:
    elsewhere.run(build_fmu(name), tmp_path / "calls.txt", 60 if THOROUGH and name in COMPOSITES else 12)


@pytest.mark.parametrize("name", some((*SHELL_BLOCKS, COMPOSITES[1]), ("LuGre", "PID")))
def test_random_calls_in_fmi_3(name: str, elsewhere: Elsewhere, tmp_path: Path) -> None:
    elsewhere.run(in_either(name + IN_3, tmp_path), tmp_path / "calls.txt", 12)
