"""Parameter values as files: SSV (SSP 1.0 parameter set) and TOML."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

import fmpy
from lxml import etree

from friction_fmus.errors import FrictionError

#: Namespaces of System Structure and Parameterization 1.0 (Modelica Association, 2019).
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"

#: Media type under which an SSD refers to such a file.
MEDIA_TYPE = "application/x-ssp-parameter-set"

#: Unit -> exponents of the SI base units (SSP 1.0 section 4.5.3, as in FMI 2.0).
BASE_UNITS: Mapping[str, Mapping[str, int]] = MappingProxyType(
    {
        "1": {},
        "s": {"s": 1},
        "1/s": {"s": -1},
        "m": {"m": 1},
        "m/s": {"m": 1, "s": -1},
        "kg": {"kg": 1},
        "N": {"kg": 1, "m": 1, "s": -2},
        "N/m": {"kg": 1, "s": -2},
        "N.s/m": {"kg": 1, "s": -1},
        "rad": {"rad": 1},
        "rad/s": {"rad": 1, "s": -1},
        "kg.m2": {"kg": 1, "m": 2},
        "N.m": {"kg": 1, "m": 2, "s": -2},
        "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    }
)


class ParameterFileError(FrictionError):
    """Parameters cannot be written as asked."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a parameter set.

    Attributes
    ----------
    value : float, int or bool
        Its value, in `unit`.
    unit : str
        Unit; only a float has one.
    description : str
        What it is.
    standard_error : float or None
        Standard error, in `unit`, where it was estimated.
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
        By name in the system, such as ``friction.Fc``.
    citation : str
        Whom to cite for the data the parameters come from; goes to the description of the set.

    Returns
    -------
    bytes
        UTF-8 XML, valid against the schema of SSP 1.0.

    Raises
    ------
    ParameterFileError
        A unit is unknown or a value is not finite.
    """
    root = etree.Element(
        f"{{{SSV}}}ParameterSet",
        attrib={"version": "1.0", "name": name, "generationTool": "friction-fmus"},
        nsmap={"ssv": SSV, "ssc": SSC},
    )
    if citation:
        root.set("description", f"Identified from the record of {citation}")
    listed = etree.SubElement(root, f"{{{SSV}}}Parameters")
    units: dict[str, Mapping[str, int]] = {}
    for key, parameter in parameters.items():
        element = etree.SubElement(listed, f"{{{SSV}}}Parameter", attrib={"name": key})
        if parameter.description:
            element.set("description", parameter.description)
        if isinstance(parameter.value, bool):
            etree.SubElement(element, f"{{{SSV}}}Boolean", attrib={"value": str(parameter.value).lower()})
        elif isinstance(parameter.value, int):
            etree.SubElement(element, f"{{{SSV}}}Integer", attrib={"value": str(parameter.value)})
        else:
            if not math.isfinite(parameter.value):
                raise ParameterFileError(
                    f"The parameter {key!r} is {parameter.value}; a parameter set needs finite values."
                )
            if parameter.unit not in BASE_UNITS:
                raise ParameterFileError(
                    f"The unit {parameter.unit!r} of the parameter {key!r} is unknown; add it to BASE_UNITS."
                )
            units[parameter.unit] = BASE_UNITS[parameter.unit]
            etree.SubElement(
                element,
                f"{{{SSV}}}Real",
                attrib={"value": repr(float(parameter.value)), "unit": parameter.unit},
            )
    if units:
        definitions = etree.SubElement(root, f"{{{SSV}}}Units")
        for unit, exponents in sorted(units.items()):
            definition = etree.SubElement(definitions, f"{{{SSC}}}Unit", attrib={"name": unit})
            etree.SubElement(
                definition,
                f"{{{SSC}}}BaseUnit",
                attrib={base: str(exponent) for base, exponent in exponents.items()},
            )
    _schema().assertValid(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def toml_text(title: str, sets: Mapping[str, Mapping[str, Parameter]], citation: str = "") -> str:
    """Return parameter sets as TOML.

    Parameters
    ----------
    title : str
        What the file contains.
    sets : mapping of str to mapping of str to Parameter
        Parameters by name of the set.
    citation : str
        Whom to cite.

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
    """Return a TOML basic string; its escapes are those of JSON, except for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


@cache
def _schema() -> etree.XMLSchema:
    folder = Path(fmpy.__file__).parent / "ssp" / "schema"
    return etree.XMLSchema(etree.parse(folder / "SystemStructureParameterValues.xsd"))
