"""modelDescription.xml, units and terminals of a block (FMI 2.0.5, section 2.2), from the row table of its binary."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from types import MappingProxyType
from typing import Final

from lxml import etree

from friction_fmus.blocks.catalogue import Block
from friction_fmus.blocks.probe import (
    BOOLEAN,
    DERIVATIVE,
    FIXED,
    INPUT,
    INTEGER,
    LOCAL,
    OUTPUT,
    PARAMETER,
    STATE,
    STATE_OUTPUT,
    TIME,
    BlockVariable,
    Description,
)
from friction_fmus.errors import FrictionError
from friction_fmus.version import VERSION, build_time
from harness.units import BASE_SYMBOLS, LONGEST_UNIT, BaseUnit, parse_unit

QUANTITIES = {
    "s": "Time",
    "Hz": "Frequency",
    "m": "Length",
    "m/s": "Velocity",
    "m/s2": "Acceleration",
    "m/s3": "Jerk",
    "kg": "Mass",
    "N": "Force",
    "N/m": "TranslationalStiffness",
    "N.s/m": "TranslationalDamping",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration",
    "rad/s3": "AngularJerk",
    "kg.m2": "MomentOfInertia",
    "N.m": "Torque",
    "N.m/rad": "RotationalStiffness",
    "N.m.s/rad": "RotationalDamping",
}
"""Physical quantity of each unit; it distinguishes torque and energy, which have the same exponents."""

DISPLAY_UNITS = {
    "m": (("mm", 1e3), ("um", 1e6)),
    "m/s": (("mm/s", 1e3),),
    "rad": (("deg", 57.29577951308232),),
    "rad/s": (("deg/s", 57.29577951308232), ("rev/min", 9.549296585513721)),
}
"""Display units of each unit, with factors: displayed value = factor x value."""


def base_unit(unit: str) -> BaseUnit:
    """Return exponents and factor of a unit such as ``N.s/m`` or ``kg.m2``."""
    found = parse_unit(unit)
    if found is None or (found.factor, found.offset) != (1.0, 0.0):
        raise FrictionError(f"The unit {unit[:LONGEST_UNIT]!r} is unknown; write it in SI units, such as N.s/m")
    return found


LOG_CATEGORIES: Final = {
    "logStatusWarning": "warnings that do not stop the simulation",
    "logStatusDiscard": "rejected values and steps",
    "logStatusError": "calls that are not allowed",
    "logEvents": "events inside the model",
    "logAll": "all messages",
}
"""Log categories, as in fmi2_modes.h."""


FRICTION_FLANGE = ("v", "F", "inflow")
FLANGES = (
    ("v_rel", "F_friction", "outflow"),
    ("v", "F_friction", "outflow"),
    ("v", "F_ext", "inflow"),
    ("v", "F_load", "inflow"),
    ("v", "F_drive", "inflow"),
)
"""Velocity and force of a flange, and the direction of the force, of a friction model and of others, whose F drives a
mass. The first pair with an input and an output in the block counts. F flows into a friction model; F_friction flows
out of a mass, and other forces into it, so that the forces at a connection add up to zero."""

SIDES = (("flange", ""), ("flange_a", "1"), ("flange_b", "2"))
"""Name of a flange and suffix of its variables; the sides of a drive are named as in the Modelica library."""

REFERENCES: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "reference": {"r": "r", "rd": "rd", "rdd": "rdd"},
        "reference_x": {"r": "x", "rd": "xd", "rdd": "xdd"},
        "reference_y": {"r": "y", "rd": "yd", "rdd": "ydd"},
    }
)
"""Members of each reference terminal and their variables; a terminal exists if two or more of them do."""

DOMAINS: Mapping[str, str] = MappingProxyType({"m/s": "translational", "rad/s": "rotational"})
"""Domain of a flange for each unit of the velocity; the atomic chains have no units."""

SHAPES: Mapping[str, str] = MappingProxyType(
    {"translational": "square", "rotational": "circle", "dimensionless": "square", "reference": "triangle"}
)
"""Shape of the icon for the last word of a terminal's kind."""

