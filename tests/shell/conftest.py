"""The blocks under test, those that compile all of the shell, in both versions of FMI."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from shell.facade import facade
from shell.fixtures import instance, lugre, running, situation  # noqa: F401
from shell.instance import Library, load
from shell.selection import SHELL_BLOCKS
from thorough import some

FULL = some(("GMS", "PID", "ModifiedLeuvenFeedforward"), ("GMS", "PID"))
"""Blocks that arrays or clocks change."""
IN_FMI_3 = some(SHELL_BLOCKS, ("LuGre", "Mass"))
"""Blocks in FMI 3.0, whose functions call those of FMI 2.0."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave out blocks with neither arrays nor clocks where the profile of FMI 3.0 is the full one, and what is for the
    night."""
    items[:] = [item for item in items if not _is_repeated(getattr(item, "callspec", None))]


def _is_repeated(call: Any) -> bool:
    kept = None if call is None else {3: IN_FMI_3, "full": FULL}.get(call.params.get("build_fmu"))
    return kept is not None and call.params.get("library") not in (None, *kept)


@pytest.fixture(scope="session", params=[2, 3, "full"], ids=["FMI 2.0", "FMI 3.0", "FMI 3.0 with arrays and clocks"])
def build_fmu(
    request: pytest.FixtureRequest, build_fmu: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., Path]:
    """The FMU of a block in FMI 2.0, or in FMI 3.0 behind the functions of FMI 2.0."""
    made: dict[tuple[object, ...], Path] = {}

    def make(name: str, **start: float) -> Path:
        key = (name, *sorted(start.items()))
        if key not in made:
            folder = tmp_path_factory.mktemp("facade")
            made[key] = facade(build_fmu(name, **start), folder, full=request.param == "full")
        return made[key]

    return build_fmu if request.param == 2 else make


@pytest.fixture(params=SHELL_BLOCKS)
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each of these blocks in turn."""
    return load(build_fmu(request.param))
