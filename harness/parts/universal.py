"""Universal binaries of macOS: libraries for several architectures in one file.

``mach-o/fat.h`` defines the format: a big-endian table of the slices, followed by the slices, each aligned to a page.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

MAGIC = 0xCAFEBABE
SLICE_MAGIC = 0xFEEDFACF
"""Magic number of a 64-bit Mach-O file of a little-endian machine."""
PAGE_BITS = 14
"""Alignment of the slices as a power of 2: pages of Apple silicon have 16 kB."""


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
