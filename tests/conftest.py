"""What all tests share: FMUs built once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from friction_fmus import build

# on one worker, so that the second one finds the FMUs of the first one compiled
ALL_PLATFORMS = ("test_platforms.py", "test_wheel.py")
LONG = (*ALL_PLATFORMS, "test_documents.py", "test_examples.py", "test_native_checks.py", "test_cofmupy.py")


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A file on one worker, which makes its fixtures once; the longest first, so that no worker waits at the end."""
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))
    for item in items:
        group = "all platforms" if item.path.name in ALL_PLATFORMS else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))


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
