"""Formats of data files, one file each, with the ``SUFFIXES`` of their names and ``read``, which returns a `Table`."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from pathlib import Path
from types import ModuleType

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.tables import Table
from harness.errors import MissingPackageError


def formats() -> dict[str, ModuleType]:
    """Return the module that reads the files with each suffix."""
    modules = [import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    return {suffix: module for module in modules for suffix in module.SUFFIXES}


def read_table(path: Path) -> Table:
    """Read a data file; the suffix determines the format."""
    known, name = formats(), path.name.lower()
    suffix = max((each for each in known if name.endswith(each)), key=len, default=None)
    if suffix is None:
        shown = ", ".join(each for each in known if each.count(".") == 1)
        raise RecordError(f"The format of {path} is unknown; use a file that ends in {shown} or .toml.")
    if not path.is_file():
        raise RecordError(f"There is no data file {path}; correct the path.")
    try:
        table: Table = known[suffix].read(path)
    except (MissingPackageError, RecordError):
        raise
    except Exception as error:  # a damaged file may raise any exception in the libraries
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RecordError(f"{path} cannot be read as a {suffix} file ({reason}); export it again.") from error
    return table
