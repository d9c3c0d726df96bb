"""Vectors of a file of arrays: names, one common length, channels with their own clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import ColumnBuilder, made_table
from friction_fmus.identification.data.heading_rows import Headings, unique_names
from friction_fmus.identification.data.tables import DataTable, limit_size

NUMBERS = "biuf"  # kinds of arrays that are numbers


def columns_of(name: str, array: Any, form: str = "{}[{}]", first: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield a vector, the columns of a matrix, or the fields of a structured array, with their names."""
    if array.dtype.names:
        for each in array.dtype.names:
            yield from columns_of(f"{name}.{each}" if name else each, array[each], form, first)
        return
    if array.dtype.kind not in NUMBERS + "mM":
        return
    array = np.squeeze(array)
    if array.ndim == 1:
        yield name, array
    elif array.ndim in (2, 3):
        if array.ndim == 2 and array.shape[0] < array.shape[1] and array.shape[0] <= 64:
            array = array.T  # a channel per row
        flat = array.reshape(len(array), -1)
        if flat.shape[1] <= 1000:
            for column in range(flat.shape[1]):
                yield (form.format(name, column + first) if name else f"column {column + 1}"), flat[:, column]


def vector_table(path: Path, vectors: Iterable[tuple[str, Any]], units: Mapping[str, str], what: str) -> DataTable:
    """Return the vectors with the most frequent length; others, such as scalars and settings, are ignored."""
    found = [(name, values) for name, values in vectors if values.size >= 3]
    if not found:
        raise RecordError(f"{path} has no numeric vectors; save time, position and force as vectors or matrices.")
    sizes = [values.size for _, values in found]
    length = max(set(sizes), key=lambda size: (sizes.count(size), size))
    kept = [(name, values) for name, values in found if values.size == length]
    limit_size(path, 8 * length * len(kept))
    columns = []
    for name, (_, values) in zip(unique_names([name for name, _ in kept]), kept, strict=True):
        column = ColumnBuilder(name)
        column.add_array(values)
        columns.append(column)
    names = [column.name for column in columns]
    heading = Headings(names, {name: units[name] for name in names if units.get(name)}, given=frozenset(names))
    return made_table(path, columns, heading, None, (), f"{length} rows, {what}")
