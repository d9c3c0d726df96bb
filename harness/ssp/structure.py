"""The elements of an SSD, nested systems and arrays included (SSP 1.0 and 2.0, chapter 5)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

from lxml import etree

from harness.errors import StartValueError, SystemFileError
from harness.parts.flat_description import MOST_ELEMENTS, element_names
from harness.parts.part import StartValue
from harness.ssp.package import DIMENSION, SPACES, known_unit
from harness.units import BaseUnit


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
class MappingTable:
    """A table with a target for each source: Booleans, Integers, or names of enumeration items."""

    entries: Mapping[StartValue, StartValue]

    def __call__(self, value: StartValue, where: str) -> StartValue:
        """Return the target of the value."""
        for source, target in self.entries.items():
            if type(source) is type(value) and source == value:
                return target
        raise StartValueError(f"{where} is {value!r}, which its mapping does not contain: add an entry for it")


Transformation: TypeAlias = Linear | MappingTable


def read_transformation(element: etree._Element, where: str) -> Transformation:
    """Return the transformation of a connection or mapping entry; the identity if there is none."""
    linear = element.find("ssc:LinearTransformation", SPACES)
    if linear is not None:
        return Linear(float(linear.get("factor", "1")), float(linear.get("offset", "0")))
    for kind in ("Boolean", "Integer", "Enumeration"):
        rows = element.findall(f"ssc:{kind}MappingTransformation/ssc:MapEntry", SPACES)
        if rows:
            table = {_entry(kind, row.get("source", "")): _entry(kind, row.get("target", "")) for row in rows}
            if len(table) < len(rows):
                raise SystemFileError(f"{where} has a mapping with two entries for one source: remove one of them")
            return MappingTable(table)
    return Linear()


def flag(element: etree._Element, name: str) -> bool:
    """Return an optional Boolean attribute, False by default."""
    return element.get(name, "false").strip() in {"true", "1"}


def _entry(kind: str, text: str) -> StartValue:
    if kind == "Boolean":
        return text.strip() in {"true", "1"}
    return int(text) if kind == "Integer" else text


#: Names of the systems from the outermost one to an element; () is the outermost system.
Path: TypeAlias = tuple[str, ...]

#: Media type of a component that is an FMU.
FMU_TYPE: Final = "application/x-fmu-sharedlibrary"


@dataclass(frozen=True)
class Endpoint:
    """A connector of an element, or a variable without a connector."""

    path: Path
    name: str

    def __str__(self) -> str:
        return ".".join((*self.path, self.name))


@dataclass(frozen=True)
class Connector:
    """A connector as described in the file."""

    kind: str  # such as ``input``, ``output``, ``parameter`` or ``calculatedParameter``
    unit: BaseUnit | None  # the unit, if it is stated and known
    unit_name: str = ""  # name of the unit; empty if none is stated
    type: str = ""  # type of its values, such as ``Real``; empty if it is not stated
    shape: tuple[int | None, ...] = ()  # sizes of an array; None where the file states none


@dataclass(frozen=True)
class Edge:
    """A connection, in signal direction."""

    source: Endpoint  # where the connection begins
    target: Endpoint  # where it ends
    transformation: Transformation  # transformation of a value, after its unit conversion
    suppress: bool  # whether unit conversion is suppressed
    element: etree._Element  # the XML element, with its annotations
    source_index: tuple[int, ...] = ()  # index of the connected element of an array; () for all
    target_index: tuple[int, ...] = ()  # the same of the target

    def __str__(self) -> str:
        return f"the connection {self.source} -> {self.target}"


@dataclass(frozen=True)
class Structure:
    """All elements of an SSD."""

    systems: Mapping[Path, etree._Element]  # all systems, each before its subsystems
    components: Mapping[Path, etree._Element]  # all FMUs, in the order of the file
    connectors: Mapping[Endpoint, Connector]  # all connectors
    edges: tuple[Edge, ...]  # all connections
    units: Mapping[str, BaseUnit] = field(default_factory=dict)  # units that the document defines
    shapes: Mapping[Endpoint, tuple[int, ...]] = field(default_factory=dict)  # of arrays before the split


def read_structure(root: etree._Element, units: Mapping[str, BaseUnit], where: str) -> Structure:
    """Return all elements of a document."""
    outermost = root.find("ssd:System", SPACES)
    assert outermost is not None  # the document is valid
    systems: dict[Path, etree._Element] = {}
    components: dict[Path, etree._Element] = {}
    for path, element in _walk((), outermost):
        kind = etree.QName(element).localname
        if kind == "SignalDictionaryReference" or element.find("ssd:SignalDictionaries", SPACES) is not None:
            raise SystemFileError(f"{where} has signal dictionaries: connect the signals directly instead")
        if kind == "Component":
            media = element.get("type", FMU_TYPE)
            if media != FMU_TYPE:
                raise SystemFileError(
                    f"component '{'.'.join(path)}' in {where} is of type {media}, which is not supported: put its "
                    "content into the system instead"
                )
        found = components if kind == "Component" else systems
        if path in components or path in systems:
            raise SystemFileError(f"{where} has two elements '{'.'.join(path)}': rename one")
        found[path] = element
    connectors: dict[Endpoint, Connector] = {}
    for path, element in (*systems.items(), *components.items()):
        for item in element.iterfind("ssd:Connectors/ssd:Connector", SPACES):
            node = Endpoint(path, item.get("name", ""))
            connectors[node] = _connector(item, units, f"the connector '{node}' in {where}")
    edges = [
        _edge(path, element, connectors, where)
        for path, system in systems.items()
        for element in system.iterfind("ssd:Connections/ssd:Connection", SPACES)
    ]
    return Structure(systems, components, connectors, tuple(edges), units)


def _connector(element: etree._Element, units: Mapping[str, BaseUnit], where: str) -> Connector:
    typed = next((each for each in element.iterfind("ssc:*", SPACES) if each.tag != DIMENSION), None)
    kind = "" if typed is None else etree.QName(typed).localname
    if kind == "Clock":
        raise SystemFileError(f"{where} is a clock, which is not supported: remove it, as FMUs state their own clocks")
    unit = None if typed is None else typed.get("unit")
    base = known_unit(unit, units.get(unit) if unit else None)  # an unknown one may be defined in the FMU
    return Connector(element.get("kind", ""), base, unit or "", kind, read_shape(element, where))


def read_shape(element: etree._Element, where: str) -> tuple[int | None, ...]:
    """Return the sizes of a connector or parameter of SSP 2.0; None stands for one that is not stated."""
    sizes = []
    for dimension in element.iterfind(DIMENSION):
        size = dimension.get("size")
        if size is not None and dimension.get("sizeConnector") is not None:
            raise SystemFileError(f"{where} has a Dimension with both size and sizeConnector: remove one")
        sizes.append(None if size is None else int(size))
    return tuple(sizes)


def _walk(path: Path, element: etree._Element) -> Iterator[tuple[Path, etree._Element]]:
    yield path, element
    for inner in element.iterfind("ssd:Elements/*", SPACES):
        yield from _walk((*path, inner.get("name", "")), inner)


def _edge(path: Path, element: etree._Element, connectors: Mapping[Endpoint, Connector], where: str) -> Edge:
    """Return a connection in the system at the path; the file may name its ends in either order."""
    ends = []
    for end in ("start", "end"):
        inner = element.get(f"{end}Element")
        # OMSimulator writes an empty name for a connector of the system itself
        node = Endpoint((*path, inner) if inner else path, element.get(f"{end}Connector", ""))
        if node not in connectors:
            raise SystemFileError(f"{where} connects '{node}', which is not a connector: correct the connection")
        if connectors[node].kind in ("inout", "unspecified"):
            raise SystemFileError(
                f"{where} connects '{node}', which is of the kind {connectors[node].kind}: make it an input or output"
            )
        ends.append((node, tuple(int(index) for index in element.get(f"{end}Indices", "").split())))
    (first, first_index), (second, second_index) = ends
    forward = _gives(path, first, connectors)
    if forward == _gives(path, second, connectors):
        raise SystemFileError(
            f"{where} connects '{first}' and '{second}', of which {'both give' if forward else 'none gives'} a value: "
            "connect outputs to inputs"
        )
    transformation = read_transformation(element, f"the connection {first} - {second} in {where}")
    suppress = flag(element, "suppressUnitConversion")
    if forward:
        return Edge(first, second, transformation, suppress, element, first_index, second_index)
    return Edge(second, first, transformation, suppress, element, second_index, first_index)


def _gives(path: Path, node: Endpoint, connectors: Mapping[Endpoint, Connector]) -> bool:
    """Return whether a connector provides values to the inside of the system at the path."""
    own, inner = ("input", "parameter", "structuralParameter"), ("output", "calculatedParameter", "constant", "local")
    return connectors[node].kind in (own if node.path == path else inner)


#: Sizes of the dimensions of an array; () for a scalar.
Shape: TypeAlias = tuple[int, ...]


def scalars(structure: Structure) -> Structure:
    """Return the structure without its arrays, whose sizes may depend on the values of the scalars."""
    connectors = {node: connector for node, connector in structure.connectors.items() if not connector.shape}
    edges = (
        edge
        for edge in structure.edges
        if edge.source in connectors and edge.target in connectors and not (edge.source_index or edge.target_index)
    )
    return replace(structure, connectors=connectors, edges=tuple(edges))


def split(structure: Structure, variables: Mapping[Endpoint, Shape], where: str) -> Structure:
    """Return the structure with a connector and a connection for each element of an array."""
    shapes = dict(variables)
    joined = {node for edge in structure.edges for node in (edge.source, edge.target)}
    for node, connector in structure.connectors.items():
        known = variables.get(node)
        if known is None:
            sizes = [size for size in connector.shape if size is not None]
            if len(sizes) == len(connector.shape):
                shapes[node] = tuple(sizes)
        elif (connector.shape or node in joined) and not _agree(connector.shape, known):
            raise SystemFileError(
                f"'{node}' is {shown(connector.shape)} in {where} but {shown(known)} in its FMU: correct its Dimension"
            )
    _spread(structure, shapes)
    connectors: dict[Endpoint, Connector] = {}
    edges: list[Edge] = []
    for node, connector in structure.connectors.items():
        if node not in shapes and node in joined:
            raise SystemFileError(f"'{node}' in {where} is an array of unknown size: state the size in its Dimension")
        shape = shapes.get(node, (0,))  # nothing uses an array of unknown size
        _limit(len(connectors) + count(shape), where)
        connectors |= {made: replace(connector, shape=()) for made in _nodes(node, (), shape)}
    for edge in structure.edges:
        edges += _elements(edge, shapes, where)
        _limit(len(edges), where)
    return replace(structure, connectors=connectors, edges=tuple(edges), shapes=shapes)


def count(shape: Sequence[int]) -> int:
    """Return the number of elements, or any number above `MOST_ELEMENTS` if there are more."""
    number = int(0 not in shape)
    for size in shape:
        number *= size
        if number > MOST_ELEMENTS:
            break
    return number


def shown(shape: Sequence[int | None]) -> str:
    """Return a text such as ``an array of size 2 x 3``."""
    if not shape:
        return "a scalar"
    return f"an array of size {' x '.join('?' if size is None else str(size) for size in shape)}"


def _limit(number: int, where: str) -> None:
    if number > MOST_ELEMENTS:
        raise SystemFileError(f"the arrays in {where} have more than {MOST_ELEMENTS} elements: choose smaller arrays")


def _agree(stated: Sequence[int | None], known: Shape) -> bool:
    return len(stated) == len(known) and all(
        size is None or size == other for size, other in zip(stated, known, strict=True)
    )


def _spread(structure: Structure, shapes: dict[Endpoint, Shape]) -> None:
    """Add the shapes of connectors without stated sizes that are connected to others as a whole."""
    whole = [edge for edge in structure.edges if not (edge.source_index or edge.target_index)]
    found = True
    while found:
        found = False
        for edge in whole:
            for one, other in ((edge.source, edge.target), (edge.target, edge.source)):
                if one in shapes and other not in shapes and _agree(structure.connectors[other].shape, shapes[one]):
                    shapes[other] = shapes[one]
                    found = True


def _elements(edge: Edge, shapes: Mapping[Endpoint, Shape], where: str) -> list[Edge]:
    source, target = shapes[edge.source], shapes[edge.target]
    for node, index, shape in ((edge.source, edge.source_index, source), (edge.target, edge.target_index, target)):
        valid = len(index) == len(shape) and all(1 <= k <= size for k, size in zip(index, shape, strict=True))
        if index and not valid:
            raise SystemFileError(
                f"{edge} in {where} has the indices {' '.join(map(str, index))}, but '{node}' is {shown(shape)}: "
                "give one index from 1 for each dimension"
            )
    joined = [() if index else shape for index, shape in ((edge.source_index, source), (edge.target_index, target))]
    if joined[0] != joined[1]:
        raise SystemFileError(
            f"{edge} in {where} joins {shown(joined[0])} and {shown(joined[1])}: connect arrays of equal size, or "
            "select an element with startIndices and endIndices"
        )
    ends = (_nodes(edge.source, edge.source_index, source), _nodes(edge.target, edge.target_index, target))
    return [
        replace(edge, source=one, target=other, source_index=(), target_index=())
        for one, other in zip(*ends, strict=True)
    ]


def _nodes(node: Endpoint, index: Shape, shape: Shape) -> list[Endpoint]:
    if index:
        return [Endpoint(node.path, f"{node.name}[{','.join(map(str, index))}]")]
    return [Endpoint(node.path, name) for name in element_names(node.name, shape)]
