"""An identified model as files: FMU and parameter set."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.fmi.package import build
from friction_fmus.identification.data.record import ROTARY
from friction_fmus.identification.fit.models import contact_model
from harness import Parameter, ParameterSet, write_ssv

if TYPE_CHECKING:
    from friction_fmus.identification.result import Identification


def build_identified(result: Identification, folder: Path, name: str | None) -> Path:
    """Build the FMU with the identified values as start values; see `Identification.to_fmu`."""
    rotary = result.records[0].units == ROTARY
    return build(result.block, folder, _start(result), name, domain="rotational" if rotary else "translational")


def viscous_beside(result: Identification) -> float | None:
    """Return the coefficient of the viscous friction beside the block; None if there is none."""
    known = contact_model(result.block, result.records[0].units).parameters
    return None if "Fv" in known else result.values().get("Fv")


def write_viscous(result: Identification, coefficient: float, path: Path) -> Path:
    """Write the viscous friction beside the block as SSV, for a block Viscous."""
    unit = result.records[0].units.viscous
    parameter = Parameter(coefficient, unit, description=f"viscous friction beside {result.model}")
    write_ssv(ParameterSet(f"{result.model}Viscous", {"Fv": parameter}, ""), path)
    return path


def write_parameters(result: Identification, path: Path) -> Path:
    """Write the identified values as SSV; see `Identification.to_ssv`."""
    known = contact_model(result.block, result.records[0].units).parameters
    parameters = {
        name: Parameter(value, known[name].unit if known[name].real else None, description=known[name].text)
        for name, value in _start(result).items()
    }
    cited = sorted({record.citation for record in result.records} - {""})
    description = f"Identified from the record of {'; '.join(cited)}" if cited else ""
    write_ssv(ParameterSet(result.model, parameters, description), path)
    return path


def _start(result: Identification) -> dict[str, float | int | bool]:
    """Return the values of the parameters of the block, converted to their types."""
    known = contact_model(result.block, result.records[0].units).parameters
    return {name: known[name].typed(value) for name, value in result.values().items() if name in known}
