"""Builds FMUs of tests in a third of the time: without optimisation and figures.

The flags are part of every key of the cache, so that no other build finds what is made here. The engine, WebAssembly
and what `builds_for_users` encloses are compiled as ever. `slow/test_source_code.py` compares the bits of both builds;
each night all FMUs are those of users.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from thorough import THOROUGH

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import Description
from friction_fmus.export import block_contents
from friction_fmus.fmi.portrait import Portrait, portray, terminal_icon
from harness import FmuPart
from harness.compiling import platforms, toolchain

UNOPTIMISED = ("-O0", "-fno-sanitize=undefined")
"""Flags in place of ``-O2``; without flags, zig adds a sanitizer."""
PLACES = (
    *("accuracy", "check", "codegen", "composite", "conditions", "every_block", "exchange", "fmi3", "harness"),
    *("identification", "interop", "laws", "models", "portrait", "procedures", "shell", "study"),
    *("slow/fuzzing", "slow/importers", "slow/test_exchange_motions.py", "slow/test_fmi3_calls.py"),
    "slow/test_fmi3_of_every_block.py",
)
"""Folders and files of tests that look neither at figures nor at compiled code."""
FIGURES = "every_block/test_block_documentation.py"
"""A file of tests in these folders that looks at figures."""
LONG = ("LeuvenFeedforward", "ModifiedLeuvenFeedforward")
"""Blocks whose code is evaluated for seconds when they are built, to find what depends on what."""

_PLAIN: set[int] = set()
"""Threads that build what users get; 0 for all threads."""


def _is_plain() -> bool:
    return 0 in _PLAIN or threading.get_ident() in _PLAIN


class _Flags(tuple[str, ...]):
    """Flags of the compiler, which depend on the thread."""

    def __iter__(self) -> Iterator[str]:
        plain = _is_plain()
        return (flag for each in super().__iter__() for flag in ((each,) if plain or each != "-O2" else UNOPTIMISED))


def is_quick() -> bool:
    """Whether this test builds quickly."""
    return isinstance(toolchain.FLAGS, _Flags)


def _optimised(make: Callable[..., Any]) -> Callable[..., Any]:
    def made(*given: Any, **named: Any) -> Any:
        thread = threading.get_ident()
        outer = thread in _PLAIN
        _PLAIN.add(thread)
        try:
            return make(*given, **named)
        finally:
            if not outer:
                _PLAIN.remove(thread)

    return made


@contextmanager
def builds_for_users() -> Iterator[None]:
    """Build as ever in all threads: for FMUs that run long."""
    _PLAIN.add(0)
    try:
        yield
    finally:
        _PLAIN.discard(0)


@contextmanager
def quick_builds(path: Path) -> Iterator[None]:
    """Build quickly in a test of such a file."""
    if THOROUGH or path == Path(FIGURES) or not any(path.is_relative_to(place) for place in PLACES):
        yield
        return
    keep, compile_unit = platforms._kept, platforms._object

    def kept(target: Any, suffix: str, sources: Any, name: str, headers: bool) -> Any:
        slow = not headers or name in LONG  # without headers, it is the engine
        return (_optimised(keep) if slow else keep)(target, suffix, sources, name, headers)

    def unit(target: str | None, *rest: Any, **named: Any) -> Any:
        slow = "wasm" in (target or "")  # without optimisation, a module needs what no browser has
        return (_optimised(compile_unit) if slow else compile_unit)(target, *rest, **named)

    def drawn(block: Block, description: Description, part: FmuPart) -> Portrait:
        if _is_plain():
            return portray(block, description, part)
        return Portrait(terminal_icon("square"), ())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", _Flags(toolchain.FLAGS))
        patch.setattr(platforms, "_kept", kept)
        patch.setattr(platforms, "_object", unit)
        patch.setattr(block_contents, "portray", drawn)
        yield
