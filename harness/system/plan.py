"""The plan of a run: all that the inner loop needs, as arrays, and the loop body over operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from harness.errors import PartError
from harness.parts.part import Calls, Part, Port, StartValue, Values

SET: Final = 0
STEP: Final = 1
GET: Final = 2


@dataclass(frozen=True)
class MovingWire:
    """A wire whose value moves during a step: from one continuous part to another one, both stepped at every tick.

    Parameters
    ----------
    input, output : int
        Signals at its ends.
    source, target : int
        Parts at its ends.
    """

    input: int
    output: int
    source: int
    target: int


@dataclass(frozen=True)
class Plan:
    """A system laid out for running. All values are in one vector; parts and wires are index ranges of it.

    The same plan serves for all runs that differ in their start values only.

    Parameters
    ----------
    parts : tuple of Part, length P
        In stepping order.
    calls : list of Calls, length P
        What is done to each part; empty until the parts have been started.
    signals : float64 array, shape (S,)
        The values: exchanged outputs of all parts, then wired inputs of all parts, then constant inputs.
    outputs, inputs : int64 arrays, shape (P, 2)
        First and last+1 index into signals of each part's exchanged outputs and wired inputs.
    sources : int64 array, shape (S,)
        For a wired input the index of the output that drives it, otherwise the index itself.
    wire_gains, wire_offsets : float64 arrays, shape (S,)
        A wired input gets gain * output + offset.
    gains, offsets : float64 arrays, shape (S,)
        The same numbers as manipulators change them during a run.
    delays : int64 array, shape (S,)
        Delay of each wire in ticks.
    plain : bool
        All wires hand over just the value of the output, and nothing will change that.
    every, phase : int64 arrays, shape (P,)
        A part is operated on at the ticks k with k % every == phase; it is then stepped over ``every`` ticks,
        from tick k - phase on. Sampled parts have phase 0 (their sample is due at the beginning), continuous
        ones every - 1 (their outputs are due at the end).
    columns : mapping of str to int
        "part.port" -> index into signals.
    ports : mapping of str to Port
        "part.port" -> description of the port.
    start, step : float
        Time of tick k is start + k * step [s].
    ticks : int
        Number of steps.
    """

    parts: tuple[Part, ...]
    calls: list[Calls]
    signals: Values
    outputs: NDArray[np.int64]
    inputs: NDArray[np.int64]
    sources: NDArray[np.int64]
    wire_gains: Values
    wire_offsets: Values
    gains: Values
    offsets: Values
    delays: NDArray[np.int64]
    plain: bool
    every: NDArray[np.int64]
    phase: NDArray[np.int64]
    columns: Mapping[str, int]
    ports: Mapping[str, Port]
    start: float
    step: float
    ticks: int

    def time(self, tick: int) -> float:
        """Time of a tick [s], by multiplication, so that rounding does not accumulate."""
        return self.start + tick * self.step

    def begin(self, start: Mapping[str, StartValue]) -> None:
        """Set all values to those before a run: constants to their start values, the others to 0.

        Parameters
        ----------
        start : mapping of str to value
            Start values by "part.port".
        """
        self.signals[:] = 0.0
        for index in range(int(self.inputs.max(initial=0)), len(self.names)):
            name = self.names[index]
            stated = self.ports[name].start  # of an optional input that nothing drives
            self.signals[index] = float(start.get(name, np.nan if stated is None else stated))
        self.gains[:], self.offsets[:] = self.wire_gains, self.wire_offsets

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The name "part.port" of each signal."""
        return tuple(self.ports)

    @cached_property
    def owners(self) -> Mapping[int, int]:
        """The part that each exchanged output belongs to."""
        return {signal: part for part in range(len(self.parts)) for signal in range(*self.outputs[part])}

    @cached_property
    def moving_wires(self) -> tuple[MovingWire, ...]:
        """The wires of Reals that are not held, between continuous parts stepped at every tick, part by part."""
        wires = []
        for target, part in enumerate(self.parts):
            for signal in range(*(int(index) for index in self.inputs[target])):
                output = int(self.sources[signal])
                source = self.owners[output]
                real = self.ports[self.names[signal]].type == "Real" and not self.ports[self.names[output]].held
                if real and self.parts[source].moves and part.moves:
                    wires.append(MovingWire(signal, output, source, target))
        return tuple(wires)

    def fresh_inputs(self, schedule: Schedule) -> dict[int, bool]:
        """For every wired input whether the output is already that of the end of the step when it is handed over."""
        place = {operation: index for index, operation in enumerate(schedule.operations)}
        moving = {wire.input for wire in self.moving_wires}

        def rank(part: int) -> tuple[int, int]:  # of an implicit master: sampled, continuous, slow parts
            return (0 if self.parts[part].sampled else 1 if self.parts[part].moves else 2), part

        found = {}
        for target in range(len(self.parts)):
            for signal in range(*self.inputs[target]):
                source = self.owners[int(self.sources[signal])]
                if schedule.operations:
                    found[signal] = place[GET, source] < place[SET, target]
                else:
                    found[signal] = not schedule.extrapolation and (signal in moving or rank(source) < rank(target))
        return found