COLOURS: Mapping[str, str] = MappingProxyType({"square": "0 127 0", "circle": "0 0 0", "triangle": "0 0 127"})
"""Colour of the lines to each shape of terminal, as in the Modelica library."""


@dataclass(frozen=True)
class Member:
    """A variable in a terminal."""

    name: str  # name in the terminal, by which members are matched
    variable: str  # name in the block
    kind: str = "signal"  # ``signal``, ``inflow`` or ``outflow``


@dataclass(frozen=True)
class Terminal:
    """A group of variables that are connected in one step."""

    name: str  # its name
    description: str  # its description
    domain: str  # ``translational``, ``rotational``, ``dimensionless`` or ``reference``
    rule: str  # ``plug`` connects all members, ``bus`` those that both sides have
    members: tuple[Member, ...]  # the variables
    right: bool  # whether the terminal is on the right side of the icon

    @property
    def shape(self) -> str:
        """Name of the icon: ``square``, ``circle`` or ``triangle``."""
        return SHAPES[self.domain]


def terminals(description: Description, kind: str) -> tuple[Terminal, ...]:
    """Return the flanges and references of a block of this kind, found by the names of its inputs and outputs."""
    ports = {v.name: v for v in description.variables if v.role in (INPUT, OUTPUT, STATE_OUTPUT)}
    pairs = (FRICTION_FLANGE, *FLANGES) if kind == "friction" else FLANGES
    return tuple(chain(_flanges(ports, pairs), _references(ports)))


def _flanges(ports: Mapping[str, BlockVariable], pairs: Sequence[tuple[str, str, str]]) -> Iterator[Terminal]:
    for name, side in SIDES:
        for velocity, force, direction in pairs:
            v, F = ports.get(velocity + side), ports.get(force + side)
            if v and F and (v.role == INPUT) != (F.role == INPUT):
                members = Member("v", v.name), Member("F", F.name, direction)
                domain = DOMAINS.get(v.unit, "dimensionless")
                right = name == "flange_b" or (name == "flange" and v.role != INPUT)
                text = "; ".join(each.text.removeprefix("optional: ") for each in (v, F))
                yield Terminal(name, text, domain, "plug", members, right)
                break


def _references(ports: Mapping[str, BlockVariable]) -> Iterator[Terminal]:
    for name, variables in REFERENCES.items():
        present = {member: ports[variable] for member, variable in variables.items() if variable in ports}
        if len(present) > 1 and len({v.role == INPUT for v in present.values()}) == 1:
            members = tuple(Member(member, v.name) for member, v in present.items())
            right = next(iter(present.values())).role != INPUT
            yield Terminal(name, "reference and its derivatives", "reference", "bus", members, right)


def icon_root() -> etree._Element:
    """Return the root of terminalsAndIcons.xml with the icon."""
    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = etree.SubElement(root, "GraphicalRepresentation")
    extent = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    etree.SubElement(graphics, "CoordinateSystem", {**extent, "suggestedScalingFactorTo_mm": "0.1"})
    etree.SubElement(graphics, "Icon", extent)
    return root


