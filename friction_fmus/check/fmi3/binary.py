"""What the probes need to know of an FMI 3.0 FMU."""

from __future__ import annotations

from typing import Any, Final

import fmpy
from lxml import etree

from friction_fmus.check.archive import Contents
from friction_fmus.check.binary import run_probes, span
from friction_fmus.check.description import integer, real
from friction_fmus.check.findings import Finding
from friction_fmus.check.fmi3.description import FLOATS, INTEGERS, Model3, Variable3
from friction_fmus.check.probes.host import ONLY, PROBES, SEVERAL
from harness.compiling.platforms import NATIVE

_TYPES: Final = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean", "String": "String"}
"""Types of FMI 2.0 of scalars that the probes of FMI 2.0 read and set."""
_FLAGS: Final = {
    "canHandleVariableCommunicationStepSize": "canHandleVariableCommunicationStepSize",
    "canBeInstantiatedOnlyOncePerProcess": "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUstate": "canGetAndSetFMUState",
    "canSerializeFMUstate": "canSerializeFMUState",
    "providesDirectionalDerivative": "providesDirectionalDerivatives",
}
"""Capabilities of FMI 2.0, and their names in FMI 3.0."""


def examine_binary_3(contents: Contents, model: Model3, time_limit: float) -> list[Finding]:
    """Run the probes of co-simulation and model exchange; see `examine_binary`."""
    found: list[Finding] = []
    for element in model.interfaces:
        if element.tag == "ScheduledExecution":
            continue
        kind = "model exchange" if element.tag == "ModelExchange" else "co-simulation"
        once = _is(element, "canBeInstantiatedOnlyOncePerProcess")
        wanted = {kind, "FMI 3.0", f"FMI 3.0 {kind}"}
        names = [name for name in PROBES if ONLY.get(name, kind) in wanted and not (once and name in SEVERAL)]
        identifier = element.get("modelIdentifier", "")
        binary = f"binaries/{fmpy.platform_tuple}/{identifier}{NATIVE.suffix}"
        found += run_probes(contents, binary, _job(model, element), names, once, time_limit)
    return list(dict.fromkeys(found))


def _is(element: etree._Element, flag: str) -> bool:
    return element.get(flag) in ("true", "1")


def _job(model: Model3, element: etree._Element) -> dict[str, Any]:
    indicators = (
        model.by_reference.get(integer(e.get("valueReference")) or 0) for e in model.structure("EventIndicator")
    )
    return {
        "version": 3,
        "guid": model.root.get("instantiationToken", ""),
        **span(model.root, real(element.get("fixedInternalStepSize"))),
        "exchange": element.tag == "ModelExchange",
        "flags": {old: _is(element, new) for old, new in _FLAGS.items()},
        "states": [state for e in model.structure("ContinuousStateDerivative") for state in _states(model, e)],
        "indicators": sum(model.elements(v) or 1 for v in indicators if v is not None),
        "dependencies": {
            old: _dependencies(model, new)
            for old, new in (
                ("Outputs", "Output"),
                ("Derivatives", "ContinuousStateDerivative"),
                ("InitialUnknowns", "InitialUnknown"),
            )
        },
        "completes": _is(element, "needsCompletedIntegratorStep"),
        "output_derivatives": integer(element.get("maxOutputDerivativeOrder")) or 0,
        "categories": [e.get("name") for e in model.root.iterfind("LogCategories/Category")],
        "variables": [row for v in model.variables if (row := _scalar(v)) is not None],
        "arrays": [row for v in model.variables if (row := _array(model, v)) is not None],
        "structural": [
            row
            for v in model.variables
            if v.causality == "structuralParameter" and (row := _array(model, v)) is not None and row["starts"]
        ],
        "clocks": [
            {
                "name": v.name,
                "reference": v.reference,
                "stated": any(v.get(each) is not None for each in ("intervalDecimal", "intervalCounter")),
            }
            for v in model.variables
            if v.type == "Clock"
            and v.causality == "input"
            and v.get("intervalVariability") in ("constant", "fixed", "tunable")
        ],
        "event_mode": _is(element, "hasEventMode"),
        "returns": _is(element, "mightReturnEarlyFromDoStep") or _is(element, "canReturnEarlyAfterIntermediateUpdate"),
        "adjoint": _is(element, "providesAdjointDerivatives") and _is(element, "providesDirectionalDerivatives"),
        "intermediate": _is(element, "providesIntermediateUpdate"),
    }


def _dependencies(model: Model3, section: str) -> dict[str, list[str]]:
    """Return the names on which each unknown depends; without an unknown that depends on all."""
    found = {}
    for element in model.structure(section):
        v = model.by_reference.get(integer(element.get("valueReference")) or 0)
        given = element.get("dependencies")
        if v is not None and given is not None:
            known = (model.by_reference.get(integer(reference) or 0) for reference in given.split())
            found[v.name] = [each.name for each in known if each is not None]
    return found


def _states(model: Model3, element: etree._Element) -> list[dict[str, Any]]:
    """Return a derivative with its state; None for the elements of arrays, which the probes of FMI 2.0 do not read."""
    derivative = model.by_reference.get(integer(element.get("valueReference")) or 0)
    state = None if derivative is None else model.by_reference.get(integer(derivative.element.get("derivative")) or 0)
    if derivative is None or state is None or derivative.dimensions:
        count = 1 if derivative is None else model.elements(derivative) or 1
        return [dict.fromkeys(("derivative", "derivative_reference", "state", "state_reference"))] * count
    pair = {"derivative": derivative.name, "derivative_reference": derivative.reference}
    return [pair | {"state": state.name, "state_reference": state.reference}]


def _scalar(v: Variable3) -> dict[str, Any] | None:
    if v.type not in _TYPES or v.dimensions or v.reference is None or v.clocks:
        return None
    low, high, nominal = real(v.get("min")), real(v.get("max")), real(v.get("nominal"))
    text = v.starts[0] if v.starts else None
    value: Any = text
    if v.type != "String" and text is not None:
        value = text in ("true", "1") if v.type == "Boolean" else integer(text) if v.type == "Int32" else real(text)
    return {
        "name": v.name,
        "reference": v.reference,
        "type": _TYPES[v.type],
        "causality": v.causality,
        "variability": v.variability,
        "initial": None if v.causality == "input" else v.initial,
        "start": value,
        "low": -1e300 if low is None else low,
        "high": 1e300 if high is None else high,
        "nominal": nominal or 1.0,
    }


def _array(model: Model3, v: Variable3) -> dict[str, Any] | None:
    """Return a variable of numbers or Booleans with all its elements."""
    count = model.elements(v)
    if v.type not in (*FLOATS, *INTEGERS, "Boolean", "Enumeration") or v.reference is None or count is None or v.clocks:
        return None
    texts = v.starts or ()
    texts = texts * count if len(texts) == 1 else texts
    values = [text in ("true", "1") if v.type == "Boolean" else _number(v.type, text) for text in texts]
    known = len(values) == count and None not in values and v.initial == "exact"
    return {
        "name": v.name,
        "reference": v.reference,
        "type": v.type,
        "count": count,
        "variability": v.variability,
        "starts": values if known else [],
        "settable": v.causality in ("input", "parameter"),
    }


def _number(kind: str, text: str) -> float | int | None:
    return real(text) if kind in FLOATS else integer(text)
