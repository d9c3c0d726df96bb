"""Arrays of SSP 2.0: each element becomes a connector of its own, with the name that the harness gives it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

from harness.errors import SystemFileError
from harness.parts.flat_description import MOST_ELEMENTS, element_names
from harness.ssp.structure import Connector, Edge, Endpoint, Structure

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
