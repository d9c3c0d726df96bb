"""Results: one xarray.Dataset per run, and the files it can be written to."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
import xarray as xr

from harness.atomic import atomic_path
from harness.part import Port, Values

Result: TypeAlias = xr.Dataset

_DTYPES: Final = {"Real": np.float64, "Integer": np.int64, "Boolean": np.bool_}


def make_result(
    times: Values, rows: Values, ports: Mapping[str, Port], attributes: Mapping[str, str | float]
) -> Result:
    """A Dataset from recorded rows.

    Parameters
    ----------
    times : float64 array, shape (n,)
        Times of the rows [s].
    rows : float64 array, shape (n, len(ports))
        The values.
    ports : mapping of str to Port
        "part.port" of each column, in order.
    attributes : mapping
        Attributes of the run.

    Returns
    -------
    xarray.Dataset
        One variable per column along ``time``, with attributes ``units`` and ``description`` where they are
        known.
    """
    variables = {}
    for index, (name, port) in enumerate(ports.items()):
        attrs = {"units": port.unit, "description": port.description}
        values = rows[:, index]
        if port.type != "Real" and np.isfinite(values).all():
            values = values.astype(_DTYPES[port.type])
        variables[name] = (
            "time",
            np.ascontiguousarray(values),
            {key: text for key, text in attrs.items() if text},
        )
    return xr.Dataset(variables, coords={"time": ("time", times, {"units": "s"})}, attrs=dict(attributes))


def heading(result: Result, name: str) -> str:
    """Name with unit, for example ``mass.x [m]``; without brackets where there is no unit."""
    unit = result[name].attrs.get("units")
    return f"{name} [{unit}]" if unit else name


def to_csv(result: Result, path: str | Path) -> None:
    """Write a result as CSV: ``time [s]`` and one column per variable, numbers with all their digits.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like
        The file; it is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    names = ["time", *result.data_vars]
    columns = [result[name].to_numpy().tolist() for name in names]
    with atomic_path(Path(path)) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heading(result, str(name)) for name in names)
        writer.writerows(
            # true and false would be no numbers to whoever reads the file
            ([int(value) if value is True or value is False else value for value in row])
            for row in zip(*columns, strict=True)
        )


def to_parquet(result: Result, path: str | Path) -> None:
    """Write a result as Parquet: the unit and description of each column are in its field metadata.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run; its attributes become the metadata of the table.
    path : path-like
        The file; it is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, columns = [], []
    for name in ["time", *result.data_vars]:
        column = pa.array(result[name].to_numpy())
        metadata = {str(key): str(value) for key, value in result[name].attrs.items()}
        fields.append(pa.field(str(name), column.type, metadata=metadata))
        columns.append(column)
    attributes = {str(key): str(value) for key, value in result.attrs.items()}
    table = pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=attributes))
    with atomic_path(Path(path)) as temporary:
        pq.write_table(table, temporary)
