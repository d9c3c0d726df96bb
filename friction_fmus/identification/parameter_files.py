"""Parameter values as files: SSV (SSP 1.0 parameter set) and TOML."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

import harness
from friction_fmus.errors import FrictionError
from harness import ssp


class ParameterFileError(FrictionError):
    """Parameters that cannot be written to a file."""


@dataclass(frozen=True)
class Parameter:
    """Parameter of a parameter set.

    Attributes
    ----------
    value : float, int or bool
        Value, in `unit`.
    unit : str
        Unit; ignored unless the value is a float.
    description : str
        Description.
    standard_error : float or None
        Standard error, in `unit`; None if the parameter was not estimated.
    """

    value: float | int | bool
    unit: str = "1"
    description: str = ""
    standard_error: float | None = None


def ssv_bytes(name: str, parameters: Mapping[str, Parameter], citation: str = "") -> bytes:
    """Return a parameter set as SSV.

    Parameters
    ----------
    name : str
        Name of the parameter set.
    parameters : mapping of str to Parameter
        Parameters by name in the system, such as ``friction.Fc``.
    citation : str
        Citation of the data that the parameters were identified from; becomes part of the description of the set.

    Returns
    -------
    bytes
        UTF-8 XML, valid against the schema of SSP 1.0.

    Raises
    ------
    ParameterFileError
        If a unit is unknown or a value is not finite.
    """
    listed = {
        key: harness.Parameter(p.value, p.unit if isinstance(p.value, float) else None, description=p.description)
        for key, p in parameters.items()
    }
    description = f"Identified from the record of {citation}" if citation else ""
    try:
        return ssp.ssv_bytes(harness.ParameterSet(name, listed, description))
    except harness.HarnessError as error:
        raise ParameterFileError(str(error)) from error


def toml_text(title: str, sets: Mapping[str, Mapping[str, Parameter]], citation: str = "") -> str:
    """Return parameter sets as TOML.

    Parameters
    ----------
    title : str
        Title of the file.
    sets : mapping of str to mapping of str to Parameter
        Parameters by name of the set.
    citation : str
        Citation of the data.

    Returns
    -------
    str
        One table per parameter, ``[set.name]``, with value, unit, standard_error and description.
    """
    lines = [f"title = {_quoted(title)}"]
    if citation:
        lines.append(f"citation = {_quoted(citation)}")
    for set_name, parameters in sets.items():
        for key, parameter in parameters.items():
            value = str(parameter.value).lower() if isinstance(parameter.value, bool) else repr(parameter.value)
            lines += ["", f"[{_quoted(set_name)}.{_quoted(key)}]", f"value = {value}"]
            lines.append(f"unit = {_quoted(parameter.unit)}")
            error = parameter.standard_error
            if error is not None and math.isfinite(error):
                lines.append(f"standard_error = {error!r}")
            if parameter.description:
                lines.append(f"description = {_quoted(parameter.description)}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    """Return a TOML basic string; the escapes are the same as in JSON, except for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
