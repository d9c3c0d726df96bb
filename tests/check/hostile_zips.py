"""Archives that must be refused: each function spoils the archive of some members."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

Spoil = Callable[[Path], object]
ZEROS = bytes(1 << 24)
EXTRA = "resources/extra.bin"
"""A member that no reader asks for."""


def packed(path: Path, members: Mapping[str, bytes]) -> Path:
    """An archive, stored, with a member more."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
        archive.writestr(EXTRA, b"0123456789")
    return path


def _patched(path: Path, offset: int, value: int, form: str, mark: bytes = b"PK\x01\x02") -> None:
    """Change a field of the last record with that mark."""
    data = bytearray(path.read_bytes())
    struct.pack_into(form, data, data.rindex(mark) + offset, value)
    path.write_bytes(data)


def lying_bomb(path: Path) -> None:
    """285 MB of zeros, more than any archive may have, in 0.3 MB that are declared as 2 GB."""
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("resources/zeros", "w") as file:
            for _ in range(17):
                file.write(ZEROS)
        archive.getinfo("resources/zeros").compress_size = (1 << 31) - 1
    assert path.stat().st_size < 2e6


def other_member_lies(path: Path) -> None:
    """The same, with the lie at another member."""
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("resources/zeros", "w") as file:
            for _ in range(17):
                file.write(ZEROS)
        archive.getinfo(EXTRA).compress_size = (1 << 31) - 1


def encrypted(path: Path) -> None:
    """The flag of the directory says so; nothing needs to be encrypted for that."""
    _patched(path, 8, 1, "<H")


def newer_version(path: Path) -> None:
    """A version of the format that does not exist yet."""
    _patched(path, 6, 84, "<H")


def unknown_method(path: Path) -> None:
    """Compressed by deflate64, says the directory."""
    _patched(path, 10, 9, "<H")


def one_of_several(path: Path) -> None:
    """The last of three files."""
    _patched(path, 4, 2, "<H", b"PK\x05\x06")


def one_of_several_large(path: Path) -> None:
    """The same in the words of zip64."""
    data = path.read_bytes()
    end = data.rindex(b"PK\x05\x06")
    path.write_bytes(data[:end] + struct.pack("<4sLQL", b"PK\x06\x07", 0, end, 3) + data[end:])


def file_and_folder(path: Path) -> None:
    """A member that is a folder for another one."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(f"{EXTRA}/more", b"x")


def folder_and_file(path: Path) -> None:
    """The same with an entry for the folder."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(f"{EXTRA}/", b"")


def long_name(path: Path) -> None:
    """A name that no file system takes."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/" + "x" * 300, b"x")


def deep_path(path: Path) -> None:
    """A path that is too long, of short names."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/" + "a/" * 20000 + "x", b"x")


def truncated(path: Path) -> None:
    """The end is missing, and the directory with it."""
    path.write_bytes(path.read_bytes()[:-40])


def cut_in_front(path: Path) -> None:
    """The directory points to what is not there."""
    path.write_bytes(path.read_bytes()[-300:])


def wrong_checksum(path: Path) -> None:
    """A bit of a member differs."""
    path.write_bytes(path.read_bytes().replace(b"0123456789", b"0123456780"))


REFUSED: dict[Spoil, tuple[str, str]] = {
    lying_bomb: ("zip-bomb", "unpack to 285"),
    other_member_lies: ("zip-bomb", "unpack to 285"),
    encrypted: ("zip-encrypted", "password"),
    newer_version: ("not-a-zip", "version 8.4"),
    unknown_method: ("zip-method", "deflate64"),
    one_of_several: ("not-a-zip", "several files"),
    one_of_several_large: ("not-a-zip", "multiple disks"),
    file_and_folder: ("path-clash", "a file and a folder"),
    folder_and_file: ("path-clash", "a file and a folder"),
    long_name: ("path-long", "too long"),
    deep_path: ("path-long", "too long"),
    truncated: ("not-a-zip", "is not a"),
    cut_in_front: ("not-a-zip", "damaged"),
}
"""Spoiled how -> the rule of ``check``, and what every message must name."""
