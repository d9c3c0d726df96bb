"""Input files: regular files of limited size, so that every read ends."""

from __future__ import annotations

import csv
import errno
import io
import os
import stat
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from harness.errors import BuildError


def stamped() -> str | None:
    """Return the time of ``SOURCE_DATE_EPOCH`` in the format of FMI; None if it is not set."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return None
    try:
        if int(epoch) < 0:
            raise ValueError(epoch)
        return datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError) as error:
        raise BuildError(
            f"SOURCE_DATE_EPOCH is {epoch!r}: set it to a number of seconds since 1970, or remove it"
        ) from error


LARGEST_TEXT: Final = 1 << 22
"""Largest size of a handwritten file, such as a system file or a C file [bytes]."""

LARGEST_DATA: Final = 1 << 30
"""Largest size of a table, or of the content of a compressed table [bytes]."""


def require_regular(path: Path, largest: int | None = None) -> None:
    """Raise an OSError unless the path is a regular file of at most the given size."""
    try:
        found = path.stat()
    except ValueError as error:  # a NUL in the name
        raise OSError(errno.EINVAL, f"no file has this name ({error})") from error
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder")
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file")
    if largest is not None and found.st_size > largest:
        raise OSError(errno.EFBIG, f"it has {found.st_size} bytes; the limit is {largest}")


def read_regular(path: Path, largest: int = LARGEST_TEXT) -> bytes:
    """Return the content of a regular file; arguments and errors are the same as for `require_regular`."""
    require_regular(path, largest)
    with path.open("rb") as file:
        content = file.read(largest + 1)
    if len(content) > largest:  # the file has grown, or the system does not report its size
        raise OSError(errno.EFBIG, f"it has more than the limit of {largest} bytes")
    return content


def read_source(path: Path) -> str:
    """Return the text of a UTF-8 file with line ends converted to ``\\n``."""
    return read_regular(path).decode("utf-8").replace("\r\n", "\n")


def read_csv(path: Path) -> list[list[str]]:
    """Return the non-empty rows of a CSV file in UTF-8."""
    text = read_regular(path, LARGEST_DATA).decode("utf-8-sig")
    try:
        return [line for line in csv.reader(io.StringIO(text, newline="")) if line]
    except csv.Error as error:
        raise ValueError(str(error)) from error


def reason(error: Exception) -> str:
    """Return the text of an exception on one line, without the path that an OSError repeats."""
    said = error.strerror if isinstance(error, OSError) else None
    return " ".join((said or str(error)).split()) or type(error).__name__
