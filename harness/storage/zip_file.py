"""Zip archives from any source (FMU, SSP): all checks before a member is unpacked."""

import io
import itertools
import re
import stat
import struct
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import IO, Final

from harness.storage.files import reason

LARGEST: Final = 1 << 28  # unpacked size that every archive may have, however small its file [bytes] ...
RATIO: Final = 200  # ... and beyond, the largest ratio to the size of its file; deflate reaches 1030, text about 20
LONGEST: Final = (255, 1024)  # longest name and path [bytes]; Linux allows 4096 in a path, including the target folder

METHODS: Final = {9: "deflate64", 12: "bzip2", 14: "LZMA", 93: "Zstandard", 95: "XZ", 98: "PPMd"}
"""Names of compression methods."""

_READABLE: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_END: Final = b"PK\x05\x06"
_MISUSE: Final = "do not use this file"
_AGAIN: Final = "copy or export it again"


class ZipError(Exception):
    """An archive cannot be used; the text says what is wrong and what to do, as the end of a sentence."""


class NotZipError(ZipError):
    """The file is not a zip archive."""


def find_absence(path: Path) -> str | None:
    """Return why a path is not a regular file, as the end of a sentence, or None if it is one."""
    # Devices and pipes are rejected, because reading them may never end.
    if path.is_file():
        return None
    if path.is_dir():
        return "it is a folder"
    return "it is not a regular file" if path.exists() else "the file does not exist"


def open_zip(source: Path | IO[bytes], size: int | None = None) -> zipfile.ZipFile:
    """Open an archive after checking that it is safe to unpack."""
    archive = open_unchecked(source)
    danger = next(_dangers(archive.infolist(), size_of(archive) if size is None else size), None)
    if danger is not None:
        archive.close()
        raise ZipError(danger)
    return archive


def read_zip(archive: zipfile.ZipFile, member: str) -> bytes:
    """Return the content of a member."""
    entry = archive.getinfo(member)
    try:
        return archive.read(entry)
    except Exception as error:  # zipfile and the codecs raise many kinds of exceptions for damaged members
        raise ZipError(f"its member '{member}' is damaged ({reason(error)}); {_AGAIN}") from error


def unpack_zip(archive: zipfile.ZipFile, folder: Path, without: tuple[str, ...] = ()) -> None:
    """Unpack all members below a folder."""
    for entry in archive.infolist():
        if entry.filename.startswith(without):
            continue
        try:
            archive.extract(entry, folder)
        except Exception as error:  # as above
            if isinstance(error, OSError) and error.errno is not None:
                raise  # from the file system, not from a codec
            raise ZipError(f"its member '{entry.filename}' is damaged ({reason(error)}); {_AGAIN}") from error


def size_of(archive: zipfile.ZipFile) -> int:
    """Return the size of an open archive [bytes]."""
    assert archive.fp is not None
    return archive.fp.seek(0, 2)


def _dangers(entries: Sequence[zipfile.ZipInfo], size: int) -> Iterator[str]:
    """Yield why an archive is unsafe to unpack, each as the end of a sentence."""
    for entry in entries:
        if find_outside([entry.orig_filename]) is not None:
            yield f"its member '{entry.orig_filename}' points outside the archive; {_MISUSE}"
        if is_special(entry):
            yield f"its member '{entry.filename}' is a symbolic link or another special file; {_MISUSE}"
        if entry.flag_bits & 1:
            yield f"its member '{entry.filename}' is encrypted; zip it without a password"
        if entry.compress_type not in _READABLE:
            yield f"its member '{entry.filename}' is compressed by {method(entry)}; zip it with deflate"
        if is_too_long(entry.filename):
            yield f"its member '{entry.filename[:60]}...' has a name that is too long; shorten it to {LONGEST[0]} bytes"
    twice = find_twice(normal_name(entry) for entry in entries if not entry.is_dir())
    if twice is not None:
        yield f"it has two members '{twice}'; {_MISUSE}"
    if clashes := find_clashes((normal_name(entry), entry.is_dir()) for entry in entries):
        yield f"its member '{clashes[0]}' is both a file and a folder; zip it again"
    if is_bomb(unpacked_size(entries), size):
        yield f"its {size} bytes unpack to {unpacked_size(entries)}; {_MISUSE}"


def find_outside(members: Iterable[str]) -> str | None:
    """Return the first member that would be unpacked outside the target folder, if any."""
    for member in members:
        if "\\" in member or ":" in member or member.startswith("/") or ".." in PurePosixPath(member).parts:
            return member
    return None


