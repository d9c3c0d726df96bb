"""Formats of data files, one file each: ``SUFFIXES`` of their names, and ``read``, which returns a `DataTable`.

A format of text that other programs save under any suffix has ``recognises``, which examines the beginning of the text.
"""

import pkgutil
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Final

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.column_builder import unwrapped, wrap_finding
from friction_fmus.identification.data.tables import DataTable, one_clock
from friction_fmus.identification.data.text_file import head_text
from harness.errors import MissingPackageError
from harness.storage.files import reason

SIGNATURES: Final[Mapping[bytes, str]] = {
    b"\x89HDF\r\n\x1a\n": ".h5",
    b"PAR1": ".parquet",
    b"\x89MCAP0\r\n": ".mcap",
    b"\x93NUMPY": ".npy",
    b"PK\x03\x04": ".zip",
    b"\x1f\x8b": ".gz",
    b"\xd0\xcf\x11\xe0": ".xls",
    b"MATLAB 5.0": ".mat",
}
"""First bytes of files, which count more than a suffix of text, and if the suffix is unknown."""


def formats() -> dict[str, ModuleType]:
    """Return the module that reads the files with each suffix."""
    return {suffix: module for module in modules() for suffix in module.SUFFIXES}


def modules() -> list[ModuleType]:
    """Return the modules of all formats."""
    return [import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]


def read_table(path: Path) -> DataTable:
    """Read a data file; its suffix, its first bytes or the beginning of its text determine the format."""
    known = formats()
    suffix = max((each for each in known if path.name.lower().endswith(each)), key=len, default="")
    if not path.is_file():
        if not suffix:
            raise RecordError(_unknown(path, known))
        raise RecordError(f"There is no data file {path}; correct the path.")
    try:
        suffix, module = _format(path, suffix, known)
        table: DataTable = module.read(path)
    except (MissingPackageError, RecordError):
        raise
    except Exception as error:  # a damaged file may raise any exception in the libraries
        raise RecordError(f"{path} cannot be read as a {suffix} file ({reason(error)}); export it again.") from error
    return _continuous(one_clock(table))


def _format(path: Path, suffix: str, known: Mapping[str, ModuleType]) -> tuple[str, ModuleType]:
    """Return the format of a file."""
    text = known[".csv"]
    with path.open("rb") as file:
        first = file.read(16)
    if suffix == ".xls" and not first.startswith((b"PK", b"\xd0\xcf\x11\xe0")):
        suffix = ".csv"  # a text for a spreadsheet, as many drives save it
    if suffix and known[suffix] is not text and not hasattr(known[suffix], "recognises"):
        return suffix, known[suffix]
    signed = next((its for start, its in SIGNATURES.items() if first.startswith(start)), "")
    if signed == ".zip" and suffix.startswith(".xls"):
        signed = ".xlsx"
    if signed in known:
        return signed, known[signed]
    head = head_text(path)
    if not suffix and ("\0" in head or not head.strip()):
        raise RecordError(_unknown(path, known))
    special = (module for module in modules() if hasattr(module, "recognises") and module.recognises(head))
    return suffix or ".csv", next(special, known[suffix] if suffix else text)


def _unknown(path: Path, known: Mapping[str, ModuleType]) -> str:
    shown = ", ".join(each for each in known if each.count(".") == 1)
    how = "Other programs export text, such as TwinCAT Scope a .svdx and LabVIEW a .tdms; mcap convert reads a ROS bag."
    return f"The format of {path} is unknown; use a file that ends in {shown} or .toml. {how}"


def _continuous(table: DataTable) -> DataTable:
    """Return a table whose counters and angles do not wrap around, where this is certain."""
    columns, notes = dict(table.columns), dict(table.notes)
    for name, values in table.columns.items():
        if (found := unwrapped(values)) is not None:
            columns[name], period, count = found
            notes[name] = wrap_finding(name, period, count, table.file.name)
    return replace(table, columns=columns, notes=notes)
