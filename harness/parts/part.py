"""Parts and their ports, the elements of a system."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError, nearest
from harness.notebook import part_html, part_text
from harness.units import BaseUnit
from harness.values import is_line, shown

Values: TypeAlias = NDArray[np.float64]
StartValue: TypeAlias = float | int | bool | str
PortType: TypeAlias = Literal["Real", "Integer", "Boolean", "String"]

TYPE_ORDER: Final[tuple[PortType, ...]] = ("Real", "Integer", "Boolean", "String")


@dataclass(frozen=True)
class Port:
    """One scalar variable of a part.

    Parameters
    ----------
    name : str
        Name within the part; a vector element is ``k[1]``.
    unit : str or None
        Unit name; None means that no unit is stated, and connections to this port are not checked for units.
    type : {"Real", "Integer", "Boolean", "String"}
        Type of the variable. Values of the first three are exchanged as float64; a String is set once, before a run.
    start : float, int, bool, str or None
        Start value, if there is one.
    description : str
        One line of text.
    base : BaseUnit or None
        The unit in base units; None derives it from the unit name.
    items : tuple of (str, int)
        Names and values of an enumeration, which is treated as an Integer.
    limits : (float, float)
        Smallest and largest value.
    nominal : float
        Nominal value: the typical magnitude.
    held : bool
        Whether an output is piecewise constant (FMI: discrete variability).
    """

    name: str
    unit: str | None = None
    type: PortType = "Real"
    start: StartValue | None = None
    description: str = ""
    base: BaseUnit | None = None
    items: tuple[tuple[str, int], ...] = ()
    limits: tuple[float, float] = (-math.inf, math.inf)
    nominal: float = 1.0
    held: bool = False

    def __post_init__(self) -> None:
        if not is_line(self.name):
            raise HarnessError(f"the name {shown(self.name)} of a port has control characters: rename it")

    @property
    def optional(self) -> bool:
        """Whether an input may stay unconnected, with its start value; its description begins with ``optional``."""
        return self.description.startswith("optional: ")


@dataclass(frozen=True)
class Calls:
    """The three operations on a running part in a communication step, as prepared functions.

    Parameters
    ----------
    set : callable
        Set the bound inputs of the part.
    step : callable
        ``step(t, h)``: advance the part from t to t + h [s]. A sampled part takes its sample at t.
    get : callable
        Get the bound outputs of the part.
    instance : object
        The instance that the operations call; None if each run needs new operations.
    """

    set: Callable[[], None]
    step: Callable[[float, float], None]
    get: Callable[[], None]
    instance: object = None


@dataclass(frozen=True)
class Native:
    """Data with which the native engine calls a running FMU without Python."""

    component: int  # address of the instance; of its adapter for an FMI 3.0 FMU
    instance: int | None  # address of the instance of an FMI 3.0 FMU
    functions: Mapping[str, int]
    """Address of each function of FMI 2.0, by its name without ``fmi2``, and of those of FMI 3.0 that are called
    directly, with ``instance``."""
    inputs: Sequence[int]  # value references, in the order in which the ports were bound
    outputs: Sequence[int]  # value references
    interpolates: bool  # whether the FMU accepts input derivatives
    saves: bool  # whether the state can be saved and restored
    failure: Callable[[str, int, float], Exception]  # ``failure(function, status, time)`` returns the error


class Part(ABC):
    """Base class of everything that can be set, stepped and read: an FMU, a Python function, a recorded series.

    The order of calls is enter_initialisation, bind, (set, get)*, exit_initialisation, (set, step, get)*, terminate.
    After terminate, the part can be initialised again. close releases all resources for good.

    Attributes
    ----------
    name : str
        Name within the system.
    inputs, outputs : tuple of Port
        Ports that can be connected.
    parameters : tuple of Port
        Other variables that accept a start value.
    observables : tuple of Port
        Other variables that can be recorded.
    dependencies : mapping of str to frozenset of str
        For each output, the inputs on which it depends directly (without a state in between).
    undeclared : frozenset of str
        Outputs without declared dependencies. They are taken to depend on all inputs until a run finds their
        dependencies.
    integrals : mapping of str to str
        Of variables such as a velocity: the name of the state, such as a position, whose rate each of them is.
    strict : bool
        Whether an input with neither a connection nor a given value is an error, even if the part states a start value.
    saves : bool
        Whether the state can be saved and restored.
    events : bool
        Whether values may jump at a communication point, before the next step.
    others : mapping of str to str
        Types of its variables that are no ports, by name.
    sampled : bool
        Whether the outputs change only at the beginning of a step (controllers, estimators).
    follows : bool
        Whether a sampled part takes its samples within a step, from inputs that are lines.
    every : int
        Sample time in communication steps: the part is stepped once in this many steps.
    identity : str
        Distinguishes this part from others with the same name, such as the GUID of an FMU.
    instance : object
        The instance that the `Calls` of the current run call. A run that reuses an instance does not bind the part
        again.
    """

    identity: str = ""
    instance: object = None
    undeclared: frozenset[str] = frozenset()
    integrals: Mapping[str, str] = MappingProxyType({})
    strict: bool = True
    saves: bool = True
    events: bool = False
    name: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    parameters: tuple[Port, ...] = ()
    observables: tuple[Port, ...] = ()
    dependencies: Mapping[str, frozenset[str]]
    others: Mapping[str, str] = MappingProxyType({})
    sampled: bool = False
    follows: bool = False
    every: int = 1

    def hint(self, name: str, known: Iterable[str]) -> str:
        """Return why a name is none of the known ones, or which of these is the most similar."""
        if kind := self.others.get(name):
            return f"it is of the type {kind}, which cannot be connected, set or recorded"
        return nearest(name, known)

    __repr__ = part_text
    _repr_html_ = part_html

    @property
    def moves(self) -> bool:
        """Whether outputs may vary continuously between communication points."""
        return not self.sampled and self.every == 1 and not (self.outputs and all(port.held for port in self.outputs))

    def inner_tolerance(self, given: float | None) -> float:
        """Return the relative error that a solver inside the part may leave, for the tolerance of the run."""
        return 0.0

    def resize(self, start: Mapping[str, StartValue]) -> None:  # noqa: B027, most parts have no such parameters
        """Adapt the ports to those start values that are sizes of arrays."""

    @abstractmethod
    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        """Make a new instance with these start values, by name, and enter initialisation mode.

        The run goes from start to stop [s]; a tolerance of None leaves the accuracy to the part. Raise StartValueError
        if the part rejects a value, and PartError if it cannot be initialised.
        """

    @abstractmethod
    def bind(self, inputs: Sequence[str], outputs: Sequence[str], u: Values, y: Values) -> Calls:
        """Bind ports of the part to arrays, and return the operations of a communication step.

        The ports are sorted by type in the order of ``TYPE_ORDER``; outputs may be observables. ``u`` and ``y`` are
        contiguous float64 views with a number for each: every set reads ``u``, and every get writes ``y``.
        """

    def native(self, inputs: Sequence[str], outputs: Sequence[str]) -> Native | None:
        """Return how the native engine calls the part with the ports of `bind`; None if only Python can."""
        return None

    def exit_initialisation(self) -> None:  # noqa: B027, some parts have no modes
        """Leave initialisation mode; the part is then at the start time."""

    def event(self, time: float) -> None:  # noqa: B027, most parts have none
        """Take the event at a communication point [s], as the next step does."""

    @abstractmethod
    def save(self, state: object | None = None) -> object:
        """Copy the complete state, for `restore`; the memory of a state from an earlier call is reused."""

    def serialise(self) -> bytes:
        """Return the complete state as bytes for `deserialise`; raise HarnessError if the part cannot save it."""
        raise HarnessError(f"part '{self.name}' cannot save its state to a file: run the system without a checkpoint")

    def deserialise(self, data: bytes) -> None:
        """Restore a state of `serialise`, also in another process; raise HarnessError if it is rejected."""
        raise HarnessError(f"part '{self.name}' cannot read its state from a file: run the system without a checkpoint")

    @abstractmethod
    def restore(self, state: object) -> None:
        """Restore a state from `save`."""

    def terminate(self) -> None:  # noqa: B027, some parts hold nothing
        """End the run; without a run this has no effect."""

    def close(self) -> None:
        """Release all resources; further calls have no effect."""
        self.terminate()
