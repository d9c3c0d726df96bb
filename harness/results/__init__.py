"""Result files: CSV, Parquet, netCDF, and .mat files as Dymola writes them."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from harness.errors import MissingPackageError, OutputError, ResultFileError
from harness.storage.files import reason

if TYPE_CHECKING:
    from harness.result import Result

__all__ = ["FORMATS", "load_result", "save_result"]

FORMATS: Final = {".csv": "csv", ".parquet": "parquet", ".nc": "netcdf", ".mat": "mat"}
"""Format of each suffix; `harness.results.formats` has the functions ``to_FORMAT`` and ``from_FORMAT``."""


def save_result(result: Result, path: str | Path) -> None:
    """Write a result in the format of the file's suffix: .csv, .parquet, .nc or .mat.

    All formats keep units and all digits of the values. All but CSV also keep descriptions, the attributes of the run
    and the types Integer and Boolean; CSV writes a Boolean as 0 or 1.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like
        The file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the suffix is unknown, the file cannot be written, or its format cannot hold the result: a name with a slash
        in .nc, an integer above 2^53 in .mat.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise OutputError(f"{path} has no known format: use a name that ends in {_suffixes()}")
    _function("to", suffix)(result, Path(path))


def load_result(path: str | Path) -> Result:
    """Read a result from a file; the suffix selects the format.

    A .mat file may also come from Dymola or OpenModelica. Files of the other formats may come from any program that
    writes a table with a column ``time``.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    xarray.Dataset
        The result, as `System.run` returns it.

    Raises
    ------
    ResultFileError
        If the suffix is unknown or the file cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise ResultFileError(f"{path} has no known format: give a file that ends in {_suffixes()}")
    if not path.is_file():
        raise ResultFileError(f"cannot read the result {path}: the file does not exist; give the path of a result file")
    read = _function("from", suffix)
    try:
        result: Result = read(path)
    except MissingPackageError:
        raise
    except Exception as error:  # for a damaged file, the libraries raise many kinds of exceptions
        raise ResultFileError(f"cannot read the result {path}: {reason(error)}; give a file of this format") from error
    return result


def _function(direction: str, suffix: str) -> Callable[..., Any]:
    """Return the writer ("to") or reader ("from") for a suffix, and import the libraries of the format."""
    name = FORMATS[suffix]
    function: Callable[..., Any] = getattr(import_module("harness.results.formats"), f"{direction}_{name}")
    return function


def _suffixes() -> str:
    *first, last = FORMATS
    return f"{', '.join(first)} or {last}"
