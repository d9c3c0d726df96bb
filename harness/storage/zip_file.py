"""Zip archives from elsewhere (FMU, SSP): everything that is checked before a member is unpacked."""

from __future__ import annotations

import itertools
import stat
import struct
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import IO, Final

LARGEST: Final = 1 << 28
"""What an archive may unpack to however small it is [bytes] ..."""

RATIO: Final = 200
"""... and how many times the size of its file beyond that; deflate makes at most 1030 of it, text 20."""

LONGEST: Final = (255, 1024)
"""Bytes in a name, and in a path, that file systems take; Linux takes 4096 in a path, the folder above included."""

METHODS: Final = {9: "deflate64", 12: "bzip2", 14: "LZMA", 93: "Zstandard", 95: "XZ", 98: "PPMd"}
"""Names of methods of compression."""

_READABLE: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_END: Final = b"PK\x05\x06"
_MISUSE: Final = "do not use this file"
_AGAIN: Final = "copy or export it again"


class ZipError(Exception):
    """Why an archive cannot be used, as the end of a sentence: what is wrong, and what to do."""


class NotZipError(ZipError):
    """The file is not an archive at all."""


def find_absence(path: Path) -> str | None:
    """Why there is no file to be opened, as the end of a sentence; None if there is one.

    Devices and pipes are refused, because reading them may never end.
    """
    if path.is_file():
        return None
    if path.is_dir():
        return "it is a folder"
    return "it is not an ordinary file" if path.exists() else "there is no such file"


def open_zip(source: Path | IO[bytes], size: int | None = None) -> zipfile.ZipFile:
    """Open an archive that can be unpacked without harm.

    Parameters
    ----------
    source : Path or binary file
        The archive.
    size : int or None
        Size of the file on the disk, if the archive is a member of another one [bytes].

    Raises
    ------
    ZipError
        If the archive is damaged, spans several files, or `find_danger` finds a reason.
    OSError
        If the file cannot be read.
    """
    archive = _opened(source)
    danger = find_danger(archive.infolist(), size_of(archive) if size is None else size)
    if danger is not None:
        archive.close()
        raise ZipError(danger)
    return archive


def list_zip(source: Path | IO[bytes]) -> tuple[list[zipfile.ZipInfo], int]:
    """Return the members of an archive, whatever they are, and the size of its file.

    Raises
    ------
    ZipError
        If the archive is damaged or spans several files.
    OSError
        If the file cannot be read.
    """
    with _opened(source) as archive:
        return archive.infolist(), size_of(archive)


def read_zip(archive: zipfile.ZipFile, member: str) -> bytes:
    """Return the content of a member.

    Raises
    ------
    KeyError
        If there is no such member.
    ZipError
        If it is damaged.
    """
    entry = archive.getinfo(member)
    try:
        return archive.read(entry)
    except Exception as error:  # zipfile and the codecs raise many kinds for broken members
        raise ZipError(f"its member '{member}' is damaged ({_reason(error)}); {_AGAIN}") from error


def unpack_zip(archive: zipfile.ZipFile, folder: Path) -> None:
    """Unpack all members below a folder.

    Raises
    ------
    ZipError
        If a member is damaged.
    OSError
        If the disk does not take it.
    """
    for entry in archive.infolist():
        try:
            archive.extract(entry, folder)
        except Exception as error:  # as above
            if isinstance(error, OSError) and error.errno is not None:
                raise  # it comes from the disk, not from a codec
            raise ZipError(f"its member '{entry.filename}' is damaged ({_reason(error)}); {_AGAIN}") from error


def size_of(archive: zipfile.ZipFile) -> int:
    """Return the size of an open archive [bytes]."""
    assert archive.fp is not None
    return archive.fp.seek(0, 2)


def find_danger(entries: Sequence[zipfile.ZipInfo], size: int) -> str | None:
    """Return why an archive must not be unpacked, as the end of a sentence, or None.

    Parameters
    ----------
    entries : sequence of ZipInfo
        Its members.
    size : int
        Size of its file [bytes].
    """
    return next(_dangers(entries, size), None)


