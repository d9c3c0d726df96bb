"""Parquet files (extra ``parquet``)."""

from pathlib import Path
from typing import Final

from friction_fmus.identification.data.column_builder import ColumnBuilder, made_table
from friction_fmus.identification.data.heading_rows import Headings, unique_names
from friction_fmus.identification.data.tables import DataTable, limit_size
from harness.extras import require

SUFFIXES: Final = (".parquet", ".pq")


def read(path: Path) -> DataTable:
    """Read a file without unpacking one of gigabytes; ``units`` in the metadata of its fields are their units."""
    require("pyarrow", "reading Parquet files needs it")
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        groups = [file.metadata.row_group(i).total_byte_size for i in range(file.metadata.num_row_groups)]
        limit_size(path, max(8 * file.metadata.num_rows * file.metadata.num_columns, sum(groups)))
    table = pq.read_table(path)
    columns = [ColumnBuilder(name) for name in unique_names(table.column_names)]
    units = {}
    for column, field, values in zip(columns, table.schema, table.columns, strict=True):
        array = values.to_numpy()
        units[column.name] = (field.metadata or {}).get(b"units", b"s" if array.dtype.kind == "m" else b"").decode()
        if array.dtype.kind in "biufmM":
            column.add_array(array)
        else:
            column.add_objects(values.to_pylist())
    heading = Headings(list(units), units, given=frozenset(units))
    return made_table(path, columns, heading, None, (), f"{table.num_rows} rows, Parquet")
