"""Readers and writers of result files, one pair for each format."""

import csv
import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from harness.errors import OutputError
from harness.extras import require
from harness.result import Result, heading, quoted, split_heading, unquoted
from harness.storage.files import atomic_path, read_csv

_TRUTHS: Final = {"true": True, "false": False}


def to_csv(result: Result, path: Path) -> None:
    """Write a result as CSV: ``time [s]`` and one column per variable, with all digits."""
    # A heading that begins with =, +, - or @ gets a leading apostrophe, so that a spreadsheet reads no formula.
    names = ["time", *result.data_vars]
    columns = [result[name].to_numpy().tolist() for name in names]
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(quoted(heading(result, str(name))) for name in names)
        writer.writerows(
            # most readers would not take true and false for numbers
            ([int(value) if value is True or value is False else value for value in row])
            for row in zip(*columns, strict=True)
        )


def from_csv(path: Path) -> Result:
    """Read a result from CSV; a column of whole numbers without a decimal point becomes an Integer."""
    first, *rows = read_csv(path) or [[""]]
    for number, row in enumerate(rows, start=1):
        if len(row) != len(first):
            raise ValueError(f"its row {number} has {len(row)} cells instead of {len(first)}")
    headings = [split_heading(unquoted(text)) for text in first]
    if headings[0][0].lower() in ("t", "time"):
        headings[0] = "time", headings[0][1]
    require_distinct([name for name, _ in headings])
    cells = zip(*rows, strict=True) if rows else [()] * len(first)
    columns = {name: _column(column) for (name, _), column in zip(headings, cells, strict=True)}
    return from_columns(columns, {name: {"units": unit} for name, unit in headings}, {})


def _column(cells: Sequence[str]) -> NDArray[Any]:
    """Whole numbers, numbers of which empty cells are gaps, truth values, or else texts."""
    for parse in (int, lambda cell: float(cell or "nan"), lambda cell: _TRUTHS[cell.lower()]):
        with suppress(KeyError, ValueError):
            return np.array([parse(cell) for cell in cells])
    return np.array(cells)


def require_distinct(names: Sequence[str]) -> None:
    """Raise a ValueError if two columns have the same name."""
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise ValueError(f"two of its columns are called '{twice[0]}'")


def from_columns(
    columns: Mapping[str, NDArray[Any]], attributes: Mapping[str, Mapping[str, str]], run: Mapping[str, str | float]
) -> Result:
    """Return a Dataset of named columns."""
    if "time" not in columns:
        raise ValueError("it has no column 'time'")
    variables = {}
    for name, values in columns.items():
        if values.size == 0 and values.dtype == object:
            values = values.astype(np.float64)  # a table without rows does not tell its type
        if values.dtype.kind not in "biuf":
            raise ValueError(f"its column '{name}' contains values that are not numbers")
        kept = {key: text for key, text in attributes.get(name, {}).items() if text}
        variables[name] = ("time", np.ascontiguousarray(values), kept)
    times = variables.pop("time")
    return xr.Dataset(
        variables, coords={"time": ("time", times[1].astype(np.float64), {"units": "s"} | times[2])}, attrs=dict(run)
    )


# .mat files as Dymola writes them ("trajectory", version 1.1) are MATLAB 4 files with six matrices, which OpenModelica
# requires in this order:
#
# Aclass       4 texts, one per row: Atrajectory, 1.1, empty, and binTrans if all other matrices are transposed
# name         names of the variables, one per column, padded with blanks; the first is the time
# description  "text [unit]", in the same layout; complete form of the brackets: "[unit|shown unit:#(type=Integer)]"
# dataInfo     4 rows: 1 or 2 for data_1 or data_2, 0 for the time; number of the row there, counted from 1, with a
#              minus for its negative; 0 for linear interpolation; -1: not defined outside the record
# data_1       constant variables, one per row, at the first and the last time
# data_2       all other variables, one per row, at all times
_TYPES: Final = {"i": "Integer", "b": "Boolean"}
_DTYPES: Final = {"Integer": np.int64, "Boolean": np.bool_}
_DESCRIPTION: Final = re.compile(
    r"(?P<description>.*?)\s*(\[(?P<units>[^\[\]|:]*)(\|[^\[\]:]*)?(?P<properties>(:#\([^\[\]()]*\))*)\])?", re.DOTALL
)
_LARGEST: Final = 1 << 53
_ATTRIBUTES: Final = "attributes"


