"""FMUs with one deliberate fault."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

from lxml import etree

XML = "modelDescription.xml"
Edit = Callable[[etree._Element], object]


def contents(fmu: Path) -> dict[str, bytes]:
    """Member -> content."""
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(members: Mapping[str, bytes | None], path: Path) -> Path:
    """An archive with these members; None leaves one out."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            if data is not None:
                archive.writestr(name, data)
    return path


def edited(fmu: Path, path: Path, edit: Edit) -> Path:
    """A copy of an FMU with another XML."""
    members = contents(fmu)
    root = etree.fromstring(members[XML])
    edit(root)
    return zipped(members | {XML: etree.tostring(root, xml_declaration=True, encoding="UTF-8")}, path)


def variable(root: etree._Element, name: str) -> etree._Element:
    """A ScalarVariable."""
    (found,) = (v for v in root.iter("ScalarVariable") if v.get("name") == name)
    return found


def typed(root: etree._Element, name: str) -> etree._Element:
    """Its Real, Integer or Boolean."""
    return variable(root, name)[0]


def index_of(root: etree._Element, name: str) -> str:
    """Its index from 1."""
    return str(list(root.iter("ScalarVariable")).index(variable(root, name)) + 1)


def unknown(root: etree._Element, section: str, name: str) -> etree._Element:
    """Its entry of ModelStructure."""
    (found,) = (u for u in root.iterfind(f"ModelStructure/{section}/*") if u.get("index") == index_of(root, name))
    return found


def twice(element: etree._Element) -> None:
    """The element once more, after itself."""
    element.addnext(etree.fromstring(etree.tostring(element)))


def insert(root: etree._Element, after: str, text: str) -> None:
    """Further XML after the first element of that path."""
    element = root.find(after)
    assert element is not None
    element.addnext(etree.fromstring(text))


def append(root: etree._Element, path: str, text: str) -> None:
    """Further XML as the last child."""
    element = root.find(path)
    assert element is not None
    element.append(etree.fromstring(text))


def remove(element: etree._Element | None) -> None:
    """Without that element."""
    assert element is not None
    parent = element.getparent()
    assert parent is not None
    parent.remove(element)
