"""Compressed data files of any of the other formats: .gz, .xz, .bz2, and .zip with one of them."""

import bz2
import gzip
import lzma
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import IO, Any, Final

from friction_fmus.errors import RecordError
from friction_fmus.identification.data import formats, text_file
from friction_fmus.identification.data.tables import DataTable

SUFFIXES: Final = (".gz", ".xz", ".bz2", ".zip")

_OPENERS: Final[dict[str, Callable[..., Any]]] = {".gz": gzip.open, ".xz": lzma.open, ".bz2": bz2.open}

RATIO: Final = 200  # largest ratio of a file to its compressed one
LOOSE: Final = 1 << 26  # size below which any ratio is allowed [bytes]
PIECE: Final = 1 << 20  # number of bytes that are unpacked at once


def read(path: Path) -> DataTable:
    """Unpack a file of limited size into a temporary folder, and read it."""
    with path.open("rb") as file:
        packed_as_zip = file.read(4) == b"PK\x03\x04"
    with tempfile.TemporaryDirectory(prefix="friction-fmus-") as folder:
        if packed_as_zip:
            with zipfile.ZipFile(path) as archive:
                name = _member(path, archive.namelist())
                unpacked = Path(folder) / PurePosixPath(name).name
                with archive.open(name) as source:
                    _copy(path, source, unpacked)
        else:
            suffix = path.suffix.lower()
            unpacked = Path(folder) / (path.stem if suffix in SUFFIXES else f"{path.name}.csv")
            with _OPENERS.get(suffix, gzip.open)(path, "rb") as source:
                _copy(path, source, unpacked)
        if unpacked.suffix.lower() in SUFFIXES:
            raise RecordError(f"{path} contains a compressed file; unpack it once.")
        try:
            table = formats.read_table(unpacked)
        except RecordError as error:
            raise RecordError(str(error).replace(str(unpacked), str(path))) from error
    inside = f"{unpacked.name} in {path.name}: " if packed_as_zip else ""
    return replace(table, file=path, format=f"{inside}{table.format}")


def _copy(path: Path, source: IO[bytes], unpacked: Path) -> None:
    size = left = min(text_file.LARGEST_DATA, max(LOOSE, RATIO * path.stat().st_size))
    with unpacked.open("wb") as file:
        while piece := source.read(PIECE):
            left -= len(piece)
            if left < 0:
                raise RecordError(f"{path} has more than {size} bytes of text; split the file, or unpack it yourself.")
            file.write(piece)


def _member(path: Path, names: Sequence[str]) -> str:
    """Return the only data file in an archive."""
    if "xl/workbook.xml" in names:
        raise RecordError(f"{path} is a workbook; give it the suffix .xlsx.")
    known = tuple(suffix for suffix in formats.formats() if suffix not in SUFFIXES)
    found = [
        name
        for name in names
        if name.lower().endswith(known) and not PurePosixPath(name).name.startswith(".") and "__MACOSX" not in name
    ]
    if len(found) != 1:
        listed = f"{len(found)} data files ({', '.join(found[:5])})" if found else "no data file"
        raise RecordError(f"{path} contains {listed}; unpack it, and use one of them.")
    return found[0]
