"""The platforms for which libraries are compiled, and whether the file of a library is complete."""

import hashlib
import struct
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from harness.compiling import toolchain
from harness.errors import BuildError, nearest
from harness.processors import available
from harness.storage.files import ScratchFolder, cached, hash_of

LONGEST_TABLE: Final = 1 << 20  # length of the beginning of a file in which its tables are searched [bytes]
_ELF_LOADED: Final = (1, 2)  # PT_LOAD, PT_DYNAMIC
_SEGMENT, _SEGMENT_64 = 0x1, 0x19
_MACH = {0xFEEDFACE: (28, _SEGMENT, "<II", 32), 0xFEEDFACF: (32, _SEGMENT_64, "<QQ", 40)}


def missing_bytes(path: Path) -> int | None:
    """Return the number of bytes missing at the end of a shared library, which end a process of Linux that loads it."""
    # only the segments that a loader maps are checked: debug tables may be missing in libraries that work
    with path.open("rb") as file:
        return missing_of(file.read(LONGEST_TABLE), path.stat().st_size)


def missing_of(beginning: bytes, size: int) -> int | None:
    """Return the same as `missing_bytes`, from the first `LONGEST_TABLE` bytes of a file and its size."""
    try:
        ends = list(_ends(beginning))
    except struct.error:
        return None
    return max(0, max(ends) - size) if ends else None


def _ends(content: bytes) -> Iterator[int]:
    """Yield the end of each segment of a library in its file; nothing for an unknown format."""
    if content[:4] == b"\x7fELF":
        yield from _elf(content)
    elif content[:2] == b"MZ":
        yield from _pe(content)
    elif len(content) >= 4 and struct.unpack_from("<I", content)[0] in _MACH:
        yield from _mach(content)
    elif len(content) >= 4 and struct.unpack_from(">I", content)[0] == MAGIC:
        (count,) = struct.unpack_from(">I", content, 4)
        for index in range(count):
            offset, size = struct.unpack_from(">II", content, 8 + 20 * index + 8)
            yield offset + size


def _elf(content: bytes) -> Iterator[int]:
    order = ">" if content[5:6] == b"\2" else "<"
    wide = content[4:5] == b"\2"
    (table,) = struct.unpack_from(order + ("Q" if wide else "I"), content, 32 if wide else 28)
    size, count = struct.unpack_from(order + "HH", content, 54 if wide else 42)
    yield table + size * count
    for index in range(count):
        at = table + size * index
        (kind,) = struct.unpack_from(order + "I", content, at)
        offset = struct.unpack_from(order + ("Q" if wide else "I"), content, at + (8 if wide else 4))[0]
        length = struct.unpack_from(order + ("Q" if wide else "I"), content, at + (32 if wide else 16))[0]
        if kind in _ELF_LOADED:
            yield offset + length


def _pe(content: bytes) -> Iterator[int]:
    (header,) = struct.unpack_from("<I", content, 0x3C)
    if content[header : header + 4] != b"PE\0\0":
        return
    (count,) = struct.unpack_from("<H", content, header + 6)
    (optional,) = struct.unpack_from("<H", content, header + 20)
    for index in range(count):
        size, offset = struct.unpack_from("<II", content, header + 24 + optional + 40 * index + 16)
        yield offset + size


def _mach(content: bytes) -> Iterator[int]:
    at, wanted, form, place = _MACH[struct.unpack_from("<I", content)[0]]
    (count,) = struct.unpack_from("<I", content, 16)
    for _ in range(count):
        kind, size = struct.unpack_from("<II", content, at)
        if kind == wanted:
            offset, length = struct.unpack_from(form, content, at + place)
            yield offset + length
        at += max(size, 8)


# Universal binaries of macOS: libraries for several architectures in one file.
#
# ``mach-o/fat.h`` defines the format: a big-endian table of the slices, followed by the slices, each aligned to a page.

