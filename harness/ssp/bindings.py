"""Start values from the parameter bindings of an SSD (SSP 1.0, 5.3.2)."""

from __future__ import annotations

import logging

from lxml import etree

from harness.errors import SystemFileError
from harness.parts.part import StartValue
from harness.ssp.document import SPACES, SSM, SSV, parse_document
from harness.ssp.flatten import Network
from harness.ssp.package import Package
from harness.ssp.ssm import Entry, parse_ssm
from harness.ssp.ssv import MEDIA_TYPE, Parameter, ParameterSet, parse_ssv
from harness.ssp.structure import Node, Path, Structure
from harness.ssp.transformation import Linear

_MAPPING_TYPE = "application/x-ssp-parameter-mapping"
_LOG = logging.getLogger("harness")


def bound_values(package: Package, structure: Structure, network: Network) -> dict[str, StartValue]:
    """Return the start values of all parts, in the units of their variables.

    A later binding overrides an earlier one, and a binding of a system overrides the bindings of its elements. An
    unknown name is ignored with a warning, as SSP 1.0 requires.

    Parameters
    ----------
    package : Package
        The archive, with the parameter sets.
    structure : Structure
        Elements of the SSD.
    network : Network
        Connections of the SSD.

    Returns
    -------
    dict of str to value
        Values by ``part.variable``.

    Raises
    ------
    SystemFileError
        If a parameter set or a mapping is missing or invalid.
    UnitError, StartValueError
        If a value does not fit its variable.
    """
    values: dict[Node, Parameter] = {}
    inside_out = [*structure.components.items(), *reversed(list(structure.systems.items()))]
    for path, element in inside_out:
        for binding in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", SPACES):
            values |= _binding(package, structure, network, path, binding)
    start: dict[str, StartValue] = {}
    for node, parameter in values.items():
        port = network.settable(node)
        assert port is not None  # only nodes with a port are found
        name = f"{network.parts[node.path].name}.{node.name}"
        start[name] = parameter.start_value(port, f"start value {name}")
    return start


def _binding(
    package: Package, structure: Structure, network: Network, path: Path, binding: etree._Element
) -> dict[Node, Parameter]:
    """Return the values of one binding of the element at the path."""
    where = f"a parameter binding of '{'.'.join(path) or 'the system'}' in {package.path}"
    if binding.get("type", MEDIA_TYPE) != MEDIA_TYPE:
        raise SystemFileError(f"{where} is of type {binding.get('type')}: write an SSV parameter set instead")
    component = structure.components.get(path)
    parameters = _parameters(package, component, binding, where)
    mapping = _mapping(package, component, binding, where)
    prefix = binding.get("prefix", "")
    values: dict[Node, Parameter] = {}
    for bare, parameter in parameters.parameters.items():
        name = prefix + bare
        entries = [Entry(name, Linear(), False)] if mapping is None else mapping.get(name, [])
        for entry in entries:
            nodes = [node for node in _named(structure, path, entry.target) if _exists(structure, network, node)]
            if not nodes:
                _LOG.warning("%s: there is no variable '%s', its value is ignored", where, entry.target)
            for node in nodes:
                landed = parameter.landed(
                    network.unit(node),
                    f"{node} in {package.path}",
                    suppress=entry.suppress,
                    transformation=entry.transformation,
                )
                values |= network.spread(node, landed)
    return values


def _named(structure: Structure, path: Path, name: str) -> list[Node]:
    """Return the nodes that a hierarchical name can mean in the element at the path; names may contain dots."""
    found = [Node(path, name)]
    for inner in (*structure.systems, *structure.components):
        if inner and inner[:-1] == path and name.startswith(inner[-1] + "."):
            found += _named(structure, inner, name[len(inner[-1]) + 1 :])
    return found


def _exists(structure: Structure, network: Network, node: Node) -> bool:
    if node.path in structure.components:
        return network.settable(node) is not None
    return node in structure.connectors


def _parameters(
    package: Package, component: etree._Element | None, binding: etree._Element, where: str
) -> ParameterSet:
    inline = binding.find("ssd:ParameterValues/*", SPACES)
    if inline is not None:
        return parse_ssv(inline, where)
    data, name = package.referenced(binding, component, where)
    return parse_ssv(parse_document(data, SSV, name), name)


def _mapping(
    package: Package, component: etree._Element | None, binding: etree._Element, where: str
) -> dict[str, list[Entry]] | None:
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
