"""Connections: which output drives which input."""

from __future__ import annotations

import logging
import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from harness.errors import UnitError, UnknownNameError, WireError, nearest
from harness.parts.part import TYPE_ORDER, Part, Port, StartValue
from harness.system.manipulator import LONGEST_DELAY
from harness.units import conversion, needed_unit, parse_unit, units_agree
from harness.values import is_count, make_plain, shown

_LOG = logging.getLogger("harness")


@dataclass(frozen=True)
class Wire:
    """A connection from an output to an input.

    Parameters
    ----------
    source, target : str
        ``"part.port"`` of the output and of the input. Names of parts contain no dot; names of ports may contain dots.
    gain, offset : float
        The input gets gain * output + offset; the offset is in the unit of the input.
    delay : int
        Delay in communication steps, see `Delay`.
    initial : float or None
        Value of the output, in its unit, that the input gets until the delay has passed; None: its first value.
    """

    source: str
    target: str
    gain: float = 1.0
    offset: float = 0.0
    delay: int = 0
    initial: float | None = None

    def __post_init__(self) -> None:
        """Make numbers of numpy plain."""
        make_plain(self)

    @cached_property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Both ends as ((part, output), (part, input))."""
        return split_name(self.source), split_name(self.target)

    def __str__(self) -> str:
        """Return a text with both ends."""
        return f"{self.source} -> {self.target}"


@lru_cache(maxsize=10_000)  # every run has the same few names
def split_name(dotted: str) -> tuple[str, str]:
    """Return part and port of ``"part.port"``."""
    part, dot, port = dotted.partition(".")
    if not (part and dot and port):
        raise WireError(f"'{dotted}' does not name a port: write it as 'part.port'")
    return part, port


def parse_wire(text: str | tuple[str, str] | Wire) -> Wire:
    """Return the connection for ``"a.y -> b.u"`` or the pair ``("a.y", "b.u")``."""
    if isinstance(text, Wire):
        return text
    ends = text.split("->") if isinstance(text, str) else text
    if len(ends) != 2:
        raise WireError(f"'{text}' is not a connection: write it as 'part.output -> part.input'")
    wire = Wire(ends[0].strip(), ends[1].strip())
    split_name(wire.source), split_name(wire.target)
    return wire


def check_wires(parts: Mapping[str, Part], wires: Sequence[Wire]) -> None:
    """Check names, types and units of all connections, and that no input is driven twice."""
    driven: dict[str, Wire] = {}
    for wire in wires:
        source = _end(parts, wire, wire.source, "outputs")
        target = _end(parts, wire, wire.target, "inputs")
        if wire.target in driven:
            raise WireError(
                f"{wire.target} is driven twice, by {driven[wire.target].source} and by {wire.source}: "
                "remove one of the connections"
            )
        driven[wire.target] = wire
        _check_types(wire, source, target)
        _check_units(parts, wire, source, target)
        _check_map(wire, source, target)


def find_part(parts: Mapping[str, Part], name: str, context: str) -> Part:
    """Return the part with this name."""
    if name not in parts:
        raise UnknownNameError(f"there is no part '{name}' (in {context}): {nearest(name, parts)}")
    return parts[name]


def _end(parts: Mapping[str, Part], wire: Wire, dotted: str, role: str) -> Port:
    part_name, port_name = split_name(dotted)
    part = find_part(parts, part_name, f"connection {wire}")
    ports: dict[str, Port] = {port.name: port for port in getattr(part, role)}
    if port_name in ports:
        return ports[port_name]
    if any(port.name == port_name and port.type == "String" for port in part.parameters):
        raise WireError(
            f"{dotted} is a text (in connection {wire}), which cannot be connected: give it a start value instead"
        )
    other = "inputs" if role == "outputs" else "outputs"
    if any(port.name == port_name for port in getattr(part, other)):
        raise WireError(
            f"{dotted} is one of the {other} of '{part_name}' (in connection {wire}): connect an output to an input"
        )
    raise UnknownNameError(
        f"'{part_name}' has no '{port_name}' among its {role} (in connection {wire}): {part.hint(port_name, ports)}"
    )


def _check_types(wire: Wire, source: Port, target: Port) -> None:
    # Boolean -> Integer -> Real is lossless; the other direction would round silently
    if TYPE_ORDER.index(source.type) < TYPE_ORDER.index(target.type):
        raise WireError(
            f"{wire.source} is {source.type} but {wire.target} is {target.type}: "
            f"insert a part that converts to {target.type}"
        )


def _check_units(parts: Mapping[str, Part], wire: Wire, source: Port, target: Port) -> None:
    """Raise an error if a unit that would have to be converted is unknown; only warn if an FMU of others states it."""
    if not source.unit or not target.unit or source.unit == target.unit:
        return
    for (part, _), dotted, port in zip(wire.ends, (wire.source, wire.target), (source, target), strict=True):
        try:
            needed_unit(port.unit, port.base, dotted)
        except UnitError as error:
            if parts[part].strict:
                raise UnitError(f"{error} (in connection {wire})") from None
            _LOG.warning("%s: the connection %s does not convert %s to %s", error, wire, source.unit, target.unit)


def wire_map(wire: Wire, source: Port, target: Port) -> tuple[float, float]:
    """Return gain and offset from the output to the input, including unit conversion."""
    factor, shift = _conversion(wire, source, target)
    return wire.gain * factor, wire.gain * shift + wire.offset


def _conversion(wire: Wire, source: Port, target: Port) -> tuple[float, float]:
    if units_agree(source.unit, source.base, target.unit, target.base) is not False:
        return 1.0, 0.0
    base_source = source.base or parse_unit(source.unit or "")
    base_target = target.base or parse_unit(target.unit or "")
    assert base_source is not None and base_target is not None, "unknown units agree"
    converted = conversion(base_source, base_target)
    if converted is None:
        raise UnitError(
            f"{wire.source} is in {source.unit} [{base_source}] but "
            f"{wire.target} is in {target.unit} [{base_target}]: "
            "connect ports of the same quantity, or insert a conversion"
        )
    return converted


def _check_map(wire: Wire, source: Port, target: Port) -> None:
    gain, offset = wire_map(wire, source, target)
    if not (math.isfinite(gain) and math.isfinite(offset)):
        raise WireError(
            f"the connection {wire} has the gain {wire.gain} and the offset {wire.offset}: give finite numbers"
        )
    if (gain, offset) != (1.0, 0.0) and target.type != "Real":
        raise WireError(f"{wire.target} is {target.type}: only a connection to a Real can have a gain or an offset")
    if not is_count(wire.delay, 0, LONGEST_DELAY):
        raise WireError(
            f"the delay of the connection {wire} is {shown(wire.delay)}: "
            f"give an integer number of communication steps from 0 to {LONGEST_DELAY}"
        )
    if wire.initial is None:
        return
    if not wire.delay:
        raise WireError(f"the connection {wire} has an initial value but no delay: give a delay, or no initial value")
    whole = wire.initial in (0, 1) if source.type == "Boolean" else wire.initial % 1.0 == 0.0
    if not (math.isfinite(wire.initial) and (whole or source.type == "Real")):
        raise WireError(
            f"the initial value of the connection {wire} is {shown(wire.initial)}: give a finite number that "
            f"{wire.source}, a {source.type}, can have"
        )


def stated_starts(parts: Iterable[Part], driven: Container[str]) -> dict[str, StartValue]:
    """Return the start values that FMUs of this project state for inputs that nothing drives.

    Those of other FMUs are kept in every system, with a warning.
    """
    inputs = (
        (f"{part.name}.{port.name}", port)
        for part in parts
        for port in part.inputs
        if part.strict and not port.optional
    )
    return {name: port.start for name, port in inputs if name not in driven and port.start is not None}
