"""What all tests share: FMUs built once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from friction_fmus import build


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