def terminals_and_icons(found: tuple[Terminal, ...]) -> bytes:
    """Return the XML file."""
    root = icon_root()
    if found:
        parent = etree.SubElement(root, "Terminals")
        for terminal in found:
            side = [other for other in found if other.right == terminal.right]
            y = 40 * (len(side) - 1) - 80 * side.index(terminal)
            _terminal(parent, terminal, 100 if terminal.right else -100, y)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _terminal(parent: etree._Element, terminal: Terminal, x: int, y: int) -> None:
    element = etree.SubElement(
        parent,
        "Terminal",
        name=terminal.name,
        matchingRule=terminal.rule,
        terminalKind=f"_friction_fmus_{terminal.domain}",
        description=terminal.description,
    )
    for member in terminal.members:
        attributes = {"variableName": member.variable, "memberName": member.name, "variableKind": member.kind}
        etree.SubElement(element, "TerminalMemberVariable", attributes)
    corners = {"x1": str(x - 10), "y1": str(y - 10), "x2": str(x + 10), "y2": str(y + 10)}
    etree.SubElement(
        element,
        "TerminalGraphicalRepresentation",
        corners,
        defaultConnectionColor=COLOURS[terminal.shape],
        defaultConnectionStrokeSize="2",
        iconBaseName=terminal.shape,
    )


ROLE = {  # role -> causality, variability of a Real in a continuous block, initial
    TIME: ("independent", "continuous", None),
    INPUT: ("input", "continuous", None),
    OUTPUT: ("output", "continuous", "calculated"),
    LOCAL: ("local", "continuous", "calculated"),
    PARAMETER: ("parameter", "tunable", "exact"),
    FIXED: ("parameter", "fixed", "exact"),
    STATE: ("local", "continuous", "exact"),
    STATE_OUTPUT: ("output", "continuous", "calculated"),
    DERIVATIVE: ("local", "continuous", "calculated"),
}
"""Attributes in the XML for each role."""

CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "true",
    "maxOutputDerivativeOrder": "1",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "true",
}
"""Attributes of CoSimulation."""

EXCHANGE = (
    "canNotUseMemoryManagementFunctions",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "providesDirectionalDerivative",
)
"""The capabilities of `CAPABILITIES` that ModelExchange has too."""


def model_description(block: Block, description: Description, identifier: str) -> bytes:
    """Return the XML file."""
    variables = description.variables
    index = {v.reference: i for i, v in enumerate(variables, start=1)}
    root = etree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=identifier,
        guid=description.guid,
        description=f"{block.summary} ({block.source})",
        author="friction-fmus developers",
        version=VERSION,
        copyright="Copyright (c) 2026 friction-fmus developers",
        license="MIT",
        generationTool=f"friction-fmus {VERSION}",
        generationDateAndTime=build_time(),
        variableNamingConvention="structured",
    )
    if description.exchanges:
        root.set("numberOfEventIndicators", str(description.events))
        flags = {name: CAPABILITIES[name] for name in EXCHANGE} | {"completedIntegratorStepNotNeeded": "true"}
        _interface(root, "ModelExchange", identifier, flags)
    _interface(root, "CoSimulation", identifier, CAPABILITIES)
    units = list(dict.fromkeys(v.unit for v in variables if v.unit))
    _unit_definitions(root, units)
    _type_definitions(root, units)
    categories = etree.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        etree.SubElement(categories, "Category", name=name, description=text)
    etree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", tolerance="1e-10", stepSize="0.001")
    declare_traits(root)

    model_variables = etree.SubElement(root, "ModelVariables")
    jumping = block.reinitialises if description.exchanges else ()
    for v in variables:
        _scalar_variable(model_variables, v, index, description.sampled, v.name in jumping)

    structure = etree.SubElement(root, "ModelStructure")
    outputs = [v for v in variables if v.role in (OUTPUT, STATE_OUTPUT)]
    derivatives = [v for v in variables if v.role == DERIVATIVE]
    _unknowns(structure, "Outputs", outputs, description.dependencies, index)
    _unknowns(structure, "Derivatives", derivatives, description.dependencies, index)
    initial = sorted((*outputs, *derivatives), key=lambda v: index[v.reference])
    _unknowns(structure, "InitialUnknowns", initial, description.initial_dependencies, index)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def declare_traits(root: etree._Element) -> None:
    """Tell the harness that inputs need values from outside, and that samples need no clock in FMI 3.0."""
    tool = etree.SubElement(etree.SubElement(root, "VendorAnnotations"), "Tool", name="harness")
    etree.SubElement(tool, "Part", strict="true", samplesInSteps="true")


