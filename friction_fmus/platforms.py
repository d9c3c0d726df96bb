"""The platforms for which FMUs are compiled, all of them on one machine."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import fmpy

from friction_fmus.errors import BuildError, nearest
from friction_fmus.universal import universal
from harness import toolchain


class Platform(NamedTuple):
    """A folder in the binaries of an FMU.

    Attributes
    ----------
    folder : str
        Its name, of FMI 2.0 or, where that has none, the tuple of FMI 3.0.
    suffix : str
        Of a shared library.
    targets : tuple of str or None
        What zig compiles for: one library, or the slices of a universal one. None is this machine, by the compiler
        ``CC`` if that is set.
    """

    folder: str
    suffix: str
    targets: tuple[str | None, ...]


NATIVE: Final = Platform(fmpy.platform, fmpy.sharedLibraryExtension, (None,))
"""This machine."""

_CROSS = (
    Platform("linux64", ".so", ("x86_64-linux-gnu.2.17",)),
    Platform("win64", ".dll", ("x86_64-windows-gnu",)),
    # importers on Apple silicon look into darwin64, so that it has both
    Platform("darwin64", ".dylib", ("x86_64-macos", "aarch64-macos")),
    Platform("aarch64-linux", ".so", ("aarch64-linux-gnu.2.17",)),
    Platform("aarch64-darwin", ".dylib", ("aarch64-macos",)),
)
PLATFORMS: Final[Mapping[str, Platform]] = {platform.folder: platform for platform in _CROSS}
"""Those that can be named."""


def select(names: tuple[str, ...]) -> tuple[Platform, ...]:
    """Platforms by name.

    Parameters
    ----------
    names : tuple of str
        Keys of `PLATFORMS`, ``"native"`` for this machine, ``"all"`` for all.

    Raises
    ------
    BuildError
        For an unknown name.
    """
    chosen: dict[str, Platform] = {}
    for name in names:
        if name not in (known := {"native": NATIVE, "all": NATIVE, **PLATFORMS}):
            raise BuildError(f"There is no platform {name!r}; there are {', '.join(known)}{nearest(name, known)}")
        for platform in PLATFORMS.values() if name == "all" else (known[name],):
            chosen[platform.folder] = platform
    return tuple(chosen.values())


def compiled(platform: Platform, sources: Mapping[str, str], identifier: str) -> bytes:
    """The library of a block for a platform.

    Parameters
    ----------
    platform : Platform
        Where it is to run.
    sources : mapping of str to str
        File name -> text, ``IDENTIFIER.c`` among them.
    identifier : str
        Model identifier.

    Raises
    ------
    BuildError
        If it does not compile.
    """
    slices = [_library(target, platform.suffix, sources, identifier) for target in platform.targets]
    return universal(slices) if len(slices) > 1 else slices[0]


def _library(target: str | None, suffix: str, sources: Mapping[str, str], identifier: str) -> bytes:
    """A library of one architecture, from the cache if it has it."""
    digest = hashlib.sha256()
    for text in (toolchain.identity(target), identifier, *(part for item in sorted(sources.items()) for part in item)):
        digest.update(text.encode() + b"\0")
    kept = toolchain.cache_folder() / "libraries" / f"{identifier}-{digest.hexdigest()[:24]}{suffix}"
    if kept.is_file():
        return kept.read_bytes()
    with tempfile.TemporaryDirectory(prefix="friction-fmus-") as scratch:
        folder = Path(scratch)
        for name, text in sources.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        library = folder / f"{identifier}{suffix}"
        toolchain.compile_library(folder, f"{identifier}.c", library, target=target)
        content = library.read_bytes()
    kept.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(dir=kept.parent, prefix=f".{kept.name}.")
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
    Path(name).replace(kept)
    return content
