"""Parameter values as files: SSV (SSP 1.0 parameter set) and TOML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import tomli_w

import harness
from friction_fmus.errors import FrictionError
from harness import ssp


class ParameterFileError(FrictionError):
    """Parameters that cannot be written to a file."""


@dataclass(frozen=True)
class Parameter:
    """Parameter of a parameter set."""

    value: float | int | bool
    """Value, in `unit`."""
    unit: str = "1"
    """Unit; ignored unless the value is a float."""
    description: str = ""
    """Description."""
    standard_error: float | None = None
    """Standard error, in `unit`; None if the parameter was not estimated."""


def ssv_bytes(name: str, parameters: Mapping[str, Parameter], citation: str = "") -> bytes:
    """Return a parameter set as SSV."""
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
    """Return parameter sets as TOML."""
    document: dict[str, Any] = {"title": title, **({"citation": citation} if citation else {})}
    for set_name, parameters in sets.items():
        document[set_name] = {key: _table(parameter) for key, parameter in parameters.items()}
    return tomli_w.dumps(document)


def _table(parameter: Parameter) -> dict[str, Any]:
    found: dict[str, Any] = {"value": parameter.value, "unit": parameter.unit}
    error = parameter.standard_error
    if error is not None and math.isfinite(error):
        found["standard_error"] = error
    if parameter.description:
        found["description"] = parameter.description
    return found