@dataclass(frozen=True)
class Schedule:
    """What a master does at every tick.

    Parameters
    ----------
    operations : tuple of (int, int)
        (SET | STEP | GET, index of the part) one after the other; of an implicit master none.
    tolerance : float
        Of an implicit master: residual over the size of the values, 0 for an explicit one.
    error : float
        Tolerated coupling error over the size of the values, from which an adaptive master finds its inner steps; 0:
        one step for every tick.
    extrapolation : int
        Order of the polynomials through earlier values that all parts step on at once; 0: what the operations say.
    """

    operations: tuple[tuple[int, int], ...]
    tolerance: float = 0.0
    error: float = 0.0
    extrapolation: int = 0


def map_of(gain: float, offset: float, output: float) -> float:
    """What a wire hands over; a plain one keeps the sign of zero, and gain 0 means that no output is asked."""
    if gain == 1.0 and offset == 0.0:
        return output
    return offset if gain == 0.0 else gain * output + offset


class Program:
    """A fixed list of operations that is run through at every tick, in Python.

    The compiled engine runs the same list from the arrays of the plan, with the same results to the last bit.

    Parameters
    ----------
    plan : Plan
        The started plan.
    operations : sequence of (int, int)
        (SET | STEP | GET, index of the part). SET first fetches the inputs from the outputs that drive them.
    manipulate : callable or None
        ``manipulate(tick)`` sets the gains and offsets of the wires for a tick.
    """

    def __init__(
        self, plan: Plan, operations: Sequence[tuple[int, int]], manipulate: Callable[[int], None] | None = None
    ) -> None:
        """Prepare each operation as one function."""
        self.plan = plan
        self._manipulate = manipulate
        self.operations = np.array(operations, dtype=np.int64).reshape(-1, 2)
        self._start = plan.start
        self._step = plan.step
        self._calls = [_call(plan, operation, part) for operation, part in operations]

    def __call__(self, tick: int) -> None:
        """Advance from tick to tick + 1.

        Raises
        ------
        PartError
            If a part fails; the error knows the time.
        """
        time = self._start + tick * self._step
        if self._manipulate is not None:
            self._manipulate(tick)
        try:
            for call in self._calls:
                call(tick, time)
        except PartError as error:
            if error.time is None:
                error.time = time
            raise


def _call(plan: Plan, operation: int, part: int) -> Callable[[int, float], None]:
    """One operation as a function of tick and time."""
    step = plan.step
    every, phase = int(plan.every[part]), int(plan.phase[part])
    calls = plan.calls[part]

    if operation == STEP:
        advance = calls.step
        if every == 1:
            return lambda tick, time: advance(time, step)
        return lambda tick, time: advance(plan.time(tick - phase), every * step) if tick % every == phase else None

    action = fetcher(plan, part) if operation == SET else calls.get
    if every == 1:
        return lambda tick, time: action()
    return lambda tick, time: action() if tick % every == phase else None


def fetcher(plan: Plan, part: int) -> Callable[[], None]:
    """Function that copies the driving outputs to the inputs of a part and hands them over."""
    first, last = (int(index) for index in plan.inputs[part])
    pairs = tuple((target, int(plan.sources[target])) for target in range(first, last))
    signals = memoryview(plan.signals.data)  # item access is three times faster than on the array
    hand_over = plan.calls[part].set

    if not pairs:
        return hand_over

    if not plan.plain:

        def set_mapped() -> None:
            for target, source in pairs:
                output = float(plan.signals[source])
                plan.signals[target] = map_of(float(plan.gains[target]), float(plan.offsets[target]), output)
            hand_over()

        return set_mapped

    def set_all() -> None:
        for target, source in pairs:
            signals[target] = signals[source]
        hand_over()

    return set_all
