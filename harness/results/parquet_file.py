"""Results as Parquet."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from harness.extras import require
from harness.result import Result
from harness.results.table import from_columns
from harness.storage.files import atomic_path

_KEPT: Final = ("units", "description")
_NUMBERS: Final = b"numbers"


def to_parquet(result: Result, path: str | Path) -> None:
    """Write a result as Parquet; the field metadata of each column hold its unit and description.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run; its attributes become metadata of the table, as texts.
    path : path-like
        The file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    require("pyarrow", "writing Parquet files needs it")
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, columns = [], []
    for name in ["time", *result.data_vars]:
        column = pa.array(result[name].to_numpy())
        metadata = {str(key): str(value) for key, value in result[name].attrs.items()}
        fields.append(pa.field(str(name), column.type, metadata=metadata))
        columns.append(column)
    attributes = {str(key): str(value) for key, value in result.attrs.items()}
    # metadata are texts, so the numeric ones are listed
    numbers = [str(key) for key, value in result.attrs.items() if type(value) in (int, float)]
    schema = pa.schema(fields, metadata=attributes | {_NUMBERS: json.dumps(numbers)})
    with atomic_path(Path(path)) as temporary:
        pq.write_table(pa.Table.from_arrays(columns, schema=schema), temporary, write_page_checksum=True)


def from_parquet(path: Path) -> Result:
    """Read a result from Parquet."""
    require("pyarrow", "reading Parquet files needs it")
    import pyarrow.parquet as pq

    table = pq.read_table(path, page_checksum_verification=True)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    attributes = {
        field.name: {key: (field.metadata or {}).get(key.encode(), b"").decode() for key in _KEPT}
        for field in table.schema
    }
    metadata = dict(table.schema.metadata or {})
    numbers = json.loads(metadata.pop(_NUMBERS, b"[]"))
    run = {key.decode(): value.decode() for key, value in metadata.items()}
    return from_columns(columns, attributes, run | {key: _number(run[key]) for key in numbers})


def _number(text: str) -> int | float:
    try:
        return int(text)
    except ValueError:
        return float(text)