def _interface(root: etree._Element, kind: str, identifier: str, values: dict[str, str]) -> None:
    interface = etree.SubElement(root, kind, {"modelIdentifier": identifier, **values})
    etree.SubElement(etree.SubElement(interface, "SourceFiles"), "File", name=f"{identifier}.c")


def shortest(value: float) -> str:
    """Return a number with as many digits as it needs."""
    return repr(float(value)).removesuffix(".0")


def _unit_definitions(root: etree._Element, units: list[str]) -> None:
    definitions = etree.SubElement(root, "UnitDefinitions")
    for unit in units:
        element = etree.SubElement(definitions, "Unit", name=unit)
        base = base_unit(unit)
        attributes = {name: str(power) for name, power in zip(BASE_SYMBOLS, base.exponents, strict=True) if power}
        if base.factor != 1.0:
            attributes["factor"] = shortest(base.factor)
        etree.SubElement(element, "BaseUnit", attributes)
        for name, factor in DISPLAY_UNITS.get(unit, ()):
            etree.SubElement(element, "DisplayUnit", name=name, factor=shortest(factor))


def _type_definitions(root: etree._Element, units: list[str]) -> None:
    named = [unit for unit in units if unit in QUANTITIES]
    if named:
        definitions = etree.SubElement(root, "TypeDefinitions")
        for unit in named:
            simple = etree.SubElement(definitions, "SimpleType", name=QUANTITIES[unit])
            etree.SubElement(simple, "Real", quantity=QUANTITIES[unit], unit=unit)


def _scalar_variable(
    parent: etree._Element, v: BlockVariable, index: dict[int, int], sampled: bool, jumps: bool
) -> None:
    causality, variability, initial = ROLE[v.role]
    if variability == "continuous" and (v.type != 0 or (sampled and v.role in (OUTPUT, LOCAL, STATE, STATE_OUTPUT))):
        variability = "discrete"
    attributes = {"name": v.name, "valueReference": str(v.reference), "description": v.text}
    attributes |= {"causality": causality, "variability": variability}
    if initial:
        attributes["initial"] = initial
    scalar = etree.SubElement(parent, "ScalarVariable", attributes)

    has_start = v.role in (INPUT, PARAMETER, FIXED, STATE)
    if v.type == BOOLEAN:
        etree.SubElement(scalar, "Boolean", {"start": "true" if v.start else "false"} if has_start else {})
        return
    convert = (lambda value: str(int(value))) if v.type == INTEGER else shortest
    typed: dict[str, str] = {}
    if v.unit:
        typed |= {"declaredType": QUANTITIES[v.unit]} if v.unit in QUANTITIES else {}
        typed["unit"] = v.unit
    typed |= {name: convert(value) for name, value in (("min", v.min), ("max", v.max)) if math.isfinite(value)}
    if v.role in (STATE, STATE_OUTPUT) and v.nominal != 1.0:
        typed["nominal"] = convert(v.nominal)
    if has_start:
        typed["start"] = convert(v.start)
    if v.role == DERIVATIVE:
        typed["derivative"] = str(index[v.origin])
    if jumps:
        typed["reinit"] = "true"
    etree.SubElement(scalar, "Integer" if v.type == INTEGER else "Real", typed)


def _unknowns(
    structure: etree._Element,
    name: str,
    unknowns: list[BlockVariable],
    dependencies: dict[int, tuple[int, ...]],
    index: dict[int, int],
) -> None:
    if unknowns:
        parent = etree.SubElement(structure, name)
        for v in unknowns:
            listed = sorted(index[reference] for reference in dependencies[v.reference])
            text = " ".join(str(i) for i in listed)
            etree.SubElement(parent, "Unknown", index=str(index[v.reference]), dependencies=text)