def _dangers(entries: Sequence[zipfile.ZipInfo], size: int) -> Iterator[str]:
    for entry in entries:
        if find_outside([entry.orig_filename]) is not None:
            yield f"its member '{entry.orig_filename}' points outside of it; {_MISUSE}"
        if is_special(entry):
            yield f"its member '{entry.filename}' is a symbolic link or another special file; {_MISUSE}"
        if entry.flag_bits & 1:
            yield f"its member '{entry.filename}' is encrypted; zip it without a password"
        if entry.compress_type not in _READABLE:
            yield f"its member '{entry.filename}' is compressed by {method(entry)}; zip it with deflate"
        if is_too_long(entry.filename):
            yield f"its member '{entry.filename[:60]}...' has too long a name; shorten it to {LONGEST[0]} bytes"
    twice = find_twice(normal_name(entry) for entry in entries if not entry.is_dir())
    if twice is not None:
        yield f"it has two members '{twice}'; {_MISUSE}"
    if clashes := find_clashes((normal_name(entry), entry.is_dir()) for entry in entries):
        yield f"its member '{clashes[0]}' is a file and a folder; zip it anew"
    if is_bomb(unpacked_size(entries), size):
        yield f"its {size} bytes unpack to {unpacked_size(entries)}; {_MISUSE}"


def find_outside(members: Iterable[str]) -> str | None:
    """Return the first member that would be written outside of the folder that the archive is unpacked to, if any."""
    for member in members:
        if "\\" in member or ":" in member or member.startswith("/") or ".." in PurePosixPath(member).parts:
            return member
    return None


def is_special(entry: zipfile.ZipInfo) -> bool:
    """Whether a member is a symbolic link, a device or the like."""
    return entry.create_system == 3 and stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR)


def method(entry: zipfile.ZipInfo) -> str:
    """Return the name of the method by which a member is compressed."""
    return METHODS.get(entry.compress_type, f"method {entry.compress_type}")


def is_too_long(name: str) -> bool:
    """Whether file systems refuse a path for its length."""
    return len(name.encode()) > LONGEST[1] or any(len(part.encode()) > LONGEST[0] for part in name.split("/"))


def normal_name(entry: zipfile.ZipInfo) -> str:
    """Return the path to which a member is unpacked."""
    return "/".join(part for part in entry.filename.split("/") if part not in ("", "."))


def find_twice(names: Iterable[str]) -> str | None:
    """Return the first name that stands twice, if any."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def find_clashes(members: Iterable[tuple[str, bool]]) -> list[str]:
    """Return the paths that are files and folders at once.

    Parameters
    ----------
    members : iterable of tuple of str and bool
        Path as of `normal_name`, and whether it is a folder.
    """
    # "\0" sorts before all that names hold, so that what is in a folder comes right after a file of that name
    keys = sorted((name.replace("/", "\0"), folder) for name, folder in members)
    clashes = [""] if ("", False) in keys else []
    for (name, folder), (after, after_folder) in itertools.pairwise(keys):
        if not folder and ((after == name and after_folder) or after.startswith(f"{name}\0")):
            clashes.append(name.replace("\0", "/"))
    return clashes


def unpacked_size(entries: Iterable[zipfile.ZipInfo]) -> int:
    """Return what members declare to unpack to [bytes]; zipfile never unpacks more."""
    return sum(entry.file_size for entry in entries)


def is_bomb(unpacked: int, size: int) -> bool:
    """Whether an archive unpacks to far more than its file holds; the packed sizes that it declares may be lies.

    Parameters
    ----------
    unpacked, size : int
        What all members unpack to, and the size of the file [bytes].
    """
    return unpacked > max(LARGEST, RATIO * size)


def _opened(source: Path | IO[bytes]) -> zipfile.ZipFile:
    if isinstance(source, Path):
        with source.open("rb") as file:
            _refuse_parts(file)
    else:
        _refuse_parts(source)
    try:
        return zipfile.ZipFile(source)
    except NotImplementedError as error:  # zip file version 8.4
        raise ZipError(f"it needs a newer version of the zip format ({_reason(error)}); zip it with deflate") from error
    except Exception as error:  # zipfile raises many kinds for a broken directory
        raise ZipError(f"its directory is damaged ({_reason(error)}); {_AGAIN}") from error


def _refuse_parts(file: IO[bytes]) -> None:
    """Refuse a file without a directory, and the last part of an archive that spans several files."""
    file.seek(-min(file.seek(0, 2), (1 << 16) + 22), 2)
    tail = file.read()
    place = tail.rfind(_END)
    if place < 0 or len(tail) < place + 22:
        raise NotZipError(f"it is not a zip archive; {_AGAIN}")
    disk, first = struct.unpack_from("<HH", tail, place + 4)
    if any(number not in (0, 0xFFFF) for number in (disk, first)):  # 65535: zipfile looks elsewhere
        raise ZipError("it is one part of an archive that spans several files; zip it as one file")


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
