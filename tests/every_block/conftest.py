"""The blocks under test: all of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from shell.fixtures import instance, lugre, running, situation  # noqa: F401
from shell.instance import Library, load

from friction_fmus import catalogue


@pytest.fixture(params=tuple(catalogue()))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each block of the catalogue in turn."""
    return load(build_fmu(request.param))
