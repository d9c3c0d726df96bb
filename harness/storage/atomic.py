"""Files that are written completely or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from harness.errors import OutputError

FULL: Final = frozenset(
    getattr(errno, name)
    for name in ("ENOSPC", "EFBIG", "EDQUOT")
    if hasattr(errno, name)  # Windows has no quota
)
"""Error numbers of a full disk or an exceeded quota."""


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, unless it exists."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {path}: {error.strerror}; give another one") from error


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file that replaces ``path`` if the block succeeds and is removed if it fails.

    Parameters
    ----------
    path : Path
        The file to write.

    Yields
    ------
    Path
        An existing empty file in the same folder, with the same suffix.

    Raises
    ------
    OutputError
        If the folder does not exist or is not writable, or if the disk is full.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    except OSError as error:
        raise OutputError(
            f"cannot write {path}: {error.strerror}; give a path in an existing writable folder"
        ) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp makes private files; a result has the usual permissions
        try:
            temporary.replace(path)
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror}; give the path of a file") from error
    except OSError as error:
        raise OutputError(f"cannot write {path}: {_reason(error, name)}; {_remedy(error)}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _reason(error: OSError, temporary: str) -> str:
    """Return the system's error text without what libraries add; name the file if it is not the temporary one."""
    text = os.strerror(error.errno) if error.errno else str(error)
    return text if error.filename in (None, temporary) else f"{text}: {error.filename}"


def _remedy(error: OSError) -> str:
    if error.errno in FULL:
        return "free some space or give a path on another disk"
    return "give a path in an existing writable folder"
