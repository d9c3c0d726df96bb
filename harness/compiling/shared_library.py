"""Check that the file of a shared library is complete: the loader of Linux ends the process if bytes are missing.

Only the segments that a loader maps are checked. Debug tables may be missing or wrong in libraries that work.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final

LONGEST_TABLE: Final = 1 << 20  # length of the beginning of a file in which its tables are searched [bytes]
_ELF_LOADED: Final = (1, 2)  # PT_LOAD, PT_DYNAMIC
_SEGMENT, _SEGMENT_64 = 0x1, 0x19
_MACH = {0xFEEDFACE: (28, _SEGMENT, "<II", 32), 0xFEEDFACF: (32, _SEGMENT_64, "<QQ", 40)}
_FAT: Final = 0xCAFEBABE


def missing_bytes(path: Path) -> int | None:
    """Return the number of bytes missing at the end of a shared library."""
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
    elif len(content) >= 4 and struct.unpack_from(">I", content)[0] == _FAT:
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
