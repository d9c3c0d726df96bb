"""The variables of an FMU in FMI 3.0: elements that follow each other become an array."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Final

from lxml import etree

TYPES: Final[Mapping[str, str]] = {
    "Real": "Float64",
    "Integer": "Int32",
    "Enumeration": "Int32",
    "Boolean": "Boolean",
}
"""Type in FMI 3.0 of each type of FMI 2.0."""

SIZE: Final = "N"
"""Name of the number of elements. Arrays with as many elements as its largest value are sized by it."""

_ELEMENT: Final = re.compile(r"(?P<name>.*)\[(?P<index>\d+)\](?P<end>\)?)")


@dataclass(frozen=True)
class Variable:
    """A variable of FMI 3.0."""

    name: str
    """Name; that of an array has no index."""
    inner: int
    """Value reference in FMI 2.0 of the only or the first element."""
    type: str
    """Name of its element in the XML."""
    elements: tuple[etree._Element, ...]
    """ScalarVariable in FMI 2.0 of each element; the largest number of them."""
    is_array: bool = False
    """Whether it is an array, perhaps of one element."""
    is_sized: bool = False
    """Whether the structural parameter, which is the first variable, is the length of the array."""
    reference: int = 0
    """Value reference: the position among the variables from 1, as OMSimulator reads dependencies as positions."""

    @property
    def is_intermediate(self) -> bool:
        """Whether an importer may read it in an intermediate update: a result that is continuous in time."""
        causality, variability = self.elements[0].get("causality"), self.elements[0].get("variability")
        return self.type == "Float64" and causality in (None, "local", "output") and variability in (None, "continuous")

    @property
    def typed(self) -> etree._Element:
        """The element of the first one in FMI 2.0 that holds type, start value and limits."""
        return self.elements[0][0]


def grouped(scalars: Sequence[etree._Element], *, arrays: bool, resizable: bool) -> tuple[Variable, ...]:
    """Return the variables, the structural parameter first, as fmusim 0.0.39 needs it before its arrays."""
    found = _sized(tuple(_arrays(scalars)), resizable) if arrays else tuple(map(_scalar, scalars))
    return tuple(replace(v, reference=k) for k, v in enumerate(found, start=1))


def _sized(found: tuple[Variable, ...], resizable: bool) -> tuple[Variable, ...]:
    """Return the variables with the number of elements as structural parameter, if it sizes all arrays."""
    sizes = [v for v in found if v.name == SIZE and v.type == "Int32" and _get(v, "variability") == "fixed"]
    if not resizable or not sizes:
        return found
    (size,) = sizes
    most = int(size.typed.get("max") or 0)
    arrays = [v for v in found if v.is_array]
    if not arrays or any(len(v.elements) != most for v in arrays):
        return found
    return (replace(size, type="UInt64"), *(replace(v, is_sized=v.is_array) for v in found if v is not size))


def _scalar(scalar: etree._Element) -> Variable:
    return Variable(str(scalar.get("name")), int(str(scalar.get("valueReference"))), TYPES[_tag(scalar)], (scalar,))


def _arrays(scalars: Sequence[etree._Element]) -> Iterator[Variable]:
    for (name, is_element), run in groupby(scalars, key=_base):
        elements = tuple(run)
        reference = int(str(elements[0].get("valueReference")))
        if is_element and _is_array(elements, reference):
            yield Variable(name, reference, TYPES[_tag(elements[0])], elements, is_array=True)
        else:
            yield from map(_scalar, elements)


def _base(scalar: etree._Element) -> tuple[str, bool]:
    """Return the name of the array, and whether the variable is one of its elements."""
    name = str(scalar.get("name"))
    match = _ELEMENT.fullmatch(name)
    return (f"{match['name']}{match['end']}", True) if match else (name, False)


def _is_array(elements: Sequence[etree._Element], first: int) -> bool:
    """Return whether elements are numbered from 1, follow each other in memory, and differ in start values only."""

    def kind(each: etree._Element) -> tuple[object, ...]:
        attributes = {key: value for key, value in each[0].attrib.items() if key not in ("start", "derivative")}
        rest = {key: value for key, value in each.attrib.items() if key not in ("name", "valueReference")}
        return _tag(each), attributes, rest, "start" in each[0].attrib

    for k, each in enumerate(elements):
        match = _ELEMENT.fullmatch(str(each.get("name")))
        if not match or int(match["index"]) != k + 1 or int(str(each.get("valueReference"))) != first + k:
            return False
    return all(kind(each) == kind(elements[0]) for each in elements)


def _get(variable: Variable, attribute: str) -> str | None:
    value = variable.elements[0].get(attribute)
    return None if value is None else str(value)


def _tag(scalar: etree._Element) -> str:
    return str(scalar[0].tag)
