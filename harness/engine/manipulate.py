"""Manipulators during a run: at each tick, each one changes the gain and the offset of its connection."""

import ctypes
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from harness.compiling.engine_library import bytes_of, mirror
from harness.engine.native import Engine
from harness.errors import ExperimentError
from harness.parts.part import Values
from harness.system.plan import Plan, Schedule
from harness.system.wire import Bias, Delay, DropOut, Freeze, Manipulator, Noise, Override

_OVERRIDE, _BIAS, _NOISE, _LOSS, _DELAY = range(5)
_EVER: Final = 2**62

ManipulatorData = mirror("Manipulator")


class Manipulations:
    """All manipulators of a run."""

    def __init__(self, plan: Plan, schedule: Schedule, manipulators: Sequence[Manipulator]) -> None:
        """Collect all manipulators, the delays of the connections first."""
        self.plan = plan
        delays = [Delay(plan.names[i], ticks=int(plan.delays[i])) for i in np.flatnonzero(plan.delays)]
        self._given = [*delays, *manipulators]
        self._fresh = plan.fresh_inputs(schedule) if self._given else {}

    def begin(self) -> None:
        """Lay out all manipulators for a run of the plan, whose parts have been started."""
        found = [_lay_out(self.plan, manipulator, self._fresh) for manipulator in self._given]
        self.data = (ManipulatorData * len(found))(*(data for data, _, _ in found))
        self.samples, self.past = [samples for _, samples, _ in found], [past for _, _, past in found]
        for m, past in zip(self.data, self.past[: np.count_nonzero(self.plan.delays)], strict=False):
            if not math.isnan(self.plan.initials[m.input]):
                past[:] = self.plan.initials[m.input]

    def memory(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the values kept from step to step for a checkpoint, as views of the engine's data."""
        past = {f"past of manipulator {number}": values for number, values in enumerate(self.past)}
        values = bytes_of(self.data).reshape(-1, ctypes.sizeof(ManipulatorData))
        return {**past, "manipulators": values[:, ManipulatorData.gain.offset :]} if past else {}

    def attach(self, engine: Engine) -> None:
        """Pass the manipulators to the compiled engine."""
        keep = engine.keep
        for m, samples, past in zip(self.data, self.samples, self.past, strict=True):
            m.samples, m.past = None if samples is None else keep(samples), keep(past)
        engine.data.manipulators, engine.data.manipulator_count = ctypes.addressof(self.data), len(self.data)
        engine.data.wire_gains, engine.data.wire_offsets = keep(self.plan.wire_gains), keep(self.plan.wire_offsets)


def _lay_out(
    plan: Plan, manipulator: Manipulator, fresh: dict[int, bool]
) -> tuple[ctypes.Structure, Values | None, Values]:
    """Return a manipulator, its random numbers, and room for the past values of its connection."""
    index = plan.columns.get(manipulator.input, -1)
    if index not in fresh:
        raise ExperimentError(f"the {manipulator} acts on an input without a connection: name a connected input")
    if isinstance(manipulator, (Bias, Noise)) and plan.ports[manipulator.input].type != "Real":
        raise ExperimentError(
            f"{manipulator.input} is {plan.ports[manipulator.input].type}: a {manipulator.kind} needs a Real"
        )
    target = _target(plan, index)
    first, last = _tick(plan, manipulator.start), _tick(plan, manipulator.stop)
    output = float(plan.signals[plan.sources[index]])
    ticks = min(last, plan.ticks) - max(first, 0)
    length, value, samples = 1, 0.0, None
    match manipulator:
        case Override() | Bias():
            kind = _OVERRIDE if isinstance(manipulator, Override) else _BIAS
            value = manipulator.value
        case Noise():
            kind, value = _NOISE, manipulator.sigma
            samples = _drawn(manipulator, np.random.default_rng(manipulator.seed).standard_normal, ticks)
        case DropOut():
            kind, value = _LOSS, manipulator.probability
            samples = _drawn(manipulator, np.random.default_rng(manipulator.seed).random, ticks)
        case Freeze():
            kind = _LOSS
        case Delay():
            kind, length = _DELAY, delay_length(plan, index, manipulator.ticks)
        case _:
            raise TypeError(manipulator)
    data = ManipulatorData(kind=kind, input=index, first=max(first, 0), last=last, value=value, length=length)
    data.fresh, data.every, data.phase = fresh[index], int(plan.every[target]), int(plan.phase[target])
    data.gain, data.offset = float(plan.gains[index]), float(plan.offsets[index])
    return data, samples, np.full(length, output)


def delay_length(plan: Plan, signal: int, ticks: int) -> int:
    """Return the number of past values that a connection with a delay needs."""
    # The delay counts from the end of a step, except for a sample of a continuous part, which is taken at its
    # beginning.
    source = plan.parts[plan.owners[int(plan.sources[signal])]]
    return ticks + (plan.parts[_target(plan, signal)].sampled and not source.sampled)


def _target(plan: Plan, signal: int) -> int:
    """Return the part with this connected input."""
    return next(part for part in range(len(plan.parts)) if plan.inputs[part, 0] <= signal < plan.inputs[part, 1])


def _drawn(manipulator: Manipulator, draw: Callable[[int], Values], ticks: int) -> Values:
    """Draw a random number for each tick at which a manipulator is active."""
    try:
        return draw(max(ticks, 0))
    except (MemoryError, ValueError) as error:
        raise ExperimentError(
            f"the {manipulator} needs {ticks} random numbers, more than fit into memory: give it a shorter span"
        ) from error


def _tick(plan: Plan, time: float) -> int:
    """Return the first tick that begins at or after this time, up to a millionth of a tick."""
    if math.isinf(time):
        return _EVER if time > 0 else 0
    return math.ceil(min(max((time - plan.start) / plan.step - 1e-6, 0.0), _EVER))