MAGIC = 0xCAFEBABE
SLICE_MAGIC = 0xFEEDFACF  # magic number of a 64-bit Mach-O file of a little-endian machine
PAGE_BITS = 14  # alignment of the slices as a power of 2: pages of Apple silicon have 16 kB


def universal(slices: Sequence[bytes]) -> bytes:
    """Return one binary for several architectures."""
    page = 1 << PAGE_BITS
    header = struct.pack(">II", MAGIC, len(slices))
    content = b""
    for each in slices:
        magic, cpu, kind = struct.unpack_from("<III", each) if len(each) >= 12 else (0, 0, 0)
        if magic != SLICE_MAGIC:
            raise ValueError(f"A slice of a universal binary begins with {magic:#x} and is not a 64-bit Mach-O file")
        content += b"\0" * (-len(content) % page)
        header += struct.pack(">IIIII", cpu, kind, page + len(content), len(each), PAGE_BITS)
        content += each
    return header + b"\0" * (page - len(header)) + content


class Platform(NamedTuple):
    """A platform: a folder in the binaries of an FMU."""

    folder: str  # name of the folder in FMI 2.0 or, if FMI 2.0 has none, the platform tuple of FMI 3.0
    suffix: str  # suffix of a shared library
    targets: tuple[str | None, ...]
    """Target of zig, or the targets of the slices of a universal binary. None stands for this machine and the compiler
    ``CC`` if that is set."""


_SYSTEM, _SUFFIX = {"win32": ("win", ".dll"), "darwin": ("darwin", ".dylib")}.get(sys.platform, ("linux", ".so"))
NATIVE: Final = Platform(f"{_SYSTEM}{64 if sys.maxsize > 1 << 32 else 32}", _SUFFIX, (None,))  # this machine

_CROSS = (
    Platform("linux64", ".so", ("x86_64-linux-gnu.2.17",)),
    Platform("win64", ".dll", ("x86_64-windows-gnu",)),
    # importers on Apple silicon look into darwin64, so it holds both architectures
    Platform("darwin64", ".dylib", ("x86_64-macos", "aarch64-macos")),
    Platform("aarch64-linux", ".so", ("aarch64-linux-gnu.2.17",)),
    Platform("aarch64-darwin", ".dylib", ("aarch64-macos",)),
)
PLATFORMS: Final[Mapping[str, Platform]] = {platform.folder: platform for platform in _CROSS}  # by name

WASM: Final = Platform("wasm32", ".wasm", ("wasm32-wasi",))
"""A WebAssembly module. FMI has no such platform, so that it is not in `PLATFORMS`."""


def select(names: tuple[str, ...]) -> tuple[Platform, ...]:
    """Return the platforms with these names."""
    known = {"native": (NATIVE,), "all": _CROSS, **{each.folder: (each,) for each in (*_CROSS, WASM)}}
    for name in names:
        if name not in known:
            raise BuildError(f"There is no platform {name!r}; {nearest(name, known)}")
    return tuple({platform.folder: platform for name in names for platform in known[name]}.values())


def compiled(platform: Platform, sources: Mapping[str, str], name: str, *, headers: bool = True) -> bytes:
    """Compile a library for a platform."""
    slices = [_kept(target, platform.suffix, sources, name, headers)[1] for target in platform.targets]
    return universal(slices) if len(slices) > 1 else slices[0]


def linked(platform: Platform, units: Mapping[str, Mapping[str, str]], name: str, quiet: Collection[str] = ()) -> bytes:
    """Compile and link a library of several C files for a platform; the object of each file is cached."""
    slices = [_linked(target, units, f"{name}{platform.suffix}", quiet)[1] for target in platform.targets]
    return universal(slices) if len(slices) > 1 else slices[0]


def inlined(units: Mapping[str, Mapping[str, str]], name: str) -> Path:
    """Compile a library of several C files for this machine, with functions inlined across files; return its path."""
    return _linked(None, units, f"{name}{NATIVE.suffix}", (), toolchain.INLINING)[0]


