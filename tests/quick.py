"""Builds FMUs of tests in a third of the time: without optimisation and figures.

The FMUs of the blocks in FMI 2.0, as users get them, are compiled as ever; this is for FMUs with other start values or
of other files, rotational ones, those of FMI 3.0 and composites. The flags are part of every key
of the cache, so that no other build finds what is made here. Each night all FMUs are those of users.
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
from friction_fmus.export import block_contents, block_fmu
from friction_fmus.fmi.portrait import Portrait, portray, terminal_icon
from harness import FmuPart
from harness.compiling import platforms, toolchain

UNOPTIMISED = ("-O0", "-fno-sanitize=undefined")
"""Flags in place of ``-O2``; without flags, zig adds a sanitizer."""
FOLDERS = {
    *("accuracy", "check", "codegen", "composite", "conditions", "every_block", "exchange", "fmi3", "harness"),
    *("identification", "interop", "laws", "models", "portrait", "procedures", "shell", "study"),
}
"""Folders of tests that look neither at figures nor at compiled code."""


_PLAIN: set[int] = set()
"""Threads that build what users get; 0 for all threads."""


def _is_plain() -> bool:
    return 0 in _PLAIN or threading.get_ident() in _PLAIN


class _Flags(tuple[str, ...]):
    """Flags of the compiler, which depend on the thread."""

    def __iter__(self) -> Iterator[str]:
        plain = _is_plain()
        return (flag for each in super().__iter__() for flag in ((each,) if plain or each != "-O2" else UNOPTIMISED))


def _as_users_get_it(make: Callable[..., Any]) -> Callable[..., Any]:
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
def quick_builds(folder: str) -> Iterator[None]:
    """Build quickly in a test of such a folder."""
    if THOROUGH or folder not in FOLDERS:
        yield
        return
    make, keep, compile_unit = block_fmu.block_source, platforms._kept, platforms._object

    def built(
        model: str | Path,
        start: Any = None,
        name: Any = None,
        files: Any = None,
        domain: str = "translational",
        *rest: Any,
    ) -> Any:
        plain = not (start or name or files) and domain == "translational" and not Path(model).suffix
        return (_as_users_get_it(make) if plain else make)(model, start, name, files, domain, *rest)

    def kept(target: Any, suffix: str, sources: Any, name: str, headers: bool) -> Any:
        engine = not headers
        return (_as_users_get_it(keep) if engine else keep)(target, suffix, sources, name, headers)

    def unit(target: str | None, *rest: Any, **named: Any) -> Any:
        slow = "wasm" in (target or "")  # without optimisation, a module needs what no browser has
        return (_as_users_get_it(compile_unit) if slow else compile_unit)(target, *rest, **named)

    def drawn(block: Block, description: Description, part: FmuPart) -> Portrait:
        if _is_plain():
            return portray(block, description, part)
        return Portrait(terminal_icon("square"), ())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "FLAGS", _Flags(toolchain.FLAGS))
        patch.setattr(block_fmu, "block_source", built)
        patch.setattr(block_fmu, "native_library", _as_users_get_it(platforms.native_library))
        patch.setattr(platforms, "_kept", kept)
        patch.setattr(platforms, "_object", unit)
        patch.setattr(block_contents, "portray", drawn)
        yield
