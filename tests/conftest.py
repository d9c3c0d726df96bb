"""What all tests share: FMUs built once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from friction_fmus import build

# one after the other, so that the second one finds the FMUs of the first one compiled
ALL_PLATFORMS = ("test_platforms.py", "test_wheel.py")
LONG = (*ALL_PLATFORMS, "test_native_checks.py", "test_cofmupy.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest first, so that no worker waits for another one at the end; groups of files on one worker."""
    items.sort(key=lambda item: item.path.name not in LONG)
    for item in items:
        if item.path.name in ALL_PLATFORMS:
            item.add_marker(pytest.mark.xdist_group("all platforms"))


@pytest.fixture(scope="session")
def build_fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """``build_fmu(name, **start_values)`` -> path of the FMU, each with other start values in a folder of its own."""
    made: dict[tuple[object, ...], Path] = {}

    def make(name: str, **start: float) -> Path:
        key = (name, *sorted(start.items()))
        if key not in made:
            made[key] = build(name, tmp_path_factory.mktemp("fmus"), start)
        return made[key]

    return make
