"""modelDescription.xml, units and terminals of a block (FMI 2.0.5, section 2.2), from the row table of its binary."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
        add_interface(root, "ModelExchange", identifier, flags, [f"{identifier}.c"])
    add_interface(root, "CoSimulation", identifier, CAPABILITIES, [f"{identifier}.c"])
    units = list(dict.fromkeys(v.unit for v in variables if v.unit))
    definitions = etree.SubElement(root, "UnitDefinitions")
    for unit in units:
        add_unit(definitions, unit, base_unit(unit), [(*shown, 0.0) for shown in DISPLAY_UNITS.get(unit, ())])
    _type_definitions(root, units)
    add_general(root, {"startTime": 0.0, "stopTime": 1.0, "tolerance": 1e-10, "stepSize": 0.001})

    model_variables = etree.SubElement(root, "ModelVariables")
    jumping = block.reinitialises if description.exchanges else ()
    for v in variables:
        _scalar_variable(model_variables, v, index, description.sampled, v.name in jumping)

    structure = etree.SubElement(root, "ModelStructure")
    outputs = [v for v in variables if v.role in (OUTPUT, STATE_OUTPUT)]
    derivatives = [v for v in variables if v.role == DERIVATIVE]
    initial = sorted((*outputs, *derivatives), key=lambda v: index[v.reference])
    for name, unknowns, dependencies in (
        ("Outputs", outputs, description.dependencies),
        ("Derivatives", derivatives, description.dependencies),
        ("InitialUnknowns", initial, description.initial_dependencies),
    ):
        places = ((v.reference, dependencies[v.reference]) for v in unknowns)
        add_unknowns(structure, name, ((index[v], [index[known] for known in knowns]) for v, knowns in places))
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def add_interface(
    root: etree._Element, kind: str, identifier: str, flags: Mapping[str, str], sources: Iterable[str]
) -> None:
    """Write ``ModelExchange`` or ``CoSimulation`` with its capability flags and the files to compile."""
    interface = etree.SubElement(root, kind, {"modelIdentifier": identifier, **flags})
    files = etree.SubElement(interface, "SourceFiles")
    for source in sources:
        etree.SubElement(files, "File", name=source)


def add_general(root: etree._Element, experiment: Mapping[str, float]) -> None:
    """Write log categories, default experiment and what the harness needs to know of a block or composite FMU."""
    categories = etree.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        etree.SubElement(categories, "Category", name=name, description=text)
    etree.SubElement(root, "DefaultExperiment", {name: shortest(value) for name, value in experiment.items()})
    # Inputs need values from outside, and samples need no clock in FMI 3.0.
    tool = etree.SubElement(etree.SubElement(root, "VendorAnnotations"), "Tool", name="harness")
    etree.SubElement(tool, "Part", strict="true", samplesInSteps="true")


def shortest(value: float) -> str:
    """Return a number with as many digits as it needs."""
    return repr(float(value)).removesuffix(".0")


def add_unit(
    definitions: etree._Element, name: str, base: BaseUnit | None, displays: Iterable[tuple[str, float, float]]
) -> None:
    """Write a unit; one without a base unit is not comparable to others."""
    element = etree.SubElement(definitions, "Unit", name=name)
    if base is not None:
        powers = zip(BASE_SYMBOLS, base.exponents, strict=True)
        attributes = {symbol: str(power) for symbol, power in powers if power}
        attributes |= {"factor": shortest(base.factor)} if base.factor != 1.0 else {}
        etree.SubElement(element, "BaseUnit", attributes | _offset(base.offset))
    for shown, factor, offset in displays:
        etree.SubElement(element, "DisplayUnit", {"name": shown, "factor": shortest(factor)} | _offset(offset))


def _offset(value: float) -> dict[str, str]:
    return {"offset": shortest(value)} if value else {}


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
    typed = {
        "declaredType": QUANTITIES.get(v.unit),
        "unit": v.unit or None,
        "min": finite(v.min),
        "max": finite(v.max),
        "nominal": v.nominal if v.role in (STATE, STATE_OUTPUT) and v.nominal != 1.0 else None,
        "start": v.start if v.role in (INPUT, PARAMETER, FIXED, STATE) else None,
        "derivative": str(index[v.origin]) if v.role == DERIVATIVE else None,
        "reinit": "true" if jumps else None,
    }
    kind = {BOOLEAN: "Boolean", INTEGER: "Integer"}.get(v.type, "Real")
    add_variable(parent, kind, attributes | ({"initial": initial} if initial else {}), typed)


def finite(limit: float) -> float | None:
    """Return a limit, or None if there is none."""
    return limit if math.isfinite(limit) else None


def add_variable(
    parent: etree._Element, kind: str, attributes: dict[str, str], typed: Mapping[str, str | float | None]
) -> None:
    """Write a variable of this type and those attributes of the type that are not None; a Boolean has a start only."""
    element = etree.SubElement(etree.SubElement(parent, "ScalarVariable", attributes), kind)
    for name, value in typed.items():
        if value is None or (kind == "Boolean" and name != "start"):
            continue
        if isinstance(value, str):
            element.set(name, value)
        elif kind == "Boolean":
            element.set(name, "true" if value else "false")
        else:
            element.set(name, shortest(value) if kind == "Real" else str(int(value)))


def add_unknowns(structure: etree._Element, name: str, unknowns: Iterable[tuple[int, Iterable[int] | None]]) -> None:
    """Write the indices of unknowns and of the variables on which each depends; None: on all."""
    listed = list(unknowns)
    if listed:
        parent = etree.SubElement(structure, name)
        for index, knowns in listed:
            element = etree.SubElement(parent, "Unknown", index=str(index))
            if knowns is not None:
                element.set("dependencies", " ".join(str(i) for i in sorted(set(knowns))))
