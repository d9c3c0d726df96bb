"""Pool of loaded FMUs: unpacking and loading an FMU takes longer than fitting a short record."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from harness import Drive, FmuPart

_IDLE: dict[Path, Drive] = {}
_LOCK = threading.Lock()


@contextmanager
def driven(path: Path) -> Iterator[Drive]:
    """Provide a drive of an FMU for exclusive use; the last one of each FMU stays loaded."""
    with _LOCK:
        drive = _IDLE.pop(path, None)
    drive = drive or Drive(FmuPart(path.stem, path))
    try:
        yield drive
    finally:
        with _LOCK:
            before = _IDLE.pop(path, None)
            _IDLE[path] = drive
        if before is not None:
            before.close()
