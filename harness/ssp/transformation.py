"""Transformations of values, in connections and in parameter mappings (SSP 1.0, 4.5.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from lxml import etree

from harness.errors import StartValueError
from harness.parts.part import StartValue
from harness.ssp.document import SPACES


@dataclass(frozen=True)
class Linear:
    """target = factor * source + offset, both in the unit of the target."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: StartValue, where: str) -> StartValue:
        """The transformed value.

        Raises
        ------
        StartValueError
            If the value is not a number.
        """
        if self == Linear():
            return value
        if isinstance(value, (bool, str)):
            raise StartValueError(f"{where} is {value!r}, on which a linear transformation has no effect: remove it")
        return self.factor * value + self.offset


@dataclass(frozen=True)
class Table:
    """A target for each source: Booleans, Integers, or names of enumeration items."""

    entries: Mapping[StartValue, StartValue]

    def __call__(self, value: StartValue, where: str) -> StartValue:
        """The target of the value.

        Raises
        ------
        StartValueError
            If the table does not have the value.
        """
        for source, target in self.entries.items():
            if type(source) is type(value) and source == value:
                return target
        raise StartValueError(f"{where} is {value!r}, which its mapping does not have: add an entry for it")


Transformation: TypeAlias = Linear | Table


def read_transformation(element: etree._Element) -> Transformation:
    """The transformation of a connection or a mapping entry; the identity if there is none."""
    linear = element.find("ssc:LinearTransformation", SPACES)
    if linear is not None:
        return Linear(float(linear.get("factor", "1")), float(linear.get("offset", "0")))
    for kind in ("Boolean", "Integer", "Enumeration"):
        rows = element.findall(f"ssc:{kind}MappingTransformation/ssc:MapEntry", SPACES)
        if rows:
            return Table({_entry(kind, row.get("source", "")): _entry(kind, row.get("target", "")) for row in rows})
    return Linear()


def flag(element: etree._Element, name: str) -> bool:
    """An optional Boolean attribute, false by default."""
    return element.get(name, "false").strip() in {"true", "1"}


def _entry(kind: str, text: str) -> StartValue:
    if kind == "Boolean":
        return text.strip() in {"true", "1"}
    return int(text) if kind == "Integer" else text
