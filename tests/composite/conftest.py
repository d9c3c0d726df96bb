"""Composite FMUs that several tests use."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from friction_fmus.cli.systems import open_system

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def compose(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """``compose(name)`` -> the composite FMU of ``examples/NAME.toml``."""
    made: dict[str, Path] = {}

    def make(name: str) -> Path:
        if name not in made:
            path = tmp_path_factory.mktemp("composite") / f"{name}.fmu"
            with open_system(ROOT / "examples" / f"{name}.toml") as system:
                system.to_fmu(path)
            made[name] = path
        return made[name]

    return make
