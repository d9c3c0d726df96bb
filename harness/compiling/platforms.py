"""The platforms for which libraries are compiled; one machine can compile for all of them."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import fmpy

from harness.compiling import toolchain
from harness.errors import BuildError, nearest
from harness.parts.universal import universal
from harness.storage.cache import cached


class Platform(NamedTuple):
    """A platform: a folder in the binaries of an FMU.

    Attributes
    ----------
    folder : str
        Name of the folder in FMI 2.0 or, if FMI 2.0 has none, the platform tuple of FMI 3.0.
    suffix : str
        Suffix of a shared library.
    targets : tuple of str or None
        Target of zig, or the targets of the slices of a universal binary. None stands for this machine and the compiler
        ``CC`` if that is set.
    """

    folder: str
    suffix: str
    targets: tuple[str | None, ...]


NATIVE: Final = Platform(fmpy.platform, fmpy.sharedLibraryExtension, (None,))
"""The platform of this machine."""

_CROSS = (
    Platform("linux64", ".so", ("x86_64-linux-gnu.2.17",)),
    Platform("win64", ".dll", ("x86_64-windows-gnu",)),
    # importers on Apple silicon look into darwin64, so it holds both architectures
    Platform("darwin64", ".dylib", ("x86_64-macos", "aarch64-macos")),
    Platform("aarch64-linux", ".so", ("aarch64-linux-gnu.2.17",)),
    Platform("aarch64-darwin", ".dylib", ("aarch64-macos",)),
)
PLATFORMS: Final[Mapping[str, Platform]] = {platform.folder: platform for platform in _CROSS}
"""All platforms by name."""


def select(names: tuple[str, ...]) -> tuple[Platform, ...]:
    """Return the platforms with these names.

    Parameters
    ----------
    names : tuple of str
        Keys of `PLATFORMS`, ``"native"`` for this machine, or ``"all"``.

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


def compiled(
    platform: Platform,
    sources: Mapping[str, str],
    name: str,
    *,
    headers: bool = True,
    units: Sequence[str] | None = None,
) -> bytes:
    """Compile a library for a platform.

    Parameters
    ----------
    platform : Platform
        The target platform.
    sources : mapping of str to str
        Text of each file, by its path.
    name : str
        Name of the library.
    headers : bool
        Whether the sources include the FMI headers.
    units : sequence of str or None
        The files to compile; None stands for ``NAME.c``.

    Raises
    ------
    BuildError
        If the sources do not compile.
    """
    files = tuple(units or (f"{name}.c",))
    slices = [_kept(target, platform.suffix, sources, name, headers, files)[1] for target in platform.targets]
    return universal(slices) if len(slices) > 1 else slices[0]


def native_library(sources: Mapping[str, str], name: str, *, headers: bool = True) -> Path:
    """Compile a library for this machine and return its path in the cache; see `compiled`."""
    return _kept(None, NATIVE.suffix, sources, name, headers, (f"{name}.c",))[0]


def _kept(
    target: str | None, suffix: str, sources: Mapping[str, str], name: str, headers: bool, units: tuple[str, ...]
) -> tuple[Path, bytes]:
    """Return the path in the cache and the content of a library for one architecture; compile it if needed."""
    digest = hashlib.sha256()
    for text in (toolchain.identity(target), name, *(part for item in sorted(sources.items()) for part in item)):
        digest.update(text.encode() + b"\0")
    path = toolchain.cache_folder() / "libraries" / f"{name}-{digest.hexdigest()[:24]}{suffix}"

    def compile_it() -> bytes:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="compile-", dir=path.parent) as scratch:
            for file, text in sources.items():
                place = Path(scratch) / file
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_text(text, encoding="utf-8", newline="\n")
            library = Path(scratch) / f"{name}{suffix}"
            toolchain.compile_library(Path(scratch), units, library, headers=headers, target=target)
            return library.read_bytes()

    return path, cached(path, compile_it)
