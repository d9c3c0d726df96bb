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
        limit_size(path, 8 * file.metadata.num_rows * file.metadata.num_columns)
    return from_arrow(path, pq.read_table(path))
