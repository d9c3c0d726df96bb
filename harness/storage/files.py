"""Files: input of limited size, atomic output, scratch folders, and the cache."""

import csv
import errno
import hashlib
import io
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Final

from harness.errors import BuildError, OutputError

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
    """Yield an empty file beside a path, which replaces it if the block succeeds and is removed if it fails."""
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


PREFIX: Final = "harness-"  # beginning of the names of all temporary folders

_OWNER: Final = ".owner"


class ScratchFolder(tempfile.TemporaryDirectory[str]):
    """A temporary folder with a file that its process keeps locked; the lock ends with the process."""

    def __init__(self) -> None:
        _remove_leftovers(tempfile.gettempdir())
        super().__init__(prefix=PREFIX, ignore_cleanup_errors=True)
        self._owner = _claimed(Path(self.name))

    def cleanup(self) -> None:
        """Remove the folder."""
        if self._owner is not None:
            os.close(self._owner)
            self._owner = None
        super().cleanup()

    def __del__(self) -> None:
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
                if entry.name.startswith(PREFIX) and entry.is_dir(follow_symlinks=False):
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


# Cached files, each stored with its hash; a file that does not match its hash is made again.
#
# A killed process, a full disk or a loss of power can leave a file with arbitrary content, even one that was moved into
# place atomically. The file and its hash are both replaced as a whole. Concurrent writers are harmless: at worst, the
# file of one and the hash of the other coexist for a moment, and a third process makes its own.


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


def hash_of(texts: Iterable[str], begin: bytes = b"") -> str:
    """Return the SHA-256 of bytes and the texts after them, in hexadecimal digits."""
    digest = hashlib.sha256(begin)
    for text in texts:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


def relative(file: Path, folder: Path) -> str:
    """Return the path of a file relative to a folder, with slashes; the whole path on another drive of Windows."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:
        return file.resolve().as_posix()


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


LARGEST_TEXT: Final = 1 << 22  # largest size of a handwritten file, such as a system file or a C file [bytes]
LARGEST_DATA: Final = 1 << 30  # largest size of a table, or of the content of a compressed table [bytes]


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