def to_mat(result: Result, path: Path) -> None:
    """Write a result as Dymola does; an additional last matrix holds the attributes of the run as JSON."""
    from scipy.io import savemat

    for name, variable in result.data_vars.items():
        if variable.dtype.kind in "iu" and (np.abs(variable.to_numpy().astype(object)) > _LARGEST).any():
            raise OutputError(
                f"cannot write {path}: '{name}' has integers beyond {_LARGEST}, which a .mat file rounds; use .parquet"
            )
    names = ["time", *(str(name) for name in result.data_vars)]
    data = np.array([result[name].to_numpy().astype(np.float64) for name in names])
    info = np.zeros((4, len(names)), dtype=np.int32)
    info[0, 1:] = 2
    info[1] = np.arange(1, len(names) + 1)
    info[3] = -1
    matrices = {
        "Aclass": _text_matrix(["Atrajectory", "1.1", "", "binTrans"]).T,
        "name": _text_matrix(names),
        "description": _text_matrix([_description(result, name) for name in names]),
        "dataInfo": info,
        "data_1": data[:1, [0, -1]] if data.shape[1] else np.zeros((1, 2)),
        "data_2": data,
        _ATTRIBUTES: _text_matrix([json.dumps(result.attrs, default=str)]).T,
    }
    with atomic_path(path) as temporary:
        savemat(temporary, matrices, appendmat=False, format="4")


def from_mat(path: Path) -> Result:
    """Read a result from a .mat file, also one of Dymola or OpenModelica; constants are repeated at all times."""
    from scipy.io import loadmat

    matrices: dict[str, Any] = loadmat(path, chars_as_strings=False)
    if "Aclass" not in matrices:
        raise ValueError("it has no matrix Aclass, so it is not a trajectory")
    kind = _texts(matrices["Aclass"])
    if kind[:2] != ["Atrajectory", "1.1"]:
        raise ValueError(f"it is a '{' '.join(kind[:2])}', not an 'Atrajectory 1.1'")
    transposed = kind[3] == "binTrans"
    turned = {name: matrix.T if transposed else matrix for name, matrix in matrices.items() if name[:2] != "__"}
    names, descriptions = _texts(turned["name"]), _texts(turned["description"])
    require_distinct(names)
    columns: dict[str, NDArray[Any]] = {}
    attributes = {}
    for name, text, (block, place, *_) in zip(names, descriptions, turned["dataInfo"].tolist(), strict=True):
        match = _DESCRIPTION.fullmatch(text)
        found = match.groupdict(default="") if match else {"description": text}
        values = turned[f"data_{block or 2}"][:, abs(place) - 1].astype(np.float64)
        if block == 1:
            values = np.full(turned["data_2"].shape[0], values[0])
        properties = found.pop("properties", "")
        dtype = next((dtype for kind, dtype in _DTYPES.items() if f"(type={kind})" in properties), np.float64)
        name = "time" if block == 0 else name
        columns[name] = (-values if place < 0 else values).astype(dtype)
        attributes[name] = found
    attributes["time"] = {}  # Dymola describes it as "Time in [s]"
    run = json.loads(_texts(matrices[_ATTRIBUTES])[0]) if _ATTRIBUTES in matrices else {}
    return from_columns(columns, attributes, run)


def _description(result: Result, name: str) -> str:
    variable = result[name]
    text, unit = variable.attrs.get("description", ""), variable.attrs.get("units", "")
    kind = _TYPES.get(variable.dtype.kind)
    brackets = unit + (f":#(type={kind})" if kind else "")
    # empty brackets protect brackets at the end of a description
    return f"{text} [{brackets}]".lstrip() if brackets or text.endswith("]") else str(text)


def _text_matrix(texts: Sequence[str]) -> NDArray[np.bytes_]:
    """Return one text per column, in UTF-8, padded with blanks."""
    lines = [text.encode() for text in texts]
    width = max(1, *map(len, lines))
    return np.array([list(line.ljust(width)) for line in lines], dtype=np.uint8).view("S1").T


def _texts(matrix: NDArray[np.str_]) -> list[str]:
    """Return one text per row."""
    return [_decoded("".join(row).rstrip().encode("latin-1")) for row in matrix.tolist()]


def _decoded(text: bytes) -> str:
    try:
        return text.decode()
    except UnicodeDecodeError:
        return text.decode("latin-1")  # as Dymola writes it


def to_netcdf(result: Result, path: Path) -> None:
    """Write a result as netCDF-4, which stores everything in a Dataset."""
    for name in result.data_vars:
        if "/" in str(name):
            raise OutputError(
                f"cannot write {path}: netCDF does not allow a slash in a name such as '{name}'; use .parquet"
            )
    plain = {name: {"_FillValue": None} for name in result.variables}  # NaN is a value here, not a missing value
    with atomic_path(path) as temporary:
        # written in memory, as HDF5 crashes at the end of the process if it could not complete a file
        temporary.write_bytes(result.to_netcdf(engine="h5netcdf", encoding=plain))


def from_netcdf(path: Path) -> Result:
    """Read a result from netCDF."""
    import h5py

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


_KEPT: Final = ("units", "description")
_NUMBERS: Final = b"numbers"


def to_parquet(result: Result, path: Path) -> None:
    """Write a result as Parquet; the field metadata of each column hold its unit and description."""
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
    with atomic_path(path) as temporary:
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
