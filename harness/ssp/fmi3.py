"""Variables of FMI 3.0 in a written archive: arrays, types, and connections of whole arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from harness.parts.flat import Array
from harness.parts.fmu import FmuPart
from harness.system.wire import Wire, split_name

#: Types that SSP 1.0 has under this or an older name.
_OLD = ("Float64", "Int32", "Boolean", "String", "Enumeration")


def arrays_of(part: FmuPart) -> dict[str, Array]:
    """Return the variable of FMI 3.0 for each of its elements; none for an FMU of FMI 2.0."""
    flat = part.archive.flat
    return {} if flat is None else {name: array for array in flat.arrays for name in flat.names(array)}


def needs_two(array: Array) -> bool:
    """Return whether only SSP 2.0 can state the variable."""
    return bool(array.shape) or array.type not in _OLD


def indices(element: str) -> str:
    """Return the indices of an element such as ``k[1,2]`` as SSP 2.0 writes them."""
    return element[element.rindex("[") + 1 : -1].replace(",", " ")


def grouped(wires: Sequence[Wire], arrays: Mapping[str, Array]) -> Iterator[tuple[Wire, bool]]:
    """Return the connections, and whether one stands for all those between two arrays of the same shape."""
    elements: dict[tuple[str, str], list[str]] = {}
    for dotted, array in arrays.items():
        elements.setdefault((split_name(dotted)[0], array.name), []).append(dotted)
    k = 0
    while k < len(wires):
        wire = wires[k]
        ends = [(end, arrays[end]) for end in (wire.source, wire.target) if end in arrays]
        count = 1
        if len(ends) == 2 and ends[0][1].shape == ends[1][1].shape:
            names = [elements[split_name(end)[0], array.name] for end, array in ends]
            run = wires[k : k + len(names[0])]
            if [(each.source, each.target) for each in run] == list(zip(*names, strict=True)) and all(
                replace(each, source=wire.source, target=wire.target) == wire for each in run
            ):
                yield wire, True
                k += len(run)
                continue
        yield wire, False
        k += count
