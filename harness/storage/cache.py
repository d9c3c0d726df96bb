"""Files that can be made again: each is kept with its hash beside it, and one that does not match is made anew.

A process that is killed, a full disk or a loss of power can leave anything in a file, also in one that was moved to its
place. Both files are replaced as a whole, so that processes that write at the same time do no harm: at worst a file
and a hash of two of them stand side by side for a moment, and a third process makes its own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from harness.storage.atomic import atomic_path


def keep(path: Path, content: bytes) -> None:
    """Write a file with its hash beside it; its folder is made if needed.

    Raises
    ------
    OutputError, OSError
        If it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for target, data in ((path, content), (_beside(path), _hash(content))):
        with atomic_path(target) as temporary:
            temporary.write_bytes(data)


def kept(path: Path) -> bytes | None:
    """Return the content of a file that `keep` wrote; None if it is missing, damaged or cannot be read."""
    try:
        content = path.read_bytes()
        return content if _beside(path).read_bytes() == _hash(content) else None
    except OSError:
        return None


def cached(path: Path, make: Callable[[], bytes]) -> bytes:
    """Return the content of a file that `keep` wrote, or else make and keep it."""
    content = kept(path)
    if content is None:
        content = make()
        keep(path, content)
    return content


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _hash(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
