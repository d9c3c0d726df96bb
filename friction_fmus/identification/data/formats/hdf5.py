"""HDF5: data sets as ``group/x``, columns of matrices, fields of compound types; nothing from other files."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import NUMBERS, columns_of, vector_table
from friction_fmus.identification.data.tables import DataTable, limit_size

SUFFIXES: Final = (".h5", ".hdf5", ".hdf", ".he5")

HDF5: Final = b"\x89HDF\r\n\x1a\n"  # signature of HDF5, at offset 512 of a MATLAB 7.3 file or at its start

DEEPEST: Final = 50  # largest depth of groups


def read(path: Path) -> DataTable:
    """Read an HDF5 file; attributes ``units`` of its data sets are their units."""
    vectors, units = [], {}
    for name, dataset in _datasets(path, "/"):
        unit = dataset.attrs.get("units", dataset.attrs.get("unit", ""))
        for column, values in columns_of(name, np.asarray(dataset[()])):
            vectors.append((column, values))
            units[column] = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
    return vector_table(path, vectors, units, "HDF5")


def matlab_vectors(path: Path, objects: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of a file of MATLAB 7.3, which stores columns first; add the classes of objects by name."""
    for name, dataset in _datasets(path, "."):
        if "MATLAB_object_decode" in dataset.attrs:
            objects[name] = str(dataset.attrs.get("MATLAB_class", b"object"), "utf-8")
            continue
        if "MATLAB_empty" in dataset.attrs or dataset.attrs.get("MATLAB_class", b"") == b"char":
            continue
        if dataset.dtype.kind == "O":
            for index, each in enumerate(_members(dataset), start=1):
                yield from columns_of(f"{name}({index})", np.asarray(each[()]).T, "{}(:,{})", 1)
        else:
            yield from columns_of(name, np.asarray(dataset[()]).T, "{}(:,{})", 1)


def _members(dataset: Any) -> Iterator[Any]:
    """Yield the data sets of numbers in a cell, or of a field of a structure array."""
    import h5py

    total = 0
    for reference in np.ravel(dataset[()])[:1000]:
        if isinstance(reference, h5py.Reference) and reference:
            each = dataset.file[reference]
            if (
                isinstance(each, h5py.Dataset)
                and each.dtype.kind in NUMBERS
                and each.attrs.get("MATLAB_class") != b"char"
            ):
                _own(Path(dataset.file.filename), each, each.name)
                total += 8 * (each.size or 0)
                limit_size(Path(dataset.file.filename), total)
                yield each


def _datasets(path: Path, separator: str) -> Iterator[tuple[str, Any]]:
    """Yield the data sets of an HDF5 file, each object once and nothing from other files."""
    import h5py

    seen: set[int] = set()
    total = 0

    def walk(group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
        nonlocal total
        for key in group:
            if key.startswith("#"):
                continue
            if not isinstance(group.get(key, getlink=True), h5py.HardLink):
                raise RecordError(f"{path}: {prefix}{key} is a link; save the data themselves.")
            value = group[key]
            at = h5py.h5o.get_info(value.id).addr
            if at in seen:
                continue
            seen.add(at)
            if isinstance(value, h5py.Group):
                if depth:
                    yield from walk(value, f"{prefix}{key}{separator}", depth - 1)
            elif isinstance(value, h5py.Dataset) and value.dtype.kind in NUMBERS + "VO":
                _own(path, value, f"{prefix}{key}")
                total += max(8, value.dtype.itemsize) * (value.size or 0)
                limit_size(path, total)
                yield prefix + key, value

    with h5py.File(path, "r") as file:
        yield from walk(file, "", DEEPEST)


def _own(path: Path, dataset: Any, name: str) -> None:
    """Raise RecordError for data in another file."""
    if dataset.is_virtual or dataset.external:
        raise RecordError(f"{path}: {name} is stored in another file; save the data themselves.")
