"""terminalsAndIcons.xml of a composite FMU: its icon, and terminals of parts that nothing inside is connected to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lxml import etree

from harness.composite.interface import Variable
from harness.parts.fmu import FmuPart
from harness.storage.zip_file import open_zip, read_zip
from harness.system.assembly import Assembly

FOLDER = "terminalsAndIcons"
MEMBER = f"{FOLDER}/terminalsAndIcons.xml"


def composite_terminals(system: Assembly, variables: Sequence[Variable]) -> bytes:
    """Return the XML file."""
    shown = {variable.name for variable in variables if variable.causality in ("input", "output")}
    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = etree.SubElement(root, "GraphicalRepresentation")
    extent = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    etree.SubElement(graphics, "CoordinateSystem", {**extent, "suggestedScalingFactorTo_mm": "0.1"})
    etree.SubElement(graphics, "Icon", extent)
    listed = etree.SubElement(root, "Terminals")
    for name, part in system.parts.items():
        for terminal in _terminals(part) if isinstance(part, FmuPart) else ():
            members = [(f"{name}.{member.get('variableName')}", member) for member in terminal.iterfind("*")]
            if not members or not all(variable in shown for variable, _ in members):
                continue
            attributes = {str(key): str(value) for key, value in terminal.attrib.items()}
            element = etree.SubElement(listed, "Terminal", attributes | {"name": f"{name}.{terminal.get('name')}"})
            for variable, member in members:
                own = {str(key): str(value) for key, value in member.attrib.items()}
                etree.SubElement(element, "TerminalMemberVariable", own | {"variableName": variable})
    if len(listed) == 0:
        root.remove(listed)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _terminals(part: FmuPart) -> Iterator[etree._Element]:
    """Yield the terminals of an FMU without graphics."""
    with open_zip(part.path) as archive:
        if MEMBER not in archive.namelist():
            return
        parser = etree.XMLParser(resolve_entities=False, no_network=True)
        root = etree.fromstring(read_zip(archive, MEMBER), parser)
    for terminal in root.iterfind("Terminals/Terminal"):
        for graphics in terminal.findall("TerminalGraphicalRepresentation"):
            terminal.remove(graphics)
        if all(child.tag == "TerminalMemberVariable" for child in terminal):
            yield terminal
