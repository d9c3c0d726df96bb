"""Start values from the parameter bindings of an SSD (SSP 1.0 and 2.0, 5.3.2)."""

import logging
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass

from lxml import etree

from harness.errors import SystemFileError
from harness.parts.part import StartValue
from harness.ssp.flatten import Network
from harness.ssp.package import SPACES, SSM, SSV, Package, check_element, parse_document
from harness.ssp.ssv import MEDIA_TYPE, Parameter, ParameterSet, parse_ssv
from harness.ssp.structure import (
    Endpoint,
    Linear,
    Path,
    Structure,
    Transformation,
    count,
    flag,
    read_transformation,
    shown,
)
from harness.units import BaseUnit


@dataclass(frozen=True)
class ParameterMapping:
    """Mapping of a source parameter to a variable."""

    target: str  # name of the variable
    transformation: Transformation  # transformation of the value, after its unit conversion
    suppress: bool  # whether unit conversion is suppressed


def parse_ssm(root: etree._Element, where: str) -> dict[str, list[ParameterMapping]]:
    """Return the entries of an element ParameterMapping by the name of the source."""
    check_element(root, SSM, where)
    entries: dict[str, list[ParameterMapping]] = {}
    targets: set[str] = set()
    for element in root.iterfind("ssm:MappingEntry", SPACES):
        target = element.get("target", "")
        if target in targets:
            raise SystemFileError(f"{where} maps two parameters to '{target}': remove one")
        targets.add(target)
        transformation = read_transformation(element, f"the entry of '{target}' in {where}")
        entry = ParameterMapping(target, transformation, flag(element, "suppressUnitConversion"))
        entries.setdefault(element.get("source", ""), []).append(entry)
    return entries


_MAPPING_TYPE = "application/x-ssp-parameter-mapping"
_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Binding:
    """A parameter binding with the files that it names."""

    path: Path  # the element to which it belongs
    parameters: ParameterSet  # the parameters
    mapping: Mapping[str, list[ParameterMapping]] | None  # by source; None if all parameters keep their names
    prefix: str  # prefix of all names in the parameter set
    where: str  # name of the binding, for messages

    def entries(self) -> Iterator[tuple[Parameter, tuple[int, ...], str, ParameterMapping]]:
        """Return each value with the shape of its array, its index such as ``[1,2]``, and its target."""
        origins = self.parameters.origins()
        for bare, parameter in self.parameters.parameters.items():
            array = origins.get(bare, bare)
            shape, name, index = self.parameters.arrays.get(array, ()), self.prefix + array, bare[len(array) :]
            if self.mapping is None:
                yield parameter, shape, index, ParameterMapping(name, Linear(), False)
            else:
                for entry in self.mapping.get(name, ()):
                    yield parameter, shape, index, entry


def read_bindings(package: Package, structure: Structure) -> list[Binding]:
    """Return all parameter bindings, each before those that override it."""
    inside_out = [*structure.components.items(), *reversed(list(structure.systems.items()))]
    return [
        _binding(package, structure, path, binding)
        for path, element in inside_out
        for binding in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", SPACES)
    ]


def bound_values(
    bindings: Sequence[Binding], structure: Structure, network: Network, only: Container[Endpoint] | None = None
) -> dict[Endpoint, StartValue]:
    """Return the start values of all parts, in the units of their variables."""
    # A later binding overrides an earlier one, and a binding of a system overrides the bindings of its elements. An
    # unknown name is ignored with a warning, as SSP requires.
    values: dict[Endpoint, Parameter] = {}
    for binding in bindings:
        values |= _bound(binding, structure, network, quiet=only is not None)
    start: dict[Endpoint, StartValue] = {}
    for node, parameter in values.items():
        port = network.settable(node)
        assert port is not None  # only nodes with a port are found
        if only is None or node in only:
            start[node] = parameter.start_value(port, f"start value {network.name(node)}")
    return start


def _bound(binding: Binding, structure: Structure, network: Network, *, quiet: bool) -> dict[Endpoint, Parameter]:
    """Return the values of one binding."""
    values: dict[Endpoint, Parameter] = {}
    for parameter, shape, index, entry in binding.entries():
        for node in _named(structure, binding.path, entry.target):
            known = structure.shapes.get(node, shape)
            if shape and node not in structure.shapes and not quiet:  # a quiet call is made before sizes are known
                elements = network.elements(node)
                known = known if elements in (0, count(shape)) else (elements,)
            if known != shape:
                raise SystemFileError(
                    f"{binding.where} has {shown(shape)} for '{node}', which is {shown(known)}: correct its Dimension"
                )
        name = entry.target + index
        nodes = [node for node in _named(structure, binding.path, name) if _exists(structure, network, node)]
        if not nodes and not quiet:
            _LOG.warning("%s: there is no variable '%s', its value is ignored", binding.where, name)
        for node in nodes:
            where = f"{node} in {network.where}"
            landed = network.land(parameter, node, where, entry.suppress, entry.transformation)
            values |= network.spread(node, landed)
    return values


def _binding(package: Package, structure: Structure, path: Path, binding: etree._Element) -> Binding:
    """Return one binding of the element at the path."""
    where = f"a parameter binding of '{'.'.join(path) or 'the system'}' in {package.path}"
    if binding.get("type", MEDIA_TYPE) != MEDIA_TYPE:
        raise SystemFileError(f"{where} is of type {binding.get('type')}: write an SSV parameter set instead")
    component = structure.components.get(path)
    parameters = _parameters(package, component, binding, where, structure.units)
    mapping = _mapping(package, component, binding, where)
    return Binding(path, parameters, mapping, binding.get("prefix", ""), where)


def _named(structure: Structure, path: Path, name: str) -> list[Endpoint]:
    """Return the nodes that a hierarchical name can mean in the element at the path; names may contain dots."""
    found = [Endpoint(path, name)]
    for inner in (*structure.systems, *structure.components):
        if inner and inner[:-1] == path and name.startswith(inner[-1] + "."):
            found += _named(structure, inner, name[len(inner[-1]) + 1 :])
    return found


def _exists(structure: Structure, network: Network, node: Endpoint) -> bool:
    if node.path in structure.components:
        return network.settable(node) is not None
    return node in structure.connectors


def _parameters(
    package: Package,
    component: etree._Element | None,
    binding: etree._Element,
    where: str,
    units: Mapping[str, BaseUnit],
) -> ParameterSet:
    inline = binding.find("ssd:ParameterValues/*", SPACES)
    if inline is not None:
        return parse_ssv(inline, where, units)
    data, name = package.referenced(binding, component, where)
    return parse_ssv(parse_document(data, SSV, name), name, units)


def _mapping(
    package: Package, component: etree._Element | None, binding: etree._Element, where: str
) -> dict[str, list[ParameterMapping]] | None:
    """Return the entries by the name of the source, or None if there is no mapping."""
    element = binding.find("ssd:ParameterMapping", SPACES)
    if element is None:
        return None
    if element.get("type", _MAPPING_TYPE) != _MAPPING_TYPE:
        raise SystemFileError(f"{where} has a mapping of type {element.get('type')}: write an SSM mapping instead")
    if len(element):
        return parse_ssm(element[0], where)
    data, name = package.referenced(element, component, where)
    return parse_ssm(parse_document(data, SSM, name), name)