def is_special(entry: zipfile.ZipInfo) -> bool:
    """Return whether a member is a symbolic link, a device or another special file."""
    return entry.create_system == 3 and stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR)


def method(entry: zipfile.ZipInfo) -> str:
    """Return the name of a member's compression method."""
    return METHODS.get(entry.compress_type, f"method {entry.compress_type}")


def is_too_long(name: str) -> bool:
    """Return whether a path is too long for common file systems."""
    return len(name.encode()) > LONGEST[1] or any(len(part.encode()) > LONGEST[0] for part in name.split("/"))


def normal_name(entry: zipfile.ZipInfo) -> str:
    """Return the path to which a member is unpacked."""
    return "/".join(part for part in entry.filename.split("/") if part not in ("", "."))


def find_twice(names: Iterable[str]) -> str | None:
    """Return the first repeated name, if any."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def find_clashes(members: Iterable[tuple[str, bool]]) -> list[str]:
    """Return the paths that are both a file and a folder."""
    # "\0" sorts before all characters of names, so the content of a folder follows directly after a file of that name
    keys = sorted((name.replace("/", "\0"), folder) for name, folder in members)
    clashes = [""] if ("", False) in keys else []
    for (name, folder), (after, after_folder) in itertools.pairwise(keys):
        if not folder and ((after == name and after_folder) or after.startswith(f"{name}\0")):
            clashes.append(name.replace("\0", "/"))
    return clashes


def unpacked_size(entries: Iterable[zipfile.ZipInfo]) -> int:
    """Return the declared unpacked size of members [bytes]; zipfile never unpacks more."""
    return sum(entry.file_size for entry in entries)


def is_bomb(unpacked: int, size: int) -> bool:
    """Return whether an archive unpacks to far more than its file size; its declared packed sizes may be false."""
    return unpacked > max(LARGEST, RATIO * size)


def open_file(kind: str, path: Path, error: type[Exception]) -> zipfile.ZipFile:
    """Open a file of the kind "FMU" or "SSP" that is safe to unpack."""
    remedy = f"give the path of an .{kind.lower()} file"
    absence = find_absence(path)
    if absence is not None:
        raise error(f"cannot open {kind} {path}: {absence}; {remedy}")
    try:
        return open_zip(path)
    except NotZipError as fault:
        raise error(f"{path} is not an {kind}: {fault}") from fault
    except ZipError as fault:
        raise error(f"cannot open {kind} {path}: {fault}") from fault
    except OSError as fault:
        raise error(f"cannot open {kind} {path}: {fault.strerror}; {remedy}") from fault


def open_unchecked(source: Path | IO[bytes]) -> zipfile.ZipFile:
    """Open an archive that may be unsafe to unpack."""
    if isinstance(source, Path):
        with source.open("rb") as file:
            _refuse_parts(file)
    else:
        _refuse_parts(source)
    try:
        return zipfile.ZipFile(source)
    except NotImplementedError as error:  # zip file version 8.4
        raise ZipError(f"it needs a newer version of the zip format ({reason(error)}); zip it with deflate") from error
    except Exception as error:  # zipfile raises many kinds of exceptions for a damaged directory
        raise ZipError(f"its directory is damaged ({reason(error)}); {_AGAIN}") from error


def _refuse_parts(file: IO[bytes]) -> None:
    """Raise an error for a file without a directory, or for the last part of a multi-file archive."""
    file.seek(-min(file.seek(0, 2), (1 << 16) + 22), 2)
    tail = file.read()
    place = tail.rfind(_END)
    if place < 0 or len(tail) < place + 22:
        raise NotZipError(f"it is not a zip archive; {_AGAIN}")
    disk, first = struct.unpack_from("<HH", tail, place + 4)
    if any(number not in (0, 0xFFFF) for number in (disk, first)):  # 65535: the number is in the zip64 record
        raise ZipError("it is one part of an archive that spans several files; zip it as one file")


def zipped(members: Mapping[str, bytes], made: str) -> bytes:
    """Return an FMU: sorted members of one time and one mode, so that equal contents give equal bytes."""
    content = io.BytesIO()
    moment = max(tuple(int(part) for part in re.findall(r"\d+", made))[:6], (1980, 1, 1, 0, 0, 0))  # ZIP begins in 1980
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(members.items()):
            entry = zipfile.ZipInfo(name, moment)  # type: ignore[arg-type]
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
    return content.getvalue()
