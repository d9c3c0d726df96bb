"""Instances of the block under test; a folder says in its ``conftest.py`` which blocks these are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from shell.exchanging import SITUATIONS, need
from shell.instance import Instance, Library, load, signals


@pytest.fixture(params=SITUATIONS)
def situation(request: pytest.FixtureRequest, library: Library) -> str:
    """Where a run is between two steps; skipped for a block that has no model exchange."""
    need(library, SITUATIONS[request.param])
    return str(request.param)


@pytest.fixture
def instance(library: Library) -> Iterator[Instance]:
    """A new instance of that block, in the mode Instantiated."""
    with Instance(library) as made:
        yield made


@pytest.fixture
def running(library: Library, instance: Instance) -> Instance:
    """The instance after a step of 10 ms."""
    instance.initialise(**signals(library, 1, 1)[0])
    instance.step(0.0, 0.01)
    instance.everything()
    return instance


@pytest.fixture
def lugre(build_fmu: Callable[..., Path]) -> Library:
    """A block with a state, an input and tunable parameters."""
    return load(build_fmu("LuGre"))
