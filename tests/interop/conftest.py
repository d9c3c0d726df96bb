"""The FMUs of the catalogue, and the loops that they take part in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from interop.loops import Loop, all_loops
from shell.instance import Library, load
from shell.selection import COMPOSITES, ONE_OF_EACH
from thorough import some

from friction_fmus import catalogue

BLOCKS = some(tuple(catalogue()), ONE_OF_EACH)
"""One of each class of branches, and all each night."""


@pytest.fixture(params=(*BLOCKS, *some(COMPOSITES, COMPOSITES[:1])))
def library(request: pytest.FixtureRequest, build_fmu: Callable[..., Path]) -> Library:
    """Each of these blocks and each composite in turn."""
    return load(build_fmu(request.param))


@pytest.fixture(scope="session")
def fmus(build_fmu: Callable[..., Path]) -> Mapping[str, Path]:
    """FMUs of the catalogue by name."""
    return {block: build_fmu(block) for block in BLOCKS}


@pytest.fixture(scope="session")
def loops(build_fmu: Callable[..., Path]) -> Mapping[str, Loop]:
    """Closed loops in which these blocks take part."""
    return all_loops(build_fmu, BLOCKS)


@pytest.fixture(autouse=True)
def _temporary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The folder for temporary files, of which importers leave some behind."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
