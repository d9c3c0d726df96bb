"""A result from the columns of a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from harness.result import Result


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
