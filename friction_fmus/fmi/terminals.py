"""Terminals of a block and ``terminalsAndIcons.xml``, which FMI 2.0.4 adopts from FMI 3.0 (section 2.4.9 there)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from types import MappingProxyType

from lxml import etree

from friction_fmus.blocks.probe import INPUT, OUTPUT, STATE_OUTPUT, Description, Variable

FLANGES = (
    ("v", "F", "inflow"),
    ("v_rel", "F_friction", "outflow"),
    ("v", "F_friction", "outflow"),
    ("v", "F_ext", "inflow"),
    ("v", "F_load", "inflow"),
    ("v", "F_drive", "inflow"),
)
"""Velocity and force of a flange, and the direction of the force. The first pair with an input and an output in the
block counts. F flows into a friction model; F_friction flows out of a mass, and other forces flow into it. The forces
at a connection thus add up to zero, and a mass can have several contacts."""

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

    name: str
    variable: str
    """Name in the terminal, by which members are matched, and name in the block."""
    kind: str = "signal"
    """``signal``, ``inflow`` or ``outflow``."""


@dataclass(frozen=True)
class Terminal:
    """A group of variables that are connected in one step."""

    name: str
    description: str
    """Name and description."""
    domain: str
    """``translational``, ``rotational``, ``dimensionless`` or ``reference``."""
    rule: str
    """``plug`` connects all members, ``bus`` those that both sides have."""
    members: tuple[Member, ...]
    """The variables."""
    right: bool
    """Whether the terminal is on the right side of the icon."""

    @property
    def shape(self) -> str:
        """Name of the icon: ``square``, ``circle`` or ``triangle``."""
        return SHAPES[self.domain]


def terminals(description: Description) -> tuple[Terminal, ...]:
    """Return the flanges and references of a block, found by the names of its inputs and outputs."""
    ports = {v.name: v for v in description.variables if v.role in (INPUT, OUTPUT, STATE_OUTPUT)}
    return tuple(chain(_flanges(ports), _references(ports)))


def _flanges(ports: Mapping[str, Variable]) -> Iterator[Terminal]:
    for name, side in SIDES:
        for velocity, force, direction in FLANGES:
            v, F = ports.get(velocity + side), ports.get(force + side)
            if v and F and (v.role == INPUT) != (F.role == INPUT):
                members = Member("v", v.name), Member("F", F.name, direction)
                domain = DOMAINS.get(v.unit, "dimensionless")
                right = name == "flange_b" or (name == "flange" and v.role != INPUT)
                text = f"{v.text}; {F.text}"
                yield Terminal(name, text, domain, "plug", members, right)
                break


def _references(ports: Mapping[str, Variable]) -> Iterator[Terminal]:
    for name, variables in REFERENCES.items():
        present = {member: ports[variable] for member, variable in variables.items() if variable in ports}
        if len(present) > 1 and len({v.role == INPUT for v in present.values()}) == 1:
            members = tuple(Member(member, v.name) for member, v in present.items())
            right = next(iter(present.values())).role != INPUT
            yield Terminal(name, "reference and its derivatives", "reference", "bus", members, right)


def terminals_and_icons(found: tuple[Terminal, ...]) -> bytes:
    """Return the XML file."""
    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = etree.SubElement(root, "GraphicalRepresentation")
    extent = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    etree.SubElement(graphics, "CoordinateSystem", {**extent, "suggestedScalingFactorTo_mm": "0.1"})
    etree.SubElement(graphics, "Icon", extent)
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
        etree.SubElement(
            element,
            "TerminalMemberVariable",
            variableName=member.variable,
            memberName=member.name,
            variableKind=member.kind,
        )
    etree.SubElement(
        element,
        "TerminalGraphicalRepresentation",
        defaultConnectionColor=COLOURS[terminal.shape],
        defaultConnectionStrokeSize="2",
        x1=str(x - 10),
        y1=str(y - 10),
        x2=str(x + 10),
        y2=str(y + 10),
        iconBaseName=terminal.shape,
    )
