"""Parquet files (extra ``parquet``)."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from friction_fmus.identification.data.tables import DataTable, from_arrow, limit_size
from harness.extras import require

SUFFIXES: Final = (".parquet", ".pq")


def read(path: Path) -> DataTable:
    """Read a file without unpacking one of gigabytes."""
    require("pyarrow", "reading Parquet files needs it")
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        groups = [file.metadata.row_group(i).total_byte_size for i in range(file.metadata.num_row_groups)]
        limit_size(path, max(8 * file.metadata.num_rows * file.metadata.num_columns, sum(groups)))
    return from_arrow(path, pq.read_table(path))
