"""Builds composites of tests with fewer functions inlined: in two thirds of the time, with results of the same bits.

Each night they are those of users.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from thorough import THOROUGH

from harness.compiling import toolchain

PLACES = (
    *("accuracy", "check", "codegen", "composite", "conditions", "every_block", "exchange", "fmi3", "harness"),
    *("identification", "interop", "laws", "modelica", "models", "shell", "study"),
    *("slow/fuzzing", "slow/importers", "slow/test_exchange_motions.py", "slow/test_fmi3_calls.py"),
    *("docs/test_site.py", "slow/test_fmi3_of_every_block.py"),
)
"""Folders and files of tests that do not measure speed."""

_SECTIONS = toolchain.SECTIONS


def is_quick() -> bool:
    """Whether this test builds quickly."""
    return toolchain.SECTIONS is not _SECTIONS


@contextmanager
def builds_for_users() -> Iterator[None]:
    """Build as ever."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "SECTIONS", _SECTIONS)
        yield


@contextmanager
def quick_builds(path: Path) -> Iterator[None]:
    """Build quickly in a test of such a file."""
    if THOROUGH or not any(path.is_relative_to(place) for place in PLACES):
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "SECTIONS", (*_SECTIONS, "-fno-inline-functions"))  # flags of object files
        yield
