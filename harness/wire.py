"""Wires: which output drives which input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from harness.errors import UnitError, UnknownNameError, WireError, nearest
from harness.part import TYPE_ORDER, Part, Port
from harness.units import parse_unit, units_agree


@dataclass(frozen=True)
class Wire:
    """One connection from an output to an input.

    Parameters
    ----------
    source, target : str
        ``"part.port"`` of the output and of the input. A part name has no dot, a port name may have some.
    gain, offset : float
        The input gets gain * output + offset; the offset is in the unit of the input.
    delay : int
        The input gets what it would have got so many ticks earlier, and the start value before that.
    """

    source: str
    target: str
    gain: float = 1.0
    offset: float = 0.0
    delay: int = 0

    @property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """((part, output), (part, input))."""
        return split_name(self.source), split_name(self.target)

    def __str__(self) -> str:
        """The form that is written in a system file."""
        return f"{self.source} -> {self.target}"


def split_name(dotted: str) -> tuple[str, str]:
    """Part and port of ``"part.port"``.

    Raises
    ------
    WireError
        If there is no dot.
    """
    part, dot, port = dotted.partition(".")
    if not (part and dot and port):
        raise WireError(f"'{dotted}' does not name a port: write it as 'part.port'")
    return part, port


def parse_wire(text: str | tuple[str, str] | Wire) -> Wire:
    """A wire from ``"a.y -> b.u"`` or from the pair ``("a.y", "b.u")``.

    Raises
    ------
    WireError
        If the text has another form.
    """
    if isinstance(text, Wire):
        return text
    ends = text.split("->") if isinstance(text, str) else text
    if len(ends) != 2:
        raise WireError(f"'{text}' is not a wire: write it as 'part.output -> part.input'")
    wire = Wire(ends[0].strip(), ends[1].strip())
    split_name(wire.source), split_name(wire.target)
    return wire


def check_wires(parts: Mapping[str, Part], wires: Sequence[Wire]) -> None:
    """Check names, types and units of all wires, and that no input is driven twice.

    Raises
    ------
    UnknownNameError, WireError, UnitError
        At the first wire that is wrong.
    """
    driven: dict[str, Wire] = {}
    for wire in wires:
        source = _end(parts, wire, wire.source, "outputs")
        target = _end(parts, wire, wire.target, "inputs")
        if wire.target in driven:
            raise WireError(
                f"{wire.target} is driven twice, by {driven[wire.target].source} and by {wire.source}: "
                "remove one of the wires"
            )
        driven[wire.target] = wire
        _check_types(wire, source, target)
        _check_units(wire, source, target)


def find_part(parts: Mapping[str, Part], name: str, context: str) -> Part:
    """The part of this name.

    Raises
    ------
    UnknownNameError
        If there is none; the message names the context and the nearest part.
    """
    if name not in parts:
        raise UnknownNameError(f"there is no part '{name}' (in {context}): {nearest(name, parts)}")
    return parts[name]


def _end(parts: Mapping[str, Part], wire: Wire, dotted: str, role: str) -> Port:
    part_name, port_name = split_name(dotted)
    part = find_part(parts, part_name, f"wire {wire}")
    ports: dict[str, Port] = {port.name: port for port in getattr(part, role)}
    if port_name in ports:
        return ports[port_name]
    other = "inputs" if role == "outputs" else "outputs"
    if any(port.name == port_name for port in getattr(part, other)):
        raise WireError(
            f"{dotted} is one of the {other} of '{part_name}' (in wire {wire}): a wire runs from an output to an input"
        )
    raise UnknownNameError(
        f"'{part_name}' has no '{port_name}' among its {role} (in wire {wire}): {nearest(port_name, ports)}"
    )


def _check_types(wire: Wire, source: Port, target: Port) -> None:
    # Boolean -> Integer -> Real loses nothing, the other direction would round silently.
    if TYPE_ORDER.index(source.type) < TYPE_ORDER.index(target.type):
        raise WireError(
            f"{wire.source} is {source.type} but {wire.target} is {target.type}: "
            f"put a part between them that makes a {target.type}"
        )


def _check_units(wire: Wire, source: Port, target: Port) -> None:
    if units_agree(source.unit, source.base, target.unit, target.base) is not False:
        return
    base_source = source.base or parse_unit(source.unit or "")
    base_target = target.base or parse_unit(target.unit or "")
    raise UnitError(
        f"{wire.source} is in {source.unit} [{base_source}] but "
        f"{wire.target} is in {target.unit} [{base_target}]: "
        "connect ports of the same unit or put a conversion between them"
    )
