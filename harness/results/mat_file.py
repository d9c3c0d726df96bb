"""Results as .mat files as Dymola writes them ("trajectory", version 1.1).

These are MATLAB 4 files with six matrices, which OpenModelica requires in this order:

    Aclass       4 texts, one per row: Atrajectory, 1.1, empty, and binTrans if all other matrices are transposed
    name         names of the variables, one per column, padded with blanks; the first is the time
    description  "text [unit]", in the same layout; complete form of the brackets: "[unit|shown unit:#(type=Integer)]"
    dataInfo     4 rows: 1 or 2 for data_1 or data_2, 0 for the time; index of the row there, from 1 on, negative for
                 the negative of that row; 0 for linear interpolation; -1: not defined outside the record
    data_1       constant variables, one per row, at the first and the last time
    data_2       all other variables, one per row, at all times
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from harness.errors import OutputError
from harness.result import Result
from harness.results.table import from_columns, require_distinct
from harness.storage.files import atomic_path

_TYPES: Final = {"i": "Integer", "b": "Boolean"}
_DTYPES: Final = {"Integer": np.int64, "Boolean": np.bool_}
_DESCRIPTION: Final = re.compile(
    r"(?P<description>.*?)\s*(\[(?P<units>[^\[\]|:]*)(\|[^\[\]:]*)?(?P<properties>(:#\([^\[\]()]*\))*)\])?", re.DOTALL
)
_LARGEST: Final = 1 << 53
_ATTRIBUTES: Final = "attributes"


def to_mat(result: Result, path: str | Path) -> None:
    """Write a result as Dymola does; an additional last matrix holds the attributes of the run as JSON.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    path : path-like
        The file; an existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written, or would round integers above 2^53.
    """
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
    with atomic_path(Path(path)) as temporary:
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
