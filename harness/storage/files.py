"""Input files: regular files of a bounded size, so that reading one always ends."""

from __future__ import annotations

import csv
import errno
import io
import stat
from pathlib import Path
from typing import Final

LARGEST_TEXT: Final = 1 << 22
"""Bytes of a file that is written by hand, such as a system file or a C file."""

LARGEST_DATA: Final = 1 << 30
"""Bytes of a table, or of what a compressed table unpacks to."""


def require_regular(path: Path, largest: int | None = None) -> None:
    """Refuse what cannot be read to an end in bounded time: devices, pipes, and files that are too large.

    Parameters
    ----------
    path : Path
        The file.
    largest : int or None
        Largest size [bytes]; None: any.

    Raises
    ------
    OSError
        If there is no such file, it is not a regular one, or it is too large; `strerror` says which.
    """
    try:
        found = path.stat()
    except ValueError as error:  # a NUL in the name
        raise OSError(errno.EINVAL, f"no file has this name ({error})") from error
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder")
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file")
    if largest is not None and found.st_size > largest:
        raise OSError(errno.EFBIG, f"it has {found.st_size} bytes, and at most {largest} are read")


def read_regular(path: Path, largest: int = LARGEST_TEXT) -> bytes:
    """Return the content of a regular file; arguments and errors are those of `require_regular`."""
    require_regular(path, largest)
    with path.open("rb") as file:
        content = file.read(largest + 1)
    if len(content) > largest:  # it has grown, or is one whose size the system does not tell
        raise OSError(errno.EFBIG, f"it has more than {largest} bytes")
    return content


def read_source(path: Path) -> str:
    """Return the text of a file in UTF-8, with the ends of lines as in C.

    Raises
    ------
    OSError
        As of `read_regular`.
    ValueError
        If it is no such text.
    """
    return read_regular(path).decode("utf-8").replace("\r\n", "\n")


def read_csv(path: Path) -> list[list[str]]:
    """Return the rows of a CSV file in UTF-8 that have cells.

    Raises
    ------
    OSError
        As of `read_regular`.
    ValueError
        If it is no text, or no CSV.
    """
    text = read_regular(path, LARGEST_DATA).decode("utf-8-sig")
    try:
        return [line for line in csv.reader(io.StringIO(text, newline="")) if line]
    except csv.Error as error:
        raise ValueError(str(error)) from error


def reason(error: Exception) -> str:
    """Return what an exception says, on one line and without the path that an OSError repeats."""
    said = error.strerror if isinstance(error, OSError) else None
    return " ".join((said or str(error)).split()) or type(error).__name__
