"""What a system is made of: ports and the parts that carry them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from harness.errors import HarnessError
from harness.notebook import part_html, part_text
from harness.units import BaseUnit

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
        Unit name; None means not stated, and is then not checked on a wire.
    type : {"Real", "Integer", "Boolean", "String"}
        Values of the first three cross as float64; a String is set once, before a run.
    start : float, int, bool, str or None
        Start value, where there is one.
    description : str
        One line for people.
    base : BaseUnit or None
        The unit in base units; None means that it follows from the unit's name.
    items : tuple of (str, int)
        Names and values of an enumeration, which is an Integer here.
    limits : (float, float)
        Smallest and largest value.
    nominal : float
        Size that values usually have.
    held : bool
        Whether an output is constant between instants at which it jumps (FMI: discrete variability).
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

    @property
    def optional(self) -> bool:
        """Whether an input may stay unconnected, then with its start value: its description says so first."""
        return self.description.startswith("optional: ")


@dataclass(frozen=True)
class Calls:
    """The three things done to a running part at every communication step, ready to be called.

    Parameters
    ----------
    set : callable
        Hand the bound inputs over to the part.
    step : callable
        ``step(t, h)``: advance from t to t + h [s]. A sampled part takes its sample at t.
    get : callable
        Fetch the bound outputs from the part.
    instance : object
        What they call; None if every run needs new ones.
    """

    set: Callable[[], None]
    step: Callable[[float, float], None]
    get: Callable[[], None]
    instance: object = None


@dataclass(frozen=True)
class Native:
    """What the native engine needs to call a running FMU without Python.

    Parameters
    ----------
    component : int
        Address of the instance.
    functions : mapping of str to int
        Address of each function, by its name without ``fmi2``.
    inputs, outputs : sequence of int
        Value references in the order in which the ports were bound.
    input_types, output_types : sequence of PortType
        Their types.
    interpolates : bool
        Whether inputs may have derivatives.
    saves : bool
        Whether the state can be saved and restored.
    failure : callable
        ``failure(function, status, time)`` makes the error for a call that failed.
    """

    component: int
    functions: Mapping[str, int]
    inputs: Sequence[int]
    outputs: Sequence[int]
    input_types: Sequence[PortType]
    output_types: Sequence[PortType]
    interpolates: bool
    saves: bool
    failure: Callable[[str, int, float], Exception]


class Part(ABC):
    """Anything that can be set, stepped and read: an FMU, a Python callable, a recorded series.

    The life of a part is enter_initialisation, bind, (set, get)*, exit_initialisation, (set, step, get)*,
    terminate; after terminate it can be initialised again; close gives everything back for good.

    Attributes
    ----------
    name : str
        Name within the system.
    inputs, outputs : tuple of Port
        What can be wired.
    parameters : tuple of Port
        What else accepts a start value.
    observables : tuple of Port
        What else can be recorded.
    dependencies : mapping of str to frozenset of str
        For each output the inputs on which it depends directly (without a state in between).
    undeclared : frozenset of str
        The outputs for which nobody has said that. Their dependencies are all inputs, until a run finds them.
    strict : bool
        Whether an input without a wire and a value is an error, even if it has a start value.
    saves : bool
        Whether the state can be saved and restored.
    sampled : bool
        True if the outputs change only at the beginning of a step (controllers, estimators).
    every : int
        The part is stepped only every so many ticks, over that many ticks.
    identity : str
        What tells this kind of part from others with the same name, such as the GUID of an FMU.
    instance : object
        What the `Calls` of the present run call. A run that begins with the instance of an earlier one does not bind
        the part again.
    """

    identity: str = ""
    instance: object = None
    undeclared: frozenset[str] = frozenset()
    strict: bool = True
    saves: bool = True
    name: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    parameters: tuple[Port, ...] = ()
    observables: tuple[Port, ...] = ()
    dependencies: Mapping[str, frozenset[str]]
    sampled: bool = False
    every: int = 1

    def __repr__(self) -> str:
        """Return its kind, its name and the numbers of its variables."""
        return part_text(self)

    def _repr_html_(self) -> str:
        """Return its variables as a table, for a notebook."""
        return part_html(self)

    @property
    def moves(self) -> bool:
        """Whether outputs may change continuously from tick to tick."""
        return not self.sampled and self.every == 1 and not (self.outputs and all(port.held for port in self.outputs))

    @abstractmethod
    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        """Make a fresh instance with these start values and enter initialisation mode.

        Parameters
        ----------
        start, stop : float
            Span of the run [s].
        tolerance : float or None
            Relative tolerance for the part's own solver, if one is asked for.
        values : mapping of str to value
            Start values of inputs and parameters by name.

        Raises
        ------
        StartValueError
            If the part refuses a value.
        PartError
            If the part cannot be initialised.
        """

    @abstractmethod
    def bind(self, inputs: Sequence[str], outputs: Sequence[str], u: Values, y: Values) -> Calls:
        """Connect the part to the places its values come from and go to.

        Parameters
        ----------
        inputs, outputs : sequence of str
            The ports that will be exchanged, sorted by type in the order of ``TYPE_ORDER``. Outputs may be
            observables.
        u, y : float64 array, shapes (len(inputs),) and (len(outputs),)
            Contiguous views that are read at every set and written at every get.
        """

    def native(self, inputs: Sequence[str], outputs: Sequence[str]) -> Native | None:
        """What the native engine needs to call the part, bound to the same ports; None if only Python can."""
        return None

    @abstractmethod
    def exit_initialisation(self) -> None:
        """Leave initialisation mode; the part is then at the start time."""

    @abstractmethod
    def save(self, state: object | None = None) -> object:
        """Copy the complete state; a state from an earlier save of this part may be handed in for re-use."""

    def serialise(self) -> bytes:
        """The complete state as bytes that another process can restore.

        Raises
        ------
        HarnessError
            If the part has none.
        """
        raise HarnessError(f"part '{self.name}' cannot put its state into a file: run it without a checkpoint")

    def deserialise(self, data: bytes) -> None:
        """Return to a state that `serialise` gave, of this part in the same or in another process.

        Raises
        ------
        HarnessError
            If the part refuses it.
        """
        raise HarnessError(f"part '{self.name}' cannot read its state from a file: run it without a checkpoint")

    @abstractmethod
    def restore(self, state: object) -> None:
        """Return to a saved state."""

    @abstractmethod
    def terminate(self) -> None:
        """End the run; harmless if there is none."""

    def close(self) -> None:
        """Give back all resources; harmless if done twice."""
        self.terminate()
