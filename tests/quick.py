"""Builds FMUs of tests without figures, which cost more than to compile.

Their place in the cache is another one, so that no other build finds them; the compiled libraries are those of users.
Each night all FMUs have figures.
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
        yield


_KEY = block_fmu._key


@contextmanager
def quick_builds(path: Path) -> Iterator[None]:
    """Build quickly in a test of such a file."""
    if THOROUGH or path == Path(FIGURES) or not any(path.is_relative_to(place) for place in PLACES):
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(block_contents, "portray", _without_figures)
        patch.setattr(block_fmu, "_key", lambda *given: _KEY(*given)[::-1])
        yield