def _linked(
    target: str | None,
    units: Mapping[str, Mapping[str, str]],
    library: str,
    quiet: Collection[str],
    inlining: Sequence[str] = (),
) -> tuple[Path, bytes]:
    def make(unit: str) -> bytes:
        return _object(target, unit, units[unit], warns=unit not in quiet, inlining=inlining)

    with ThreadPoolExecutor(available()) as pool:
        objects = dict(zip(units, pool.map(make, units), strict=True))
    flags = " ".join(toolchain.object_flags(target, inlining))
    digest = _digest(
        target, f"{library} {flags}", {unit: hashlib.sha256(data).hexdigest() for unit, data in objects.items()}
    )

    def link_it() -> bytes:
        with _scratch() as scratch:
            for number, data in enumerate(objects.values()):
                (scratch / f"{number}.o").write_bytes(data)
            names = [f"{number}.o" for number in range(len(objects))]
            toolchain.link_library(scratch, names, scratch / library, target=target, inlining=inlining)
            return (scratch / library).read_bytes()

    path = toolchain.cache_folder() / "libraries" / f"{digest}-{library}"
    return path, cached(path, link_it)


def assembly(target: str | None, unit: str, sources: Mapping[str, str]) -> str:
    """Return a C file of another tool as assembly, which tells the symbols that it defines; see `linked`."""
    return _object(target, unit, sources, warns=False, form="-S").decode(errors="replace")


def _object(
    target: str | None,
    unit: str,
    sources: Mapping[str, str],
    *,
    warns: bool,
    form: str = "-c",
    inlining: Sequence[str] = (),
) -> bytes:
    """Return the object of one C file, from the cache or compiled."""

    def compile_to(form: str) -> bytes:
        with _scratch() as scratch:
            _write(scratch, sources)
            output = scratch / "unit.o"
            toolchain.compile_object(scratch, unit, output, form=form, warns=warns, target=target, inlining=inlining)
            return output.read_bytes()

    # a file of another tool may include files of this machine, which only the preprocessor finds
    whole = "" if warns else compile_to("-E").decode(errors="replace")
    quiet = () if warns else toolchain.QUIET
    digest = _digest(target, " ".join((unit, form, *toolchain.SECTIONS, *quiet, *inlining, whole)), sources)
    return cached(toolchain.cache_folder() / "objects" / f"{digest}.o", lambda: compile_to(form))


@contextmanager
def _scratch() -> Iterator[Path]:
    """Yield a folder that is removed at the end, so that no path of the cache enters a binary."""
    with ScratchFolder() as scratch:
        yield Path(scratch)


def _write(folder: Path, sources: Mapping[str, str]) -> None:
    for file, text in sources.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8", newline="\n")


def _digest(target: str | None, name: str, sources: Mapping[str, str]) -> str:
    """Return a hash of everything that determines a compiled file."""
    parts = (part for item in sorted(sources.items()) for part in item)
    return hash_of((toolchain.identity(target), name, *parts))[:24]


def native_library(sources: Mapping[str, str], name: str, *, headers: bool = True) -> Path:
    """Compile a library for this machine and return its path in the cache; see `compiled`."""
    return _kept(None, NATIVE.suffix, sources, name, headers)[0]


def _kept(target: str | None, suffix: str, sources: Mapping[str, str], name: str, headers: bool) -> tuple[Path, bytes]:
    """Return the path in the cache and the content of a library for one architecture; compile it if needed."""
    path = toolchain.cache_folder() / "libraries" / f"{name}-{_digest(target, name, sources)}{suffix}"

    def compile_it() -> bytes:
        with _scratch() as scratch:
            _write(scratch, sources)
            library = scratch / f"{name}{suffix}"
            toolchain.compile_library(scratch, f"{name}.c", library, headers=headers, target=target)
            return library.read_bytes()

    return path, cached(path, compile_it)
