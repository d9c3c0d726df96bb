"""XML of System Structure and Parameterization (SSP) 1.0 and 2.0: names, validated reading, writing."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Final

import fmpy
from lxml import etree

from harness.errors import SystemFileError

SSD: Final = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC: Final = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV: Final = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM: Final = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"

# libcosim and ecos expect exactly these prefixes instead of the namespaces
SPACES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "ssd": SSD,
        "ssc": SSC,
        "ssv": SSV,
        "ssm": SSM,
        "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
        "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
        "harness": "urn:friction-fmus:harness",
    }
)

#: Element with the size of one dimension of an array, in SSP 2.0.
DIMENSION: Final = f"{{{SSC}}}Dimension"

#: Generating tool stated in written files.
TOOL: Final = "friction-fmus"

_ROOTS: Final = MappingProxyType({SSD: "SystemStructureDescription", SSV: "ParameterSet", SSM: "ParameterMapping"})
_SCHEMAS: Final = MappingProxyType(
    {
        SSD: "SystemStructureDescription.xsd",
        SSV: "SystemStructureParameterValues.xsd",
        SSM: "SystemStructureParameterMapping.xsd",
    }
)
#: Folder of the schemas by version.
_FOLDERS: Final = MappingProxyType(
    {"1.0": Path(fmpy.__file__).parent / "ssp" / "schema", "2.0": Path(__file__).parent / "schema"}
)


def parse_document(data: bytes, space: str, where: str) -> etree._Element:
    """Parse and validate a document."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise SystemFileError(f"{where} is not XML: {' '.join(error.msg.split())}; export it again") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise SystemFileError(f"{where} has a DOCTYPE with its own definitions: remove it")
    return check_element(root, space, where)


def check_element(element: etree._Element, space: str, where: str) -> etree._Element:
    """Validate an element inside another document; see `parse_document`."""
    expected = f"{{{space}}}{_ROOTS[space]}"
    if element.tag != expected:
        raise SystemFileError(f"{where} starts with {element.tag}: give one that starts with {expected}")
    version = element.get("version", "")
    known = next((folder for folder in _FOLDERS if version.startswith(folder[:2])), None)
    if version and known is None:
        raise SystemFileError(f"{where} is of version {version}: export it as SSP 1.0 or 2.0")
    known = known or "1.0"
    try:
        _schema(space, known).assertValid(element)
    except etree.DocumentInvalid as error:
        reason = " ".join(str(error).split())
        raise SystemFileError(f"{where} is not valid SSP {known}: {reason}; correct it there") from error
    return element


def sub(parent: etree._Element, tag: str, **attributes: str | None) -> etree._Element:
    """Append an element ``prefix:name``; attributes that are None are omitted."""
    prefix, name = tag.split(":")
    element = etree.SubElement(parent, f"{{{SPACES[prefix]}}}{name}")
    for key, value in attributes.items():
        if value is not None:
            set_text(element, key, value)
    return element


def set_text(element: etree._Element, key: str, value: str) -> None:
    """Set an attribute; see `sub`."""
    try:
        element.set(key, value)
    except ValueError as error:
        raise SystemFileError(f"the text {value!r} cannot be written to XML: remove its control characters") from error


def to_bytes(root: etree._Element) -> bytes:
    """Return the document as UTF-8; the same content gives the same bytes."""
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


@cache
def _schema(space: str, version: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(_FOLDERS[version] / _SCHEMAS[space]))
