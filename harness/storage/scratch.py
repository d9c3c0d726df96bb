"""Temporary folders that are removed even if their process was killed: by the next one that makes such a folder."""

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
"""Names of all of them begin with one of these."""

_OWNER: Final = ".owner"


class ScratchFolder(tempfile.TemporaryDirectory[str]):
    """A temporary folder with a file in it that its process holds locked: a lock ends with its process.

    Parameters
    ----------
    prefix : str
        Beginning of its name, which begins with one of `PREFIXES`.
    """

    def __init__(self, prefix: str) -> None:
        """Remove what killed processes have left, and make the folder."""
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
        """Give the lock back; the folder is removed by the base class."""
        if getattr(self, "_owner", None) is not None:
            with suppress(OSError):
                os.close(self._owner)  # type: ignore[arg-type]


if sys.platform == "win32":

    def _claimed(folder: Path) -> int | None:
        """None: Windows has another kind of lock."""
        return None

    def _remove_leftovers(parent: str) -> None:
        """Nothing: it cannot be told whose they are."""

else:
    import fcntl

    def _claimed(folder: Path) -> int | None:
        """Return the descriptor of the locked file; it has its name only when it is locked."""
        handle, name = tempfile.mkstemp(dir=folder)
        fcntl.flock(handle, fcntl.LOCK_EX)
        Path(name).rename(folder / _OWNER)
        return handle

    @cache
    def _remove_leftovers(parent: str) -> None:
        """Remove the folders of this user whose processes have ended without it, once in a process."""
        with suppress(OSError), os.scandir(parent) as entries:
            for entry in [*entries]:
                if entry.name.startswith(PREFIXES) and entry.is_dir(follow_symlinks=False):
                    with suppress(OSError), _abandoned(Path(entry.path)):
                        shutil.rmtree(entry.path, ignore_errors=True)

    @contextmanager
    def _abandoned(folder: Path) -> Iterator[None]:
        """Hold the lock of a folder.

        Raises
        ------
        OSError
            If its process lives, or the folder is not one of ours.
        """
        if folder.lstat().st_uid != os.getuid():
            raise PermissionError(folder)
        handle = os.open(folder / _OWNER, os.O_RDWR | os.O_NOFOLLOW)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
        finally:
            os.close(handle)
