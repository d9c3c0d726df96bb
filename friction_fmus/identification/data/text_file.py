"""Text of a data file: its encoding, and its content in pieces of limited size."""

from __future__ import annotations

import codecs
import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from friction_fmus.errors import RecordError

LARGEST_DATA: Final = 4 << 30  # largest size of a text [bytes]
LARGEST_TRACE: Final = 1 << 28  # largest size of a text that is not read in pieces [bytes]
HEAD: Final = 1 << 20  # size of the part that determines encoding, separator and headings [bytes]
PIECE: Final = 1 << 24  # number of characters that are parsed at once
LONGEST_LINE: Final = 1 << 20  # largest number of characters of a line


def encoding_of(head: bytes) -> str:
    """Return the encoding of a text from its beginning."""
    for mark, name in ((codecs.BOM_UTF8, "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if head.startswith(mark):
            return name
    for start, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(head) > 3 and head[start::2].count(0) > 0.4 * len(head) // 2 > 2 * head[1 - start :: 2].count(0):
            return name
    if _decoded(head, "utf-8") is not None:
        return "utf-8"
    return next((name for name in USUAL if _is_usual(head, name)), "cp1252")


USUAL: Final = {
    "gbk": (0xA1, ((0xA1A1, 0xA9FE), (0xB0A1, 0xD7F9))),
    "cp932": (0x40, ((0x8140, 0x84BE), (0x889F, 0x9872))),
}
"""Usual characters of encodings with two bytes: the least second byte, and the codes of signs with kana and of level 1
of GB 2312 and JIS X 0208.

Most pairs of a letter with an accent and another byte are codes of rare characters.
"""

NAMES: Final = {"utf-8": "UTF-8", "utf-8-sig": "UTF-8", "cp1252": "ISO-8859-1", "cp932": "Shift-JIS"}
"""Encodings as they are shown; others in capitals."""


def _decoded(head: bytes, encoding: str) -> str | None:
    """Return the beginning of a text; None if it has other bytes than the encoding."""
    try:
        return codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return None


def _is_usual(head: bytes, encoding: str) -> bool:
    """Return whether nine of ten characters beyond ASCII are usual ones of an encoding with two bytes each."""
    least, parts = USUAL[encoding]
    text = _decoded(head, encoding) or ""
    codes = [int.from_bytes(char.encode(encoding)) for char in text if char > "\x7f"]
    usual = sum(code & 0xFF >= least and any(a <= code <= b for a, b in parts) for code in codes)
    return bool(codes) and usual >= 0.9 * len(codes)


def head_text(path: Path) -> str:
    """Return the beginning of a text."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    return head.decode(encoding_of(head), errors="replace")


@contextmanager
def pieces(path: Path) -> Iterator[tuple[str, Iterator[str]]]:
    """Yield the encoding of a text and an iterator over its pieces, which consist of whole lines.

    The first piece has about the size `HEAD`, so that a table can be examined before most of it is read.
    """
    size = path.stat().st_size
    if size > LARGEST_DATA:
        raise RecordError(f"{path} has {size} bytes of text, more than {LARGEST_DATA}; split the file.")
    with path.open("rb") as binary:
        encoding = encoding_of(binary.read(HEAD))
        binary.seek(0)
        with io.TextIOWrapper(binary, encoding, errors="replace", newline=None) as text:
            yield encoding, _pieces(path, text)


def _pieces(path: Path, text: io.TextIOWrapper) -> Iterator[str]:
    line, size = 1, HEAD
    while piece := text.read(size):
        if not piece.endswith("\n"):
            piece += (rest := text.readline(LONGEST_LINE))
            if len(rest) == LONGEST_LINE:
                raise RecordError(
                    f"Line {line + piece.count(chr(10))} of {path} has more than {LONGEST_LINE} characters; use a text "
                    "with one row of numbers per line."
                )
        if "\0" in piece:
            raise RecordError(f"{path} is not a text, it contains zero bytes; give it the suffix of its format.")
        yield piece
        line, size = line + piece.count("\n"), PIECE


def whole_text(path: Path, largest: int) -> str:
    """Return a text of limited size [bytes]."""
    size = path.stat().st_size
    if size > largest:
        raise RecordError(f"{path} has {size} bytes of text, more than {largest} in this format; split the file.")
    with pieces(path) as (_, parts):
        return "".join(parts)
