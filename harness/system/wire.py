"""Connections: which output drives which input."""

import logging
import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Final

from harness.errors import ExperimentError, UnitError, UnknownNameError, WireError, nearest
from harness.parts.part import TYPE_ORDER, Part, Port, StartValue
from harness.storage.toml_file import TomlTable
from harness.units import conversion, needed_unit, parse_unit, units_agree
from harness.values import is_count, is_number, make_plain, number, shown, text

LONGEST_DELAY: Final = 10_000_000  # largest delay in communication steps, as all values in between are stored


@dataclass(frozen=True)
class Manipulator:
    """Base class of manipulators; use one of its subclasses.

    Several manipulators of one connection act in the given order, after the gain and the offset of the connection. Each
    is active in the communication steps that begin at start <= t < stop.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    start, stop : float
        Active span [s]; the default is the whole run.

    Raises
    ------
    ExperimentError
        If a number is invalid.
    """

    kind: ClassVar[str]
    input: str
    start: float = field(default=-math.inf, kw_only=True)
    stop: float = field(default=math.inf, kw_only=True)

    def __post_init__(self) -> None:
        make_plain(self)
        for name in ("value", "sigma", "probability", "start", "stop"):
            if not is_number(getattr(self, name, 0.0)):
                raise ExperimentError(
                    f"{name} of the {self.kind} of {self.input} is {shown(getattr(self, name))}: give a number"
                )
        if not self.start < self.stop:
            raise ExperimentError(
                f"the {self.kind} of {self.input} begins at {self.start} s and ends at {self.stop} s: "
                "give a start before the stop"
            )
        for name in ("value", "sigma"):
            if not math.isfinite(getattr(self, name, 0.0)):
                raise ExperimentError(
                    f"{name} of the {self.kind} of {self.input} is {getattr(self, name)}: give a finite number"
                )

    def __str__(self) -> str:
        return f"{self.kind} of {self.input}"


@dataclass(frozen=True)
class Override(Manipulator):
    """Replacement of the value by a constant.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    value : float
        The constant, in the unit of the input.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "override"
    value: float


@dataclass(frozen=True)
class Bias(Manipulator):
    """Addition of a constant to the value.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    value : float
        The added constant, in the unit of the input.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "bias"
    value: float


@dataclass(frozen=True)
class Noise(Manipulator):
    """Addition of normally distributed white noise, with a new value in every communication step.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    sigma : float
        Standard deviation, in the unit of the input.
    seed : int
        Seed of the random numbers; equal seeds give equal noise.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "noise"
    sigma: float
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sigma < 0.0:
            raise ExperimentError(f"sigma of the {self} is {self.sigma}: give 0 or more")
        _check_seed(self, self.seed)


@dataclass(frozen=True)
class Freeze(Manipulator):
    """Hold of the last value from before the span.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "freeze"


@dataclass(frozen=True)
class DropOut(Manipulator):
    """Random loss of values; the input then keeps the last value that arrived.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    probability : float
        Probability of losing the value of a communication step.
    seed : int
        Seed of the random numbers; equal seeds lose the same values.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "drop-out"
    probability: float
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.probability <= 1.0:
            raise ExperimentError(f"the probability of the {self} is {self.probability}: give 0 to 1")
        _check_seed(self, self.seed)


@dataclass(frozen=True)
class Delay(Manipulator):
    """Delay of the value by a number of communication steps; until then, the input has the first value of the output.

    With a master that holds values from the beginning of a step, such as jacobi, values already arrive one step late; a
    delay of one step then has no effect.

    Parameters
    ----------
    input : str
        ``"part.port"`` of the input at the end of the connection.
    ticks : int
        Delay in communication steps, 1 or more.
    start, stop : float
        Active span [s]; the default is the whole run.
    """

    kind: ClassVar[str] = "delay"
    ticks: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not is_count(self.ticks, 1, LONGEST_DELAY):
            raise ExperimentError(
                f"the {self} is {shown(self.ticks)} communication steps: give an integer from 1 to {LONGEST_DELAY}"
            )


_KINDS: dict[str, type[Manipulator]] = {cls.kind: cls for cls in (Override, Bias, Noise, Freeze, DropOut, Delay)}


def _check_seed(manipulator: Manipulator, seed: object) -> None:
    if not is_count(seed, 0, 1 << 64):
        raise ExperimentError(f"the seed of the {manipulator} is {shown(seed)}: give an integer, 0 or more")


def read_manipulator(table: Mapping[str, Any]) -> Manipulator:
    """Return a manipulator from a table such as ``{"kind": "bias", "input": "pid.x", "value": 1e-3, "start": 0.5}``."""
    kind = TomlTable(table, "a manipulator", ExperimentError).choice("kind", _KINDS)
    given = TomlTable(table, f"a {kind}", ExperimentError)
    keys = {item.name: item for item in fields(_KINDS[kind])}
    given.known(("kind", *keys))
    wanted = [key for key, item in keys.items() if key in given or item.default is MISSING]
    settings: dict[str, Any] = {
        key: given.take(key, *((text, "a text") if key == "input" else (_as_it_is, "a number"))) for key in wanted
    }
    return _KINDS[kind](**settings)


def _as_it_is(value: Any) -> Any:
    return value if number(value) is not None else None


def manipulator_table(manipulator: Manipulator) -> dict[str, str | float | int]:
    """Return the table that `read_manipulator` reads, without values at their defaults."""
    values = {item.name: getattr(manipulator, item.name) for item in fields(manipulator)}
    defaults = {item.name: item.default for item in fields(manipulator)}
    return {"kind": manipulator.kind, **{name: value for name, value in values.items() if value != defaults[name]}}


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
        make_plain(self)

    @cached_property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Both ends as ((part, output), (part, input))."""
        return split_name(self.source), split_name(self.target)

    def __str__(self) -> str:
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
        _check_items(wire, source, target)
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


def _check_items(wire: Wire, source: Port, target: Port) -> None:
    """Warn of two enumerations of which one has another item for a number, as a connection passes numbers."""
    items, others = ({number: name for name, number in port.items} for port in (source, target))
    number = next((number for number in items if items[number] != others.get(number)), None) if others else None
    if number is not None:
        other = f"'{others[number]}'" if number in others else "no item"
        _LOG.warning(
            "the connection %s passes %d, which is '%s' of the output and %s of the input: check the enumerations",
            *(wire, number, items[number], other),
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
    """Return the start values that FMUs of this project state for unconnected inputs."""
    # Those of other FMUs are kept in every system, with a warning.
    inputs = (
        (f"{part.name}.{port.name}", port)
        for part in parts
        for port in part.inputs
        if part.strict and not port.optional
    )
    return {name: port.start for name, port in inputs if name not in driven and port.start is not None}
