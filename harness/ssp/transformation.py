"""Transformations of values in connections and parameter mappings (SSP 1.0, 4.5.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from lxml import etree

from harness.errors import StartValueError
from harness.parts.part import StartValue
from harness.ssp.package import SPACES


@dataclass(frozen=True)
class Linear:
    """A linear transformation: target = factor * source + offset, both in the unit of the target."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: StartValue, where: str) -> StartValue:
        """Return the transformed value."""
        if self == Linear():
            return value
        if isinstance(value, (bool, str)):
            raise StartValueError(
                f"{where} is {value!r}, to which a linear transformation cannot be applied: remove the transformation"
            )
        return self.factor * value + self.offset


@dataclass(frozen=True)
class Table:
    """A table with a target for each source: Booleans, Integers, or names of enumeration items."""

    entries: Mapping[StartValue, StartValue]

    def __call__(self, value: StartValue, where: str) -> StartValue:
        """Return the target of the value."""
        for source, target in self.entries.items():
            if type(source) is type(value) and source == value:
                return target
        raise StartValueError(f"{where} is {value!r}, which its mapping does not contain: add an entry for it")


Transformation: TypeAlias = Linear | Table


def read_transformation(element: etree._Element) -> Transformation:
    """Return the transformation of a connection or mapping entry; the identity if there is none."""
    linear = element.find("ssc:LinearTransformation", SPACES)
    if linear is not None:
        return Linear(float(linear.get("factor", "1")), float(linear.get("offset", "0")))
    for kind in ("Boolean", "Integer", "Enumeration"):
        rows = element.findall(f"ssc:{kind}MappingTransformation/ssc:MapEntry", SPACES)
        if rows:
            return Table({_entry(kind, row.get("source", "")): _entry(kind, row.get("target", "")) for row in rows})
    return Linear()


def flag(element: etree._Element, name: str) -> bool:
    """Return an optional Boolean attribute, False by default."""
    return element.get(name, "false").strip() in {"true", "1"}


def _entry(kind: str, text: str) -> StartValue:
    if kind == "Boolean":
        return text.strip() in {"true", "1"}
    return int(text) if kind == "Integer" else text
