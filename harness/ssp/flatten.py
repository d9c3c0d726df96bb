"""Connections between parts, from the connections of an SSD through the connectors of nested systems."""

from collections.abc import Mapping

from harness.errors import SystemFileError, UnitError
from harness.parts.part import Part, Port
from harness.ssp.annotations import read_wire
from harness.ssp.package import Signal, known_unit
from harness.ssp.ssv import Parameter
from harness.ssp.structure import Edge, Endpoint, Linear, Path, Structure, Transformation
from harness.system.wire import Wire
from harness.units import BaseUnit, needed_unit


class Network:
    """The connections of all systems as one graph."""

    def __init__(self, structure: Structure, parts: Mapping[Path, Part], where: str) -> None:
        self.structure = structure
        self.parts = parts
        self.where = where
        self._settable = {
            Endpoint(path, port.name): port for path, part in parts.items() for port in (*part.inputs, *part.parameters)
        }
        outputs = {Endpoint(path, port.name): port for path, part in parts.items() for port in part.outputs}
        self._ports = outputs | self._settable
        self._into: dict[Endpoint, Edge] = {}
        self._out_of: dict[Endpoint, list[Edge]] = {}
        for edge in structure.edges:
            if edge.target in self._into:
                raise SystemFileError(f"{where} drives '{edge.target}' twice: remove one of the connections")
            self._into[edge.target] = edge
            self._out_of.setdefault(edge.source, []).append(edge)
        for node in structure.connectors:
            self._check_connector(node)

    def wires(self) -> list[Wire]:
        """Return a connection for each FMU input that an FMU output drives."""
        chains = (self._chain(edge) for edge in self.structure.edges if edge.target.path in self.parts)
        return [self._wire(chain) for chain in chains if chain[0].source.path in self.parts]

    def spread(self, node: Endpoint, parameter: Parameter) -> dict[Endpoint, Parameter]:
        """Return the FMU variables that receive a parameter of this node, with converted values."""
        if node in self._settable:
            return {node: parameter}
        landed: dict[Endpoint, Parameter] = {}
        for edge in self._out_of.get(node, ()):
            landed |= self.spread(
                edge.target, self.land(parameter, edge.target, str(edge), edge.suppress, edge.transformation)
            )
        return landed

    def land(
        self, parameter: Parameter, node: Endpoint, where: str, suppress: bool, transformation: Transformation
    ) -> Parameter:
        """Return a parameter at a connector or variable, in its unit; see `Parameter.landed`."""
        port, connector = self._ports.get(node), self.structure.connectors.get(node)
        name = (port.unit if port else None) or (connector.unit_name if connector else None)
        return parameter.landed(self.unit(node), where, unit=name, suppress=suppress, transformation=transformation)

    def elements(self, node: Endpoint) -> int:
        """Return the number of FMU variables that are elements of an array with this name."""
        return sum(other.path == node.path and other.name.startswith(f"{node.name}[") for other in self._settable)

    def settable(self, node: Endpoint) -> Port | None:
        """Return the FMU variable that the node stands for, if it accepts a start value."""
        return self._settable.get(node)

    def name(self, node: Endpoint) -> str:
        """Return the name ``part.variable`` of an FMU variable."""
        return f"{self.parts[node.path].name}.{node.name}"

    def unit(self, node: Endpoint) -> BaseUnit | None:
        """Return the unit of a connector or variable: from the FMU, else from the file."""
        own = self._own_unit(node)
        connector = self.structure.connectors.get(node)
        return own or (connector.unit if connector else None)

    def _own_unit(self, node: Endpoint) -> BaseUnit | None:
        port = self._ports.get(node)
        return known_unit(port.unit, port.base) if port else None

    def _check_connector(self, node: Endpoint) -> None:
        own, connector, port = self._own_unit(node), self.structure.connectors[node], self._ports.get(node)
        stated = connector.unit
        if port is None or port.unit != connector.unit_name:
            needed_unit(connector.unit_name, stated, f"the connector '{node}' in {self.where}")
        if own is not None and stated is not None and not own.agrees(stated):
            raise UnitError(f"'{node}' is in [{stated}] in {self.where} but in [{own}] in its FMU: correct one of them")

    def _chain(self, edge: Edge) -> list[Edge]:
        """Return the connections on the way to a target, in signal direction."""
        chain = [edge]
        while chain[0].source in self._into:
            chain.insert(0, self._into[chain[0].source])
            if chain[0] in chain[1:]:
                raise SystemFileError(f"{chain[0]} in {self.where} is part of a cycle: remove it")
        return chain

    def _wire(self, chain: list[Edge]) -> Wire:
        source, target = chain[0].source, chain[-1].target
        ends = [self.structure.connectors[node] for node in (source, target)]
        kind = next((end.type for end in ends if end.type in ("Binary", "String")), None)
        if kind is not None:
            raise SystemFileError(
                f"{self.where} connects '{source}' to '{target}' of type {kind}, which is not supported: "
                "remove the connection"
            )
        if ends[1].kind in ("parameter", "structuralParameter"):
            raise SystemFileError(
                f"{self.where} connects '{source}' to the parameter '{target}', which is not supported: "
                "give the parameter a value instead"
            )
        signal, delay, initial = Signal(self.unit(source), self.unit(source)), 0, None
        for edge in chain:
            if not isinstance(edge.transformation, Linear):
                raise SystemFileError(
                    f"{edge} in {self.where} maps values by a table, which is not supported: replace it by a part"
                )
            before, unit = signal, self.unit(edge.target)
            factor, offset = edge.transformation.factor, edge.transformation.offset
            signal = before.passed(unit, factor, offset, edge.suppress, str(edge))
            ticks, first, written = read_wire(edge.element, str(edge))
            delay, initial = delay + ticks, initial if first is None else first
            # the written numbers are exact, but valid only if the transformation has not been changed
            if written and edge.suppress and len(chain) == 1:
                exact = Signal(before.unit, unit, *written)
                signal = exact if exact.number(str(edge)) == (factor, offset) else signal
        # connections between known units are converted automatically, others need the factor
        converts = self._own_unit(source) is not None and self._own_unit(target) is not None
        gain, offset = (signal.gain, signal.offset) if converts else signal.number(str(chain[-1]))
        return Wire(self.name(source), self.name(target), gain, offset, delay, initial)
