"""Cached files, each stored with its hash; a file that does not match its hash is made again.

A killed process, a full disk or a loss of power can leave a file with arbitrary content, even one that was moved into
place atomically. The file and its hash are both replaced as a whole. Concurrent writers are harmless: at worst, the
file of one and the hash of the other coexist for a moment, and a third process makes its own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from harness.storage.atomic import atomic_path


def keep(path: Path, content: bytes) -> None:
    """Write a file and its hash; create the folder if needed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for target, data in ((_beside(path), _hash(content)), (path, content)):  # a file that exists has its hash
        with atomic_path(target) as temporary:
            temporary.write_bytes(data)


def kept(path: Path) -> bytes | None:
    """Return the content of a file written by `keep`, or None if it is missing, damaged or unreadable."""
    try:
        content = path.read_bytes()
        return content if _beside(path).read_bytes() == _hash(content) else None
    except OSError:
        return None


def cached(path: Path, make: Callable[[], bytes]) -> bytes:
    """Return the content of a file written by `keep`; if there is none, make it and store it."""
    content = kept(path)
    if content is None:
        content = make()
        keep(path, content)
    return content


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _hash(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
