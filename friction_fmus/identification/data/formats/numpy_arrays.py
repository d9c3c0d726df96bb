"""Arrays of NumPy: .npz with vectors and matrices, .npy with a matrix or a structured array."""

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.lib import format as npy

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import columns_of, vector_table
from friction_fmus.identification.data.tables import DataTable, limit_size

SUFFIXES: Final = (".npz", ".npy")


def read(path: Path) -> DataTable:
    """Read arrays without objects, which could run code."""
    if zipfile.is_zipfile(path):
        return vector_table(path, _members(path), {}, "arrays of NumPy")
    with path.open("rb") as file:
        array = _array(path, file, path.stat().st_size)
    if array is None:
        raise RecordError(f"{path} contains Python objects, which are not read; save arrays of numbers.")
    return vector_table(path, columns_of("", array), {}, "an array of NumPy")


def _members(path: Path) -> Iterator[tuple[str, Any]]:
    with zipfile.ZipFile(path) as archive:
        infos = [info for info in archive.infolist() if info.filename.endswith(".npy")]
        limit_size(path, sum(info.file_size for info in infos))
        for info in infos:
            with archive.open(info) as member:
                array = _array(path, member, info.file_size)
            if array is not None:
                yield from columns_of(info.filename.removesuffix(".npy"), array)


def _array(path: Path, file: IO[bytes], size: int) -> Any:
    """Return an array that is as large as its header says; None for an array of objects."""
    limit_size(path, size)
    content = file.read(size)
    stream = io.BytesIO(content)
    version = npy.read_magic(stream)
    header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, order, dtype = header(stream)
    if dtype.hasobject:
        return None
    count = int(np.prod([int(each) for each in shape], dtype=object)) if shape else 1
    if count * dtype.itemsize > size - stream.tell():
        raise RecordError(f"{path} has an array of {count} numbers that is cut off; save it again.")
    return np.frombuffer(content, dtype, count, stream.tell()).reshape(shape, order="F" if order else "C")
