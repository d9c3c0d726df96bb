"""The platforms for which libraries are compiled, all of them on one machine."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import fmpy

from harness.compiling import toolchain
from harness.errors import BuildError, nearest
from harness.parts.universal import universal
from harness.storage.cache import cached


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
    known = {"native": (NATIVE,), "all": _CROSS, **{platform.folder: (platform,) for platform in _CROSS}}
    for name in names:
        if name not in known:
            raise BuildError(f"There is no platform {name!r}; {nearest(name, known)}")
    return tuple({platform.folder: platform for name in names for platform in known[name]}.values())


def compiled(platform: Platform, sources: Mapping[str, str], name: str, *, headers: bool = True) -> bytes:
    """A library for a platform.

    Parameters
    ----------
    platform : Platform
        Where it is to run.
    sources : mapping of str to str
        File name -> text, ``NAME.c`` among them, the file to compile.
    name : str
        Of the library.
    headers : bool
        Whether it includes the FMI headers.

    Raises
    ------
    BuildError
        If it does not compile.
    """
    slices = [_kept(target, platform.suffix, sources, name, headers)[1] for target in platform.targets]
    return universal(slices) if len(slices) > 1 else slices[0]


def native_library(sources: Mapping[str, str], name: str, *, headers: bool = True) -> Path:
    """A library for this machine, in the cache; arguments as of `compiled`."""
    return _kept(None, NATIVE.suffix, sources, name, headers)[0]


def _kept(target: str | None, suffix: str, sources: Mapping[str, str], name: str, headers: bool) -> tuple[Path, bytes]:
    """A library of one architecture in the cache and its content, compiled if it is not there yet or damaged."""
    digest = hashlib.sha256()
    for text in (toolchain.identity(target), name, *(part for item in sorted(sources.items()) for part in item)):
        digest.update(text.encode() + b"\0")
    path = toolchain.cache_folder() / "libraries" / f"{name}-{digest.hexdigest()[:24]}{suffix}"

    def compile_it() -> bytes:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="compile-", dir=path.parent) as scratch:
            for file, text in sources.items():
                (Path(scratch) / file).write_text(text, encoding="utf-8", newline="\n")
            library = Path(scratch) / f"{name}{suffix}"
            toolchain.compile_library(Path(scratch), f"{name}.c", library, headers=headers, target=target)
            return library.read_bytes()

    return path, cached(path, compile_it)
