"""A small reader of SSP for the importer of the tests: components, connections and parameters of nested systems."""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree
from reference_set.raw_fmu import RawFmu

_SYMBOLS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
Unit = tuple[tuple[int, ...], float, float]  # exponents, factor, offset


@dataclass
class Component:
    """An FMU in the system."""

    name: str  # path of the names of systems and of its own, with dots
    source: str
    fmu: RawFmu
    start: dict[str, Any]


@dataclass(frozen=True)
class Link:
    """A connection between two components: value = gain * value of the source + shift."""

    source: tuple[str, str]
    target: tuple[str, str]
    gain: float
    shift: float


def local(element: etree._Element) -> str:
    """The tag without its namespace."""
    return etree.QName(element).localname if isinstance(element.tag, str) else ""


def children(element: etree._Element | None, *path: str) -> list[etree._Element]:
    """Elements below by their local names."""
    found = [] if element is None else [element]
    for name in path:
        found = [child for each in found for child in each if local(child) == name]
    return found


class SspReader:
    """The flat system of an SSP."""

    def __init__(self, path: Path, folder: Path, faults: Collection[str] = ()) -> None:
        """Read it."""
        self.faults = frozenset(faults)
        self.folder = folder / "ssp"
        with zipfile.ZipFile(path) as archive:
            archive.extractall(self.folder)
        root = etree.parse(self.folder / "SystemStructure.ssd").getroot()
        self.units = _units(root)
        self.components: dict[str, Component] = {}
        self._fmus: dict[str, RawFmu] = {}
        self._edges: dict[tuple[str, str], list[tuple[tuple[str, str], etree._Element]]] = {}
        self._connectors: dict[tuple[str, str], etree._Element] = {}
        (system,) = children(root, "System")
        self._system(system, "", [])
        self.links = list(self._links())

    # ---- structure

    def _system(self, system: etree._Element, path: str, outer: list[tuple[str, etree._Element]]) -> None:
        """Read a system; `outer` are the parameter bindings of the systems around it, the outermost first."""
        bindings = [*outer, *((path, each) for each in children(system, "ParameterBindings", "ParameterBinding"))]
        for connector in children(system, "Connectors", "Connector"):
            self._connectors[path, connector.get("name", "")] = connector
        for element in (each for group in children(system, "Elements") for each in group):
            name = f"{path}.{element.get('name')}" if path else element.get("name", "")
            if local(element) == "System":
                self._system(element, name, bindings)
            elif local(element) == "Component":
                self._component(element, name, bindings)
        for connection in children(system, "Connections", "Connection"):
            ends = [
                (_inside(path, connection.get(f"{side}Element")), connection.get(f"{side}Connector", ""))
                for side in ("start", "end")
            ]
            self._edges.setdefault(ends[1], []).append((ends[0], connection))

    def _component(self, element: etree._Element, name: str, outer: list[tuple[str, etree._Element]]) -> None:
        source = element.get("source", "")
        if source not in self._fmus:
            self._fmus[source] = RawFmu(self.folder / source, self.folder / f"unpacked{len(self._fmus)}")
        component = Component(name, source, self._fmus[source], {})
        for connector in children(element, "Connectors", "Connector"):
            self._connectors[name, connector.get("name", "")] = connector
        own = [(name, each) for each in children(element, "ParameterBindings", "ParameterBinding")]
        for at, binding in [*own, *reversed(outer)]:  # outer ones override
            for parameter, value in self._parameters(binding):
                path = (
                    f"{at}.{binding.get('prefix', '')}{parameter}" if at else f"{binding.get('prefix', '')}{parameter}"
                )
                if path.startswith(f"{name}.") and path.removeprefix(f"{name}.") in component.fmu.variables:
                    variable = path.removeprefix(f"{name}.")
                    component.start[variable] = self._converted(component.fmu, variable, *value)
        self.components[name] = component

    def _file(self, source: str) -> etree._Element:
        return etree.parse(self.folder / source).getroot()

    # ---- parameters

    def _parameters(self, binding: etree._Element) -> Iterator[tuple[str, tuple[Any, Unit | None]]]:
        """Names and values of a binding after its mapping, with units."""
        if "parameter-set-ignored" in self.faults:
            return
        sets = children(binding, "ParameterValues", "ParameterSet")
        if binding.get("source"):
            sets = [self._file(binding.get("source", ""))]
        mappings = children(binding, "ParameterMapping", "ParameterMapping")
        for each in children(binding, "ParameterMapping"):
            if each.get("source"):
                mappings = [self._file(each.get("source", ""))]
        for parameters in sets:
            units = {**self.units, **_units(parameters)}
            found = {}
            for parameter in children(parameters, "Parameters", "Parameter"):
                typed = next(child for child in parameter if local(child) not in ("Annotations", "Dimension"))
                unit = units.get(typed.get("unit", "")) if typed.get("unit") else None
                found[parameter.get("name", "")] = (_parsed(typed), unit)
            if not mappings:
                yield from found.items()
            for entry in (e for mapping in mappings for e in children(mapping, "MappingEntry")):
                if entry.get("source") in found:
                    value, unit = found[entry.get("source", "")]
                    if entry.get("suppressUnitConversion") in ("true", "1"):
                        unit = None
                    gain, shift = self._transformation(entry)
                    if (gain, shift) != (1.0, 0.0):
                        value = gain * value + shift
                    yield entry.get("target", ""), (value, unit)

    def _converted(self, fmu: RawFmu, name: str, value: Any, unit: Unit | None) -> Any:
        own = fmu.attribute(name, "unit")
        if unit is None or own is None or not isinstance(value, float):
            return value
        gain, shift = self._conversion(unit, fmu.base(own))
        return gain * value + shift

    # ---- connections

    def _conversion(self, of: Unit, into: Unit) -> tuple[float, float]:
        if "wrong-units" in self.faults:
            return 1.0, 0.0
        assert of[0] == into[0], "the units do not fit"
        if of[1:] == into[1:]:
            return 1.0, 0.0
        offset = 0.0 if "unit-offset-ignored" in self.faults else (of[2] - into[2]) / into[1]
        return of[1] / into[1], offset

    def _transformation(self, element: etree._Element) -> tuple[float, float]:
        linear = next((child for child in element if local(child) == "LinearTransformation"), None)
        if linear is None or "transformation-ignored" in self.faults:
            return 1.0, 0.0
        return float(linear.get("factor", "1")), float(linear.get("offset", "0"))

    def _unit(self, place: tuple[str, str]) -> Unit | None:
        connector = self._connectors.get(place)
        typed = None if connector is None else next((child for child in connector if child.get("unit")), None)
        if typed is not None:
            return self.units[typed.get("unit", "")]
        if place[0] in self.components and place[1] in self.components[place[0]].fmu.variables:
            fmu = self.components[place[0]].fmu
            unit = fmu.attribute(place[1], "unit")
            return None if unit is None else fmu.base(unit)
        return None

    def _links(self) -> Iterator[Link]:
        for target in list(self._edges):
            if target[0] in self.components:
                place, gain, shift = target, 1.0, 0.0
                while place in self._edges:
                    ((source, connection),) = self._edges[place]
                    factor, offset = self._transformation(connection)
                    of, into = self._unit(source), self._unit(place)
                    convert = (1.0, 0.0)
                    if connection.get("suppressUnitConversion") not in ("true", "1") and of and into:
                        convert = self._conversion(of, into)
                    # value = factor * (convert[0] * x + convert[1]) + offset, then the connections so far
                    shift += gain * (factor * convert[1] + offset)
                    gain *= factor * convert[0]
                    place = source
                if place[0] in self.components:
                    yield Link(place, target, gain, shift)


def _inside(path: str, element: str | None) -> str:
    if element is None:
        return path
    return f"{path}.{element}" if path else element


def _units(root: etree._Element) -> Mapping[str, Unit]:
    found: dict[str, Unit] = {}
    for unit in children(root, "Units", "Unit"):
        for base in children(unit, "BaseUnit"):
            exponents = tuple(int(base.get(symbol, "0")) for symbol in _SYMBOLS)
            found[unit.get("name", "")] = (exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
    return found


def _parsed(typed: etree._Element) -> Any:
    text, type = typed.get("value", ""), local(typed)
    if type in ("Real", "Float64", "Float32"):
        return float(text)
    if type == "Boolean":
        return text in ("true", "1")
    if type in ("String", "Enumeration"):
        return text
    return int(text)
