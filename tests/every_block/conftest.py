"""The blocks under test: three of each class of branches, and all of them each night."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from shell.fixtures import instance, lugre, running, situation  # noqa: F401
from shell.instance import Library, load
from shell.selection import of_each_branch

from friction_fmus import catalogue


@pytest.fixture(params=of_each_branch(tuple(catalogue())))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each of these blocks in turn."""
    return load(build_fmu(request.param))
