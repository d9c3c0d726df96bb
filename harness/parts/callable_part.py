"""Parts made from Python functions."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from harness.errors import PartError, StartValueError, UnknownNameError, WireError, nearest
from harness.parts.part import Calls, Part, Port, StartValue, Values

OutputFunction: TypeAlias = Callable[[float, Values, Values], ArrayLike]
StateFunction: TypeAlias = Callable[[float, float, Values, Values], ArrayLike]


class CallablePart(Part):
    """A part made from one or two Python functions.

    Parameters
    ----------
    name : str
        Name within the system.
    function : callable
        ``function(t, u, x) -> y``: outputs as a function of time t [s], inputs u, shape (n_inputs,), and state x, shape
        (n_states,). It returns a scalar, or a sequence in the order of the outputs.
    inputs, outputs : iterable of Port or str
        The ports; a port given as a plain name has no unit.
    advance : callable or None
        ``advance(t, h, u, x) -> x_next``: state at t + h with the inputs held at u. None keeps the state constant.
    state : array_like, shape (n_states,)
        State at the start of every run.
    dependencies : mapping of str to iterable of str, or None
        Inputs on which each output depends directly; an output that is missing here depends on all of them.
    sampled : bool
        If True, a step evaluates ``function`` at t and holds the outputs until t + h.
    every : int
        Sample time in communication steps.

    Raises
    ------
    WireError
        If two ports have the same name.
    UnknownNameError
        If ``dependencies`` names a port that does not exist.
    """

    def __init__(
        self,
        name: str,
        function: OutputFunction,
        inputs: Iterable[Port | str] = (),
        outputs: Iterable[Port | str] = (),
        *,
        advance: StateFunction | None = None,
        state: ArrayLike = (),
        dependencies: Mapping[str, Iterable[str]] | None = None,
        sampled: bool = False,
        every: int = 1,
    ) -> None:
        self.name = name
        self.function = function
        self.inputs = tuple(port if isinstance(port, Port) else Port(port) for port in inputs)
        self.outputs = tuple(port if isinstance(port, Port) else Port(port) for port in outputs)
        ports = [port.name for port in (*self.inputs, *self.outputs)]
        if len(set(ports)) < len(ports):
            raise WireError(f"two ports of '{name}' have the same name ({', '.join(ports)}): rename one")
        self.advance = advance
        self.initial_state = np.array(state, dtype=np.float64).reshape(-1)
        names = frozenset(port.name for port in self.inputs)
        given = {output: frozenset(read) for output, read in (dependencies or {}).items()}
        self.dependencies = {port.name: given.get(port.name, names) for port in self.outputs}
        for output, read in given.items():
            if output not in self.dependencies:
                remedy = nearest(output, self.dependencies)
                raise UnknownNameError(f"'{name}' has no output '{output}' (in its dependencies): {remedy}")
            for missing in sorted(read - names):
                remedy = nearest(missing, names)
                raise UnknownNameError(f"'{name}' has no input '{missing}' (in its dependencies): {remedy}")
        self.sampled = sampled
        self.every = every
        self._time = 0.0
        self._x = self.initial_state.copy()
        self._u = np.zeros(len(self.inputs))
        self._held: Values | None = None

    def enter_initialisation(
        self, start: float, stop: float, tolerance: float | None, values: Mapping[str, StartValue]
    ) -> None:
        """Set the state and the constant inputs."""
        self._time = start
        self._x = self.initial_state.copy()
        self._held = None
        for index, port in enumerate(self.inputs):
            value = values.get(port.name, port.start)
            if isinstance(value, str):
                raise StartValueError(f"{self.name}.{port.name} is '{value}', which is not a number: give a number")
            self._u[index] = 0.0 if value is None else value

    def bind(self, inputs: Sequence[str], outputs: Sequence[str], u: Values, y: Values) -> Calls:
        """Connect to the signal vector."""
        order = [port.name for port in self.inputs]
        wired = [order.index(name) for name in inputs]
        order = [port.name for port in self.outputs]
        read = [order.index(name) for name in outputs]

        def set_() -> None:
            self._u[wired] = u

        def get() -> None:
            y[:] = (self._outputs() if self._held is None else self._held)[read]

        return Calls(set_, self._step, get)

    def save(self, state: object | None = None) -> object:
        """Copy time, state, inputs and held outputs."""
        return self._time, self._x.copy(), self._u.copy(), None if self._held is None else self._held.copy()

    def restore(self, state: object) -> None:
        """Return to a saved state."""
        assert isinstance(state, tuple)
        self._time, x, u, held = state
        self._x, self._u[:], self._held = x.copy(), u, None if held is None else held.copy()

    def serialise(self) -> bytes:
        """Return time, state, inputs and held outputs as bytes."""
        held = np.zeros(0) if self._held is None else self._held
        return np.concatenate(([self._time, self._held is not None], self._x, self._u, held)).tobytes()

    def deserialise(self, data: bytes) -> None:
        """Return to a state from `serialise`."""
        values = np.frombuffer(data[: len(data) // 8 * 8])
        sizes = (2, self.initial_state.size, len(self.inputs))
        if len(data) not in (8 * sum(sizes), 8 * (sum(sizes) + len(self.outputs))):
            raise PartError(self.name, "deserialise", f"the state has {len(data)} bytes and belongs to another part")
        clock, x, u, held = np.split(values, np.cumsum(sizes))
        self.restore((float(clock[0]), x, u, held if clock[1] else None))

    def _step(self, t: float, h: float) -> None:
        self._time = t
        if self.sampled:
            self._held = self._outputs()
        if self.advance is not None:
            self._x = self._called(self.advance, t, h, self._u, self._x, size=self._x.size)
        self._time = t + h

    def _outputs(self) -> Values:
        return self._called(self.function, self._time, self._u, self._x, size=len(self.outputs))

    def _called(self, function: Callable[..., ArrayLike], *arguments: object, size: int) -> Values:
        """Return the result of a user's function as an array; raise its exceptions as errors of this part."""
        name = getattr(function, "__name__", "function")
        try:
            result = np.array(function(*arguments), dtype=np.float64).reshape(-1)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise PartError(self.name, name, reason, self._time) from error
        if result.size != size:
            reason = f"it returned {result.size} values instead of {size}"
            raise PartError(self.name, name, reason, self._time)
        return result
