"""modelDescription.xml of FMI 3.0 for the rules, with the defaults of the standard (FMI 3.0.2, section 2.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from lxml import etree

from friction_fmus.check.description import integer, line_of, name_of

FLOATS: Final = ("Float64", "Float32")
INTEGERS: Final = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
TYPES: Final = (*FLOATS, *INTEGERS, "Boolean", "String", "Binary", "Enumeration", "Clock")
PARAMETERS: Final = ("parameter", "structuralParameter", "calculatedParameter")
KINDS: Final = ("ModelExchange", "CoSimulation", "ScheduledExecution")


@dataclass(frozen=True)
class Variable3:
    """A variable, with the defaults of the standard and of its declared type."""

    element: etree._Element
    """Its element, such as Float64."""
    declared: etree._Element | None
    """The type that it names, if there is one of its kind."""

    @property
    def type(self) -> str:
        """Float64, Int32, Clock, ..."""
        return name_of(self.element)

    @property
    def name(self) -> str:
        """The name."""
        return self.element.get("name", "")

    @property
    def line(self) -> int:
        """Line in the XML."""
        return line_of(self.element)

    @property
    def reference(self) -> int | None:
        """Value reference; None if it is not a number."""
        return integer(self.element.get("valueReference"))

    @property
    def causality(self) -> str:
        """Causality, with its default."""
        return self.element.get("causality", "local")

    @property
    def variability(self) -> str:
        """Variability, with its default by causality and type."""
        default = "fixed" if self.causality in PARAMETERS else "continuous" if self.type in FLOATS else "discrete"
        return self.element.get("variability", default)

    @property
    def initial(self) -> str | None:
        """The attribute initial, with its default."""
        default: str | None = "calculated"
        if self.causality in ("parameter", "structuralParameter", "input") or self.variability == "constant":
            default = "exact"
        if self.causality == "independent":
            default = None
        return self.element.get("initial", default)

    def get(self, attribute: str) -> str | None:
        """Return an attribute of the variable, or else of its declared type."""
        value = self.element.get(attribute)
        return value if value is not None or self.declared is None else self.declared.get(attribute)

    @cached_property
    def starts(self) -> tuple[str, ...] | None:
        """Start values; None if there are none."""
        if self.type in ("String", "Binary"):
            return tuple(str(e.get("value", "")) for e in self.element.iterfind("Start")) or None
        text = self.element.get("start")
        return None if text is None else tuple(text.split())

    @cached_property
    def dimensions(self) -> tuple[tuple[int | None, int | None], ...]:
        """Size, or else value reference of the size, of each dimension."""
        found = self.element.iterfind("Dimension")
        return tuple((integer(e.get("start")), integer(e.get("valueReference"))) for e in found)

    @property
    def clocks(self) -> tuple[int | None, ...]:
        """Value references of its clocks."""
        return tuple(integer(word) for word in self.element.get("clocks", "").split())


@dataclass
class Model3:
    """The content of modelDescription.xml."""

    root: etree._Element
    """The element fmiModelDescription."""

    @cached_property
    def variables(self) -> list[Variable3]:
        """All variables."""
        types = {(name_of(e), e.get("name")): e for e in self.root.iterfind("TypeDefinitions/*")}
        found = [e for e in self.root.iterfind("ModelVariables/*") if name_of(e) in TYPES]
        return [Variable3(e, types.get((f"{name_of(e)}Type", e.get("declaredType")))) for e in found]

    @cached_property
    def by_reference(self) -> dict[int, Variable3]:
        """Variables by value reference."""
        return {v.reference: v for v in self.variables if v.reference is not None}

    @cached_property
    def interfaces(self) -> list[etree._Element]:
        """The elements ModelExchange, CoSimulation and ScheduledExecution, as far as they exist."""
        found = (self.root.find(kind) for kind in KINDS)
        return [element for element in found if element is not None]

    @property
    def identifier(self) -> str:
        """Model identifier of the first interface."""
        return self.interfaces[0].get("modelIdentifier", "") if self.interfaces else ""

    def flag(self, name: str) -> bool:
        """Return whether an interface has a capability flag."""
        return any(element.get(name) in ("true", "1") for element in self.interfaces)

    def structure(self, section: str) -> list[etree._Element]:
        """Return the entries of ModelStructure of a kind, such as Output."""
        return list(self.root.iterfind(f"ModelStructure/{section}"))

    def elements(self, v: Variable3) -> int | None:
        """Return the number of elements of a variable at the start; None if it cannot be told."""
        sizes = []
        for start, reference in v.dimensions:
            size = start
            if start is None and reference is not None and (named := self.by_reference.get(reference)) is not None:
                size = integer(named.starts[0]) if named.starts else None
            sizes.append(size)
        return None if None in sizes else math.prod(size for size in sizes if size is not None)
