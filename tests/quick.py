"""Builds FMUs of tests without optimisation: in a quarter of the time, with results of the same bits.

Each night, and in tests of speed and of commands, they are those of users.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache
from pathlib import Path

import pytest
from thorough import THOROUGH

from harness.compiling import engine_library, toolchain

QUICK = (
    *("accuracy", "check", "codegen", "composite", "conditions", "every_block", "exchange", "export", "fmi3"),
    *("harness", "interop", "laws", "modelica", "models", "reference_set", "shell", "study"),
    *("identification/test_identify.py", "identification/test_injected_force.py"),
)
"""Folders and files of tests that build without optimisation."""
PLACES = (
    "identification",
    *("slow/fuzzing", "slow/importers", "slow/test_exchange_motions.py", "slow/test_fmi3_calls.py"),
    *("docs/test_site.py", "slow/test_fmi3_of_every_block.py"),
)
"""Folders and files of tests that simulate for long or use sanitizers; composites have fewer functions inlined."""
PROBED_LONG = ("LeuvenFeedforward", "ModifiedLeuven", "ModifiedLeuvenFeedforward", "Multisine")
"""Blocks whose dependencies take seconds to probe, and twice as long without optimisation."""

_FOR_USERS = (toolchain.FLAGS, toolchain.SECTIONS)


def options() -> tuple[tuple[str, ...], ...]:
    """What this test builds with."""
    return (toolchain.FLAGS, toolchain.SECTIONS)


def builds_for_users() -> AbstractContextManager[None]:
    """Build as ever."""
    return _builds(*_FOR_USERS)


def builds_of(name: str) -> AbstractContextManager[None]:
    """Build a block whose dependencies take seconds to probe as ever, and others as the test does."""
    return builds_for_users() if name in PROBED_LONG else nullcontext()


@contextmanager
def quick_builds(path: Path) -> Iterator[None]:
    """Build quickly in a test of such a file."""
    with _builds(*_FOR_USERS) if THOROUGH else _builds(*_flags(path)):
        yield


@cache
def _flags(path: Path) -> tuple[tuple[str, ...], ...]:
    flags, sections = _FOR_USERS
    if any(path.is_relative_to(place) for place in QUICK):
        # zig adds checks for undefined behaviour where nothing is optimised
        flags = (*("-O0" if flag == "-O2" else flag for flag in flags), "-fno-sanitize=undefined")
    elif any(path.is_relative_to(place) for place in PLACES):
        sections = (*sections, "-fno-inline-functions")  # flags of object files
    return flags, sections


@contextmanager
def _builds(flags: tuple[str, ...], sections: tuple[str, ...]) -> Iterator[None]:
    if flags is not toolchain.FLAGS:
        engine_library.library()  # the engine is that of users
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", flags)
        patch.setattr(toolchain, "SECTIONS", sections)
        yield
