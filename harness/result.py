"""Results: one xarray.Dataset per run."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from harness.errors import UnknownNameError, nearest
from harness.values import matching

if TYPE_CHECKING:
    import xarray as xr

    from harness.parts.part import Port, Values

    Result: TypeAlias = xr.Dataset


def __getattr__(name: str) -> object:
    """Import xarray when it is first needed: it takes longer than a short run."""
    if name != "Result":
        raise AttributeError(name)
    import xarray as xr

    return xr.Dataset


# the space before the bracket distinguishes a unit, "x [m]", from an index, "k[1]"
_HEADING: Final = re.compile(r"\s*(?P<name>.+?)(?:\s+\[(?P<unit>[^\[\]]*)\])?\s*")
_FORMULA: Final = re.compile(r"'*[=+\-@\t\r]")
DTYPES: Final = {"Real": np.float64, "Integer": np.int64, "Boolean": np.bool_}


def make_result(
    times: Values, rows: Values, ports: Mapping[str, Port], attributes: Mapping[str, str | float]
) -> Result:
    """Return a Dataset of recorded rows."""
    import xarray as xr

    variables = {}
    for index, (name, port) in enumerate(ports.items()):
        attrs = {"units": port.unit, "description": port.description}
        values = rows[:, index]
        if port.type != "Real" and np.isfinite(values).all():
            values = values.astype(DTYPES[port.type])
        variables[name] = ("time", np.ascontiguousarray(values), {key: text for key, text in attrs.items() if text})
    return xr.Dataset(variables, coords={"time": ("time", times, {"units": "s"})}, attrs=dict(attributes))


def heading(result: Result, name: str) -> str:
    """Return the name with its unit, such as ``mass.x [m]``; brackets without a unit protect those of a name."""
    unit = result[name].attrs.get("units") or ""
    return f"{name} [{unit}]" if unit or split_heading(name) != (name, "") else name


def split_heading(text: str) -> tuple[str, str]:
    """Return the name and the unit of such a heading; the unit is empty if there is none."""
    match = _HEADING.fullmatch(text)
    return (match["name"], match["unit"] or "") if match else (text, "")


def quoted(text: str) -> str:
    """Return a heading with an apostrophe before =, +, - or @, so that a spreadsheet does not read it as a formula."""
    # A heading that begins with apostrophes and such a character gets one more apostrophe, so that `unquoted` recovers
    # every heading.
    return f"'{text}" if _FORMULA.match(text) else text


def unquoted(text: str) -> str:
    """Return the heading that `quoted` was given."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def select(result: Result, *patterns: str) -> Result:
    """Select variables of a result.

    Parameters
    ----------
    result : xarray.Dataset
        Result of a run.
    *patterns : str
        Names, in which ``*`` matches any text and ``?`` any character: ``select(result, "mass.*", "friction.F")``.
        Brackets, as in ``k[1]``, are literal.

    Returns
    -------
    xarray.Dataset
        The matching variables, once each: in the order of the patterns, then in the order of the result.

    Raises
    ------
    UnknownNameError
        If a pattern matches no variable.
    """
    known = [str(name) for name in result.data_vars]
    found: dict[str, None] = {}
    for pattern in patterns:
        meant = matching(pattern, known)
        if not meant:
            raise UnknownNameError(f"'{pattern}' was not recorded: {nearest(pattern, known)}")
        found.update(dict.fromkeys(meant))
    return result[["time", *found]]
