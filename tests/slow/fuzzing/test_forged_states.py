"""A state that is forged, with the right checksum, is refused or bears any use: no crash, no step without end."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from forgery import forge
from shell.elsewhere import Elsewhere
from shell.exchanging import SITUATIONS, need
from shell.instance import load
from thorough import some

from friction_fmus import catalogue

SOURCES = Path(__file__).parents[3] / "fmu_src"
REMEMBERING = tuple(
    path.stem
    for path in sorted(SOURCES.glob("*/*.c"))
    if re.search(r"^#define\s+MEMORY\b", path.read_text(encoding="utf-8"), re.MULTILINE)
)
"""Blocks with a memory."""


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Elsewhere]:
    made = Elsewhere(forge)
    yield made
    made.end()


@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("name", some(REMEMBERING, REMEMBERING[::12]))
def test_a_forged_memory_is_refused_or_bears_any_use(
    name: str, situation: str, build_fmu: Callable[..., Path], elsewhere: Elsewhere, tmp_path: Path
) -> None:
    fmu = build_fmu(name)
    need(load(fmu), SITUATIONS[situation])
    elsewhere.run(fmu, tmp_path / "forged.txt", situation)


def test_the_blocks_with_a_memory_are_found() -> None:
    assert len(REMEMBERING) >= 19 and {*REMEMBERING} <= {*catalogue()}
