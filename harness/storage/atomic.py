"""Files that appear complete or not at all."""

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
"""Numbers of the errors of a disk that is full."""


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Path of a temporary file that replaces ``path`` when the block ends well and vanishes when it does not.

    Parameters
    ----------
    path : Path
        The file to be written.

    Yields
    ------
    Path
        An existing empty file in the same folder with the same suffix.

    Raises
    ------
    OutputError
        If the folder does not exist or cannot be written to, or the disk is full.
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
        temporary.chmod(0o666 & ~mask)  # mkstemp makes private files; a result is an ordinary one
        try:
            temporary.replace(path)
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror}; give the path of a file") from error
    except OSError as error:
        raise OutputError(f"cannot write {path}: {_reason(error, name)}; {_remedy(error)}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _reason(error: OSError, temporary: str) -> str:
    """What the system says; libraries put their own text around it. Another file than the temporary one is named."""
    text = os.strerror(error.errno) if error.errno else str(error)
    return text if error.filename in (None, temporary) else f"{text}: {error.filename}"


def _remedy(error: OSError) -> str:
    if error.errno in FULL:
        return "make room or give a path on another disk"
    return "give a path in an existing writable folder"
