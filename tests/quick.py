"""Builds FMUs of tests without figures, which cost more than to compile, and composites with fewer functions inlined.

Their place in the cache is another one, so that no other build finds them; the compiled libraries of blocks are those
of users. Those of composites compile in two thirds of the time, and their results have the same bits. Each night all
FMUs are those of users.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from thorough import THOROUGH

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import Description
from friction_fmus.export import block_contents, block_fmu
from friction_fmus.fmi.portrait import Portrait, portray, terminal_icon
from harness import FmuPart
from harness.compiling import toolchain

PLACES = (
    *("accuracy", "check", "codegen", "composite", "conditions", "every_block", "exchange", "fmi3", "harness"),
    *("identification", "interop", "laws", "modelica", "models", "portrait", "procedures", "shell", "study"),
    *("slow/fuzzing", "slow/importers", "slow/test_exchange_motions.py", "slow/test_fmi3_calls.py"),
    *("docs/test_site.py", "slow/test_fmi3_of_every_block.py"),
)
"""Folders and files of tests that do not look at figures."""
FIGURES = "every_block/test_block_documentation.py"
"""A file of tests in these folders that looks at figures."""


def is_quick() -> bool:
    """Whether this test builds quickly."""
    return block_contents.portray is _without_figures


def _without_figures(_block: Block, _description: Description, _part: FmuPart) -> Portrait:
    return Portrait(terminal_icon("square"), ())


@contextmanager
def builds_for_users() -> Iterator[None]:
    """Build as ever."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(block_contents, "portray", portray)
        patch.setattr(block_fmu, "_key", _KEY)
        patch.setattr(toolchain, "SECTIONS", _SECTIONS)
        yield


_KEY, _SECTIONS = block_fmu._key, toolchain.SECTIONS


@contextmanager
def quick_builds(path: Path) -> Iterator[None]:
    """Build quickly in a test of such a file."""
    if THOROUGH or path == Path(FIGURES) or not any(path.is_relative_to(place) for place in PLACES):
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(block_contents, "portray", _without_figures)
        patch.setattr(block_fmu, "_key", lambda *given: _KEY(*given)[::-1])
        patch.setattr(toolchain, "SECTIONS", (*_SECTIONS, "-fno-inline-functions"))  # flags of object files
        yield
