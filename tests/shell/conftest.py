"""The blocks under test: those that compile all of the shell."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from shell.fixtures import instance, lugre, running, situation  # noqa: F401
from shell.instance import Library, load
from shell.selection import SHELL_BLOCKS


@pytest.fixture(params=SHELL_BLOCKS)
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each of these blocks in turn."""
    return load(build_fmu(request.param))
