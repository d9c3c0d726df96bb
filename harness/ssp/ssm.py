"""Parameter mappings: SSM of SSP 1.0."""

from __future__ import annotations

from dataclasses import dataclass

from lxml import etree

from harness.errors import SystemFileError
from harness.ssp.document import SPACES, SSM, check_element
from harness.ssp.transformation import Transformation, flag, read_transformation


@dataclass(frozen=True)
class Entry:
    """Mapping of a source parameter to a variable."""

    target: str
    """Name of the variable."""
    transformation: Transformation
    """Transformation of the value, after its unit conversion."""
    suppress: bool
    """Whether unit conversion is suppressed."""


def parse_ssm(root: etree._Element, where: str) -> dict[str, list[Entry]]:
    """Return the entries of an element ParameterMapping by the name of the source."""
    check_element(root, SSM, where)
    entries: dict[str, list[Entry]] = {}
    targets: set[str] = set()
    for element in root.iterfind("ssm:MappingEntry", SPACES):
        target = element.get("target", "")
        if target in targets:
            raise SystemFileError(f"{where} maps two parameters to '{target}': remove one")
        targets.add(target)
        entry = Entry(target, read_transformation(element), flag(element, "suppressUnitConversion"))
        entries.setdefault(element.get("source", ""), []).append(entry)
    return entries
