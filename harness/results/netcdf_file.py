"""Results as netCDF."""

from __future__ import annotations

from pathlib import Path

import h5py
import xarray as xr

from harness.errors import OutputError
from harness.result import Result
from harness.storage.files import atomic_path


def to_netcdf(result: Result, path: str | Path) -> None:
    """Write a result as netCDF-4, which stores everything in a Dataset.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like
        The file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If a name contains a slash, which netCDF does not allow, or the file cannot be written.
    """
    for name in result.data_vars:
        if "/" in str(name):
            raise OutputError(
                f"cannot write {path}: netCDF does not allow a slash in a name such as '{name}'; use .parquet"
            )
    plain = {name: {"_FillValue": None} for name in result.variables}  # NaN is a value here, not a missing value
    with atomic_path(Path(path)) as temporary:
        # written in memory, as HDF5 crashes at the end of the process if it could not complete a file
        temporary.write_bytes(result.to_netcdf(engine="h5netcdf", encoding=plain))


def from_netcdf(path: Path) -> Result:
    """Read a result from netCDF."""
    # if h5netcdf fails here, it leaves an incomplete object that prints an error when it is deleted
    with h5py.File(path) as root:
        dict(root.attrs)
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False, mask_and_scale=False) as file:
        result = file.load().drop_encoding()
    if "time" not in result.coords:
        raise ValueError("it has no coordinate 'time'")
    for attributes in (result.attrs, *(variable.attrs for variable in result.variables.values())):
        attributes.update({key: value.item() for key, value in attributes.items() if hasattr(value, "item")})
    return result
