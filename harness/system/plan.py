"""The plan of a run: everything that the inner loop needs, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from harness.parts.part import Calls, Part, Port, StartValue, Values

if TYPE_CHECKING:
    from harness.engine.algorithm import Algorithm
    from harness.engine.native import Engine

SET: Final = 0
STEP: Final = 1
GET: Final = 2
RENEW: Final = 7
"""Sets the inputs after the step, as `SET` does before it."""


@dataclass(frozen=True)
class MovingWire:
    """A connection whose value varies during a step: between two continuous parts that step at every tick."""

    input: int  # signal at its end
    output: int  # signal at its beginning
    source: int  # part at its beginning
    target: int  # part at its end


@dataclass(frozen=True)
class Plan:
    """A system prepared for a run. One vector holds all values; parts and connections are index ranges of it.

    Runs that differ in their start values only share a plan.

    Parameters
    ----------
    parts : tuple of Part, length P
        The parts in stepping order.
    calls : list of Calls, length P
        Operations of each part; empty until the parts have been started.
    signals : float64 array, shape (S,)
        The values: exchanged outputs of all parts, then connected inputs of all parts, then constant inputs.
    outputs, inputs : int64 arrays, shape (P, 2)
        Range in ``signals`` of each part's exchanged outputs and connected inputs: first index and last index + 1.
    sources : int64 array, shape (S,)
        Index of the output that drives a connected input; for any other signal its own index.
    wire_gains, wire_offsets : float64 arrays, shape (S,)
        A connected input gets gain * output + offset.
    gains, offsets : float64 arrays, shape (S,)
        The same numbers, as manipulators change them during a run.
    delays : int64 array, shape (S,)
        Delay of each connection in communication steps.
    initials : float64 array, shape (S,)
        Value of the output until the delay has passed; NaN: its first value.
    plain : bool
        Whether all connections always pass the value of the output unchanged.
    every, phase : int64 arrays, shape (P,)
        Sample time of each part in communication steps, and its phase. A part is set, stepped and read at the ticks k
        with k % every == phase; it is then stepped over ``every`` ticks, from tick k - phase on. Sampled parts have
        phase 0 (their sample is taken at the beginning), continuous parts every - 1 (their outputs are needed at the
        end).
    columns : mapping of str to int
        Index in ``signals`` of each "part.port".
    ports : mapping of str to Port
        Port of each "part.port".
    start, step : float
        Tick k begins at start + k * step [s].
    ticks : int
        Number of communication steps.
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
    initials: Values
    plain: bool
    every: NDArray[np.int64]
    phase: NDArray[np.int64]
    columns: Mapping[str, int]
    ports: Mapping[str, Port]
    start: float
    step: float
    ticks: int

    def time(self, tick: int) -> float:
        """Return the time of a tick [s], by multiplication, so that rounding errors do not accumulate."""
        return self.start + tick * self.step

    def begin(self, start: Mapping[str, StartValue]) -> None:
        """Set all values to those before a run: constants to their start values by "part.port", the others to 0."""
        self.signals[:] = 0.0
        for index in range(int(self.inputs.max(initial=0)), len(self.names)):
            name = self.names[index]
            stated = self.ports[name].start  # of an unconnected optional input
            self.signals[index] = float(start.get(name, np.nan if stated is None else stated))
        self.gains[:], self.offsets[:] = self.wire_gains, self.wire_offsets
        for i in np.flatnonzero(~np.isnan(self.initials)):
            self.gains[i], self.offsets[i] = 0.0, map_of(self.gains[i], self.offsets[i], self.initials[i])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The name "part.port" of each signal."""
        return tuple(self.ports)

    @cached_property
    def owners(self) -> Mapping[int, int]:
        """The part of each exchanged output."""
        return {signal: part for part in range(len(self.parts)) for signal in range(*self.outputs[part])}

    @cached_property
    def moving_wires(self) -> tuple[MovingWire, ...]:
        """The Real connections between continuous parts stepped at every tick, part by part."""
        wires = []
        for target, part in enumerate(self.parts):
            for signal in range(*(int(index) for index in self.inputs[target])):
                output = int(self.sources[signal])
                source = self.owners[output]
                real = self.ports[self.names[signal]].type == "Real" and not self.ports[self.names[output]].held
                follows = part.moves or (part.follows and not self.parts[source].inputs)
                if real and self.parts[source].moves and follows:
                    wires.append(MovingWire(signal, output, source, target))
        return tuple(wires)

    def fresh_inputs(self, schedule: Schedule) -> dict[int, bool]:
        """Return for each connected input whether it gets its source's value from the end of the step."""
        place = {operation: index for index, operation in reversed(list(enumerate(schedule.operations)))}
        moving = {wire.input for wire in self.moving_wires}

        def rank(part: int) -> tuple[int, int]:  # implicit master: sampled, continuous, slow parts
            return (0 if self.parts[part].sampled else 1 if self.parts[part].moves else 2), part

        found = {}
        for target in range(len(self.parts)):
            for signal in range(*self.inputs[target]):
                source = self.owners[int(self.sources[signal])]
                if schedule.operations:
                    found[signal] = place[GET, source] < place[SET, target]
                else:
                    found[signal] = schedule.implicit and (signal in moving or rank(source) < rank(target))
        return found


@dataclass(frozen=True)
class Schedule:
    """What a master does at every tick."""

    operations: tuple[tuple[int, int], ...] = ()
    """Pairs (SET | STEP | GET | RENEW, index of the part), executed in this order."""
    algorithm: Callable[[Engine], Algorithm] | None = None
    """``algorithm(engine)`` returns an `Algorithm` in C, which replaces the operations."""
    implicit: bool = False  # whether it solves loops, so that inputs get values from the end of the step
    lines: tuple[MovingWire, ...] = ()
    """Connections whose values the operations pass as lines from the beginning to the end of the step, to FMUs that
    interpolate inputs."""


def map_of(gain: float, offset: float, output: float) -> float:
    """Return the value that a connection passes; a plain one keeps the sign of zero, gain 0 ignores the output."""
    if gain == 1.0 and offset == 0.0:
        return output
    return offset if gain == 0.0 else gain * output + offset


def fetcher(plan: Plan, part: int) -> Callable[[], None]:
    """Return a function that copies the driving outputs to the inputs of a part and sets them."""
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
