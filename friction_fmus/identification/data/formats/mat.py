"""Files of MATLAB, versions 4 to 7.3, and of Dymola: vectors, matrices as ``a(:,2)``, structures as ``log.x``."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data import tables
from friction_fmus.identification.data.column_builder import columns_of, vector_table
from friction_fmus.identification.data.formats.hdf5 import HDF5, matlab_vectors
from friction_fmus.identification.data.tables import DataTable, limit_size

SUFFIXES: Final = (".mat",)

LABELS: Final = ("label", "Label", "Name", "name", "signalName", "blockName")
"""Members of a structure that name its values."""

VALUES: Final = ("values", "Data", "data", "Value", "value", "Values")  # members of a structure that are its values


def read(path: Path) -> DataTable:
    """Read a .mat file: MATLAB up to 7.2 with scipy, MATLAB 7.3 with h5py, Dymola with the harness."""
    with path.open("rb") as file:
        header = file.read(520)
    objects: dict[str, str] = {}
    if HDF5 in (header[:8], header[512:]):
        return _table(path, matlab_vectors(path, objects), objects, "MATLAB 7.3")
    limit_size(path, _unpacked(path))
    import scipy.io

    content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    if "Aclass" in content:
        return _trajectory(path)
    for key, value in content.items():
        if type(value).__name__ == "MatlabOpaque":
            name, _, kind, *_ = (str(each, "utf-8") if isinstance(each, bytes) else each for each in value.ravel()[0])
            objects[name if key == "None" else key] = kind
    vectors = (each for key, value in content.items() if key not in objects for each in _flat(key, value))
    return _table(path, vectors, objects, "MATLAB")


def _table(path: Path, vectors: Iterator[tuple[str, Any]], objects: dict[str, str], what: str) -> DataTable:
    """Return the vectors of a file; objects of classes, which only MATLAB can read, count as columns of texts."""
    found = list(vectors)
    if objects and not found:
        name, kind = next(iter(objects.items()))
        how = f"{name} = struct('time', {name}.Time, 'data', {name}.Data); or as columns of a .csv"
        if kind.endswith("Dataset"):  # of Simulink; its elements are signals or time series
            how = f"ts = {name}{{1}}.Values (or {name}{{1}}); s1 = struct('time', ts.Time, 'data', ts.Data); and so on"
        how = f"write{kind}({name}, 'log.csv')" if kind in ("table", "timetable") else how
        raise RecordError(
            f"{path} contains {name}, an object of the class {kind}, which only MATLAB reads; save its numbers with "
            f"{how}."
        )
    table = vector_table(path, found, {}, what)
    return replace(table, texts={**table.texts, **{name: f"an object ({kind})" for name, kind in objects.items()}})


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
    units = {name: result[name].attrs.get("units", "") for name in columns}
    return DataTable(path, columns, units, format=f"{len(columns['time'])} rows, trajectory of Dymola")


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of a variable: itself, columns of a matrix ``a(:,1)``, or members of a structure ``a.b``."""
    if name.startswith("__"):
        return
    if hasattr(value, "_fieldnames"):
        members = {member: getattr(value, member) for member in value._fieldnames}
        labels = _labels(members)
        for member, inside in members.items():
            if member == "signals" or (member in VALUES and len(labels) > 1):
                yield from _labelled(name, inside, labels)
            else:
                yield from _flat(f"{name}.{member}", inside)
        return
    array = np.asarray(value)
    if array.dtype == object:
        if array.ndim <= 1 and array.size <= 1000:
            for index, each in enumerate(array.ravel(), start=1):
                yield from _labelled(f"{name}({index})", each, [])
        return
    yield from columns_of(name, array, "{}(:,{})", 1)


def _labelled(name: str, value: Any, labels: list[str]) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of a structure of signals by their labels, without the names of its members."""
    base = name.rpartition("(")[0] or name
    if isinstance(value, np.ndarray) and value.dtype == object:
        for index, each in enumerate(value.ravel()[:1000], start=1):
            yield from _labelled(f"{name}({index})", each, [])
        return
    if hasattr(value, "_fieldnames"):
        members = {member: getattr(value, member) for member in value._fieldnames}
        data = next((member for member in VALUES if member in members), None)
        labels = _labels(members) or labels
        if data is not None:
            yield from _named(base if labels else name, members[data], labels)
            for member, inside in members.items():
                if member in ("time", "Time"):
                    yield from _flat(f"{name}.{member}", inside)
            return
        yield from _flat(name, value)
        return
    yield from _named(base if labels else name, value, labels)


def _named(name: str, value: Any, labels: list[str]) -> Iterator[tuple[str, Any]]:
    found = list(_flat(name, value))
    if len(found) == len(labels):
        yield from ((f"{name}.{label}", values) for label, (_, values) in zip(labels, found, strict=True))
    else:
        yield from found


def _labels(members: dict[str, Any]) -> list[str]:
    """Return the labels in a structure: one text, several with commas between them, or a cell of texts."""
    for member in LABELS:
        value = members.get(member)
        if isinstance(value, str) and value.strip():
            return [label.strip() for label in value.split(",")]
        if isinstance(value, np.ndarray) and value.size and all(isinstance(each, str) for each in value.ravel()):
            return [each.strip() for each in value.ravel()]
    return []
