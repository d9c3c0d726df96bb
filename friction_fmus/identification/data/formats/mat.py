"""Files of MATLAB (vectors, columns of matrices as ``a(:,2)``, members of structures as ``log.x``) and of Dymola."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data import tables
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.data.tables import DataTable, limit_size

SUFFIXES: Final = (".mat",)


HDF5: Final = b"\x89HDF\r\n\x1a\n"  # signature of HDF5, at offset 512 of a MATLAB 7.3 file or at its start


def read(path: Path) -> DataTable:
    """Read a .mat file: MATLAB up to 7.2 with scipy, MATLAB 7.3 with h5py, Dymola with the harness."""
    with path.open("rb") as file:
        header = file.read(520)
    if HDF5 in (header[:8], header[512:]):
        return DataTable(path, _same_length(path, _hdf5(path)))
    limit_size(path, _unpacked(path))
    import scipy.io

    content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    if "Aclass" in content:
        return _trajectory(path)
    return DataTable(path, _same_length(path, (item for key, value in content.items() for item in _flat(key, value))))


def _unpacked(path: Path) -> int:
    """Return the size of the variables of a MATLAB file, counted up to the limit; 0 before version 5."""
    total = 0
    with path.open("rb") as file:
        header = file.read(128)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
        while order and total <= tables.UNPACKED and len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            if kind != COMPRESSED:
                total += size
                file.seek(size, 1)
                continue
            unpacker = zlib.decompressobj()
            rest = file.read(size)
            while rest and total <= tables.UNPACKED:
                total += len(unpacker.decompress(rest, 2**20))
                rest = unpacker.unconsumed_tail
    return total


COMPRESSED: Final = 15  # type of a compressed variable in a MATLAB file of version 5


def _trajectory(path: Path) -> DataTable:
    from harness import load_result

    result = load_result(path)
    columns = {name: result[name].to_numpy().astype(np.float64) for name in ("time", *map(str, result.data_vars))}
    return DataTable(path, columns, {name: result[name].attrs.get("units", "") for name in columns})


def _flat(name: str, value: Any) -> Iterator[tuple[str, Array]]:
    """Yield the vectors of a variable: itself, columns of a matrix ``a(:,1)``, or members of a structure ``a.b``."""
    if name.startswith("__"):
        return
    if hasattr(value, "_fieldnames"):
        for member in value._fieldnames:
            yield from _flat(f"{name}.{member}", getattr(value, member))
        return
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        return
    if array.ndim == 1:
        yield name, array.astype(np.float64)
    elif array.ndim == 2:
        if 1 in array.shape:
            yield name, array.ravel().astype(np.float64)
            return
        for column in range(array.shape[1]):
            yield f"{name}(:,{column + 1})", array[:, column].astype(np.float64)


def _hdf5(path: Path) -> Iterator[tuple[str, Array]]:
    """Yield the vectors of an HDF5 file, each object once and nothing from other files."""
    import h5py

    seen: set[int] = set()
    total = 0

    def walk(group: Any, prefix: str) -> Iterator[tuple[str, Array]]:
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
                yield from walk(value, f"{prefix}{key}.")
            elif isinstance(value, h5py.Dataset) and value.dtype.kind in "biuf" and "MATLAB_empty" not in value.attrs:
                if value.is_virtual or value.external:
                    raise RecordError(f"{path}: {prefix}{key} is stored in another file; save the data themselves.")
                total += 8 * (value.size or 0)
                limit_size(path, total)
                yield from _flat(prefix + key, np.asarray(value[()]).T)  # MATLAB stores columns first

    with h5py.File(path, "r") as file:
        yield from walk(file, "")


def _same_length(path: Path, vectors: Iterator[tuple[str, Array]]) -> dict[str, Array]:
    """Return the vectors with the most frequent length; others, such as scalars and settings, are ignored."""
    found = {name: values for name, values in vectors if values.size >= 3}
    if not found:
        raise RecordError(f"{path} has no numeric vectors; save time, position and force as vectors or matrices.")
    sizes = [values.size for values in found.values()]
    length = max(set(sizes), key=lambda size: (sizes.count(size), size))
    return {name: values for name, values in found.items() if values.size == length}
