"""Temporary folders that are removed even if their process is killed, by the next process that makes one."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Final

PREFIXES: Final = ("harness-", "friction-fmus-")
"""Prefixes of the names of all temporary folders."""

_OWNER: Final = ".owner"


class ScratchFolder(tempfile.TemporaryDirectory[str]):
    """A temporary folder with a file that its process keeps locked; the lock ends with the process."""

    def __init__(self, prefix: str) -> None:
        """Remove folders of killed processes, and make the folder."""
        _remove_leftovers(tempfile.gettempdir())
        super().__init__(prefix=prefix, ignore_cleanup_errors=True)
        self._owner = _claimed(Path(self.name))

    def cleanup(self) -> None:
        """Remove the folder."""
        if self._owner is not None:
            os.close(self._owner)
            self._owner = None
        super().cleanup()

    def __del__(self) -> None:
        """Release the lock; the base class removes the folder."""
        if getattr(self, "_owner", None) is not None:
            with suppress(OSError):
                os.close(self._owner)  # type: ignore[arg-type]


if sys.platform == "win32":

    def _claimed(folder: Path) -> int | None:
        """Return None, as Windows has another kind of lock."""
        return None

    def _remove_leftovers(parent: str) -> None:
        """Do nothing, as the owners of the folders are unknown."""

else:
    import fcntl

    def _claimed(folder: Path) -> int | None:
        """Return the descriptor of the locked file, which gets its final name after it is locked."""
        handle, name = tempfile.mkstemp(dir=folder)
        fcntl.flock(handle, fcntl.LOCK_EX)
        Path(name).rename(folder / _OWNER)
        return handle

    @cache
    def _remove_leftovers(parent: str) -> None:
        """Remove the folders that ended processes of this user have left; once per process."""
        with suppress(OSError), os.scandir(parent) as entries:
            for entry in [*entries]:
                if entry.name.startswith(PREFIXES) and entry.is_dir(follow_symlinks=False):
                    with suppress(OSError), _abandoned(Path(entry.path)):
                        shutil.rmtree(entry.path, ignore_errors=True)

    @contextmanager
    def _abandoned(folder: Path) -> Iterator[None]:
        """Hold the lock of a folder."""
        if folder.lstat().st_uid != os.getuid():
            raise PermissionError(folder)
        handle = os.open(folder / _OWNER, os.O_RDWR | os.O_NOFOLLOW)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
        finally:
            os.close(handle)
