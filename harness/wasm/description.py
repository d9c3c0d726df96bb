"""The variables of an FMU as JSON, for JavaScript."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from lxml import etree

from harness.fmi3.variables import grouped

_NUMBERS: Final[Mapping[str, type]] = {"Real": float, "Integer": int, "Enumeration": int}


def described(root: etree._Element) -> dict[str, Any]:
    """Return the content of ``NAME.json`` for the root of a modelDescription.xml of FMI 2.0."""
    simulation, experiment = root.find("CoSimulation"), root.find("DefaultExperiment")
    assert simulation is not None
    types = {str(each.get("name")): each for each in root.iterfind("TypeDefinitions/SimpleType")}
    scalars = root.findall("ModelVariables/ScalarVariable")
    stated = {} if experiment is None else {key: float(str(value)) for key, value in experiment.items()}
    return {
        "name": str(simulation.get("modelIdentifier")),
        **{key: str(root.get(key)) for key in ("description", "license", "generationTool") if root.get(key)},
        "guid": str(root.get("guid")),
        "experiment": {"startTime": 0.0, "stopTime": 1.0, "stepSize": 1e-3} | stated,
        "variables": [_variable(each, types) for each in scalars],
        "arrays": {
            array.name: [str(each.get("name")) for each in array.elements]
            for array in grouped(scalars, arrays=True, resizable=False)
            if array.is_array
        },
    }


def _variable(scalar: etree._Element, types: Mapping[str, etree._Element]) -> dict[str, Any]:
    typed = scalar[0]
    kind = str(typed.tag)
    declared = types.get(str(typed.get("declaredType")))
    inherited = {} if declared is None else dict(declared[0].items())
    attributes = {str(key): str(value) for key, value in {**inherited, **typed.attrib}.items()}
    found: dict[str, Any] = {"name": str(scalar.get("name")), "type": kind}
    found["reference"] = int(str(scalar.get("valueReference")))
    found |= {key: str(scalar.get(key)) for key in ("causality", "variability") if scalar.get(key)}
    found |= {key: attributes[key] for key in ("unit", "quantity") if attributes.get(key)}
    for key in ("start", "min", "max", "nominal"):
        if key in attributes:
            text = attributes[key]
            found[key] = text in ("true", "1") if kind == "Boolean" else _NUMBERS[kind](text)
    if declared is not None and kind == "Enumeration":
        found["items"] = {str(item.get("name")): int(str(item.get("value"))) for item in declared[0]}
    if scalar.get("description"):
        found["description"] = str(scalar.get("description"))
    return found
