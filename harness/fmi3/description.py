"""modelDescription.xml of FMI 3.0.2, from that of FMI 2.0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from lxml import etree

from harness.fmi3.variables import Variable

_EXCHANGE: Final[Mapping[str, str]] = {
    "canGetAndSetFMUstate": "canGetAndSetFMUState",
    "canSerializeFMUstate": "canSerializeFMUState",
    "providesDirectionalDerivative": "providesDirectionalDerivatives",
}
_SIMULATION: Final[Mapping[str, str]] = {
    **_EXCHANGE,
    "canHandleVariableCommunicationStepSize": "canHandleVariableCommunicationStepSize",
    "maxOutputDerivativeOrder": "maxOutputDerivativeOrder",
}
"""Names in FMI 3.0 of the capabilities."""


@dataclass(frozen=True)
class Traits:
    """What FMI 3.0 adds."""

    token: str
    """Instantiation token."""
    sampled: bool
    """Whether the FMU takes its samples at the ticks of a clock."""
    references: int
    """Largest value reference of the variables. The event indicators and the clock have the next ones."""
    indicators: int
    """Number of event indicators."""


def description_3(old: etree._Element, variables: Sequence[Variable], traits: Traits) -> bytes:
    """Return the XML file."""
    dropped = ("guid", "numberOfEventIndicators")
    kept = {str(key): str(value) for key, value in old.attrib.items() if key not in dropped}
    root = etree.Element("fmiModelDescription", {**kept, "fmiVersion": "3.0", "instantiationToken": traits.token})
    _kinds(root, old, traits)
    _copied(root, old)
    listed = etree.SubElement(root, "ModelVariables")
    place = {int(str(each.get("valueReference"))): v for v in variables for each in v.elements}  # by FMI 2.0
    by_index = [place[int(str(each.get("valueReference")))] for each in old.iterfind("ModelVariables/ScalarVariable")]
    for v in variables:
        _variable(listed, v, by_index, variables[0])
    names = {v.name for v in variables}
    if traits.indicators:
        _indicators(listed, traits, names)
    if traits.sampled:
        _clock(listed, traits, names)
    structure = etree.SubElement(root, "ModelStructure")
    for group, name in (
        ("Outputs", "Output"),
        ("Derivatives", "ContinuousStateDerivative"),
        ("InitialUnknowns", "InitialUnknown"),
    ):
        _unknowns(structure, name, old.findall(f"ModelStructure/{group}/Unknown"), by_index)
    for k in range(traits.indicators):
        etree.SubElement(structure, "EventIndicator", valueReference=str(traits.references + 1 + k))
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _kinds(root: etree._Element, old: etree._Element, traits: Traits) -> None:
    exchange, simulation = old.find("ModelExchange"), old.find("CoSimulation")
    assert simulation is not None, "FMUs of this project are for co-simulation"
    identifier = str(simulation.get("modelIdentifier"))
    if exchange is not None:
        flags = _flags(exchange, _EXCHANGE)
        if exchange.get("completedIntegratorStepNotNeeded") != "true":
            flags["needsCompletedIntegratorStep"] = "true"
        etree.SubElement(root, "ModelExchange", {"modelIdentifier": identifier, **flags})
    flags = _flags(simulation, _SIMULATION)
    flags |= {"providesIntermediateUpdate": "true", "canReturnEarlyAfterIntermediateUpdate": "true"}
    if traits.sampled:
        flags |= {"hasEventMode": "true", "mightReturnEarlyFromDoStep": "true"}
    etree.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **flags})


def _flags(element: etree._Element, names: Mapping[str, str]) -> dict[str, str]:
    """Return the capabilities. Whoever gives directional derivatives gives adjoint ones too, see fmi3_derivatives.h."""
    flags = {new: str(element.get(old)) for old, new in names.items() if element.get(old) is not None}
    if flags.get("providesDirectionalDerivatives") == "true":
        flags["providesAdjointDerivatives"] = "true"
    return flags


def _texts(element: etree._Element) -> dict[str, str]:
    return {str(key): str(value) for key, value in element.attrib.items()}


def _copied(root: etree._Element, old: etree._Element) -> None:
    for name in ("UnitDefinitions", "TypeDefinitions", "LogCategories", "DefaultExperiment"):
        group = old.find(name)
        if group is None:
            continue
        copy = etree.SubElement(root, name, _texts(group))
        for each in group:
            if name != "TypeDefinitions":
                copy.append(etree.fromstring(etree.tostring(each)))
            elif each[0].tag == "Real":
                etree.SubElement(copy, "Float64Type", _texts(each) | _texts(each[0]))
        if name == "TypeDefinitions" and not len(copy):
            root.remove(copy)


def _variable(parent: etree._Element, v: Variable, by_index: Sequence[Variable], size: Variable) -> None:
    scalar, typed = v.elements[0], v.typed
    given = {key: scalar.get(key) for key in ("description", "causality", "variability", "initial")}
    attributes = {key: str(value) for key, value in given.items() if value is not None}
    if v.type == "UInt64":
        attributes["causality"] = "structuralParameter"
    if v.is_intermediate:
        attributes["intermediateUpdate"] = "true"
    attributes |= _texts(typed)
    if v.type == "Int32":
        attributes.pop("declaredType", None)  # an enumeration, which is an integer here
    if "derivative" in attributes:
        attributes["derivative"] = str(by_index[int(attributes["derivative"]) - 1].reference)
    count = int(str(size.typed.get("start"))) if v.is_sized else len(v.elements)
    if "start" in attributes:
        attributes["start"] = " ".join(str(each[0].get("start")) for each in v.elements[:count])
    element = etree.SubElement(parent, v.type, {"name": v.name, "valueReference": str(v.reference), **attributes})
    if v.is_array:
        length = {"valueReference": str(size.reference)} if v.is_sized else {"start": str(count)}
        etree.SubElement(element, "Dimension", length)


def _free(name: str, names: set[str]) -> str:
    """Return the name, with an underscore for each variable that has it already."""
    while name in names:
        name += "_"
    return name


def _indicators(parent: etree._Element, traits: Traits, names: set[str]) -> None:
    """Add the event indicators, each as a scalar, which PyFMI needs."""
    name = _free("event_indicators", names)
    for k in range(traits.indicators):
        etree.SubElement(
            parent,
            "Float64",
            name=f"{name}[{k + 1}]",
            valueReference=str(traits.references + 1 + k),
            description="positive until what was decided at the last event ends; 1 in co-simulation",
            causality="local",
            variability="continuous",
            initial="calculated",
        )


def _clock(parent: etree._Element, traits: Traits, names: set[str]) -> None:
    """Add the clock. Importers ask for its interval: an attribute intervalDecimal would permit them to set it."""
    etree.SubElement(
        parent,
        "Clock",
        name=_free("samples", names),
        valueReference=str(traits.references + traits.indicators + 1),
        description="ticks at the samples, every Ts",
        causality="input",
        intervalVariability="fixed",
    )


def _unknowns(
    structure: etree._Element, name: str, unknowns: Sequence[etree._Element], by_index: Sequence[Variable]
) -> None:
    """List each variable once, with the variables on which any of its elements depends."""
    listed: dict[int, set[int] | None] = {}
    for unknown in unknowns:
        reference = by_index[int(str(unknown.get("index"))) - 1].reference
        text = unknown.get("dependencies")
        known = None if text is None else {by_index[int(i) - 1].reference for i in str(text).split()}
        before = listed.get(reference, set())
        listed[reference] = None if known is None or before is None else before | known
    for reference, known in listed.items():
        attributes = {"valueReference": str(reference)}
        if known is not None:
            attributes["dependencies"] = " ".join(str(each) for each in sorted(known))
        etree.SubElement(structure, name, attributes)
