"""The blocks under test, as parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmi.instance import Instance, Library, load

from friction_fmus import catalogue

BLOCKS = tuple(catalogue())


@pytest.fixture(params=BLOCKS)
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each block of the catalogue in turn."""
    return load(build_fmu(request.param))


@pytest.fixture
def instance(library: Library) -> Iterator[Instance]:
    """A new instance of that block, in the mode Instantiated."""
    with Instance(library) as made:
        yield made


@pytest.fixture
def lugre(build_fmu: Callable[..., Path]) -> Library:
    """A block with a state, an input and tunable parameters."""
    return load(build_fmu("LuGre"))
