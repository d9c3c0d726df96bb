"""Composite FMUs that several tests use."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def compose(build_fmu: Callable[..., Path]) -> Callable[[str], Path]:
    """``compose(name)`` -> the composite FMU of ``examples/NAME.toml``."""
    return build_fmu
