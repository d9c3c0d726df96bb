"""The loop of an explicit master in Python, an oracle for the compiled engine, which gives the same bits."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

from harness import Experiment, PartError, Result, Tap
from harness.engine.algorithm import Progress, Recorder, Ticks
from harness.engine.manipulate import _BIAS, _DELAY, _LOSS, _NOISE, _OVERRIDE, Manipulations
from harness.masters import find_master
from harness.parts.part import Values
from harness.run import Options, Session
from harness.system.assembly import Assembly
from harness.system.plan import RENEW, SET, STEP, Plan, Schedule, fetcher, map_of


class PythonSession(Session):
    """A session whose loop runs in Python."""

    def __init__(self, system: Assembly, experiment: Experiment, options: Options | None = None) -> None:
        super().__init__(system, experiment, options)
        schedule = find_master(experiment.master).schedule(self._plan, experiment)
        assert schedule.operations and not schedule.lines, "masters that only hold values run in Python"
        self._ticks = PythonTicks(self._plan, schedule, experiment)


def run_in_python(
    system: Assembly, experiment: Experiment, taps: tuple[Tap, ...] = (), progress: Progress | None = None
) -> Result:
    return PythonSession(system, experiment, Options(taps, progress)).run(system.start).result()


@dataclass
class Loss:
    """What a drop-out or a freeze remembers."""

    gain: float
    offset: float
    held: float = 0.0
    lost: bool = False


class PythonTicks(Ticks):
    """The ticks in Python."""

    def __init__(self, plan: Plan, schedule: Schedule, experiment: Experiment) -> None:
        self._plan, self._operations = plan, schedule.operations
        self._manipulations = Manipulations(plan, schedule, experiment.manipulators)

    def begin(self, recorder: Recorder) -> None:
        self._manipulations.begin()
        self.memory = self._manipulations.memory()
        self._losses = [Loss(m.gain, m.offset) for m in self._manipulations.data]
        self._calls = [_call(self._plan, operation, part) for operation, part in self._operations]
        self._read, self._decimate = recorder.read if recorder.names else None, recorder.decimate

    def run(self, first: int, last: int) -> None:
        for tick in range(first, last):
            self._advance(tick, self._plan.start + tick * self._plan.step)
            if self._read is not None and (tick + 1) % self._decimate == 0:
                self._read(tick + 1)

    def _advance(self, tick: int, time: float) -> None:
        self._manipulate(tick)
        try:
            for call in self._calls:
                call(tick, time)
        except PartError as error:
            error.time = time if error.time is None else error.time
            raise

    def _manipulate(self, tick: int) -> None:
        """Set gains and offsets for a tick."""
        plan = self._plan
        gains, offsets, signals = plan.gains, plan.offsets, plan.signals
        for m in self._manipulations.data:
            gains[m.input], offsets[m.input] = plan.wire_gains[m.input], plan.wire_offsets[m.input]
        all_of_them = (self._manipulations.data, self._manipulations.samples, self._manipulations.past, self._losses)
        for m, samples, past, loss in zip(*all_of_them, strict=True):
            active = m.first <= tick < m.last
            output = float(signals[plan.sources[m.input]])
            gain, offset = float(gains[m.input]), float(offsets[m.input])
            if m.kind == _LOSS:
                gain, offset = _lose(m, samples, past, loss, active, tick, output, gain, offset)
            if m.kind == _DELAY:
                past[tick % past.size] = output
            if active and m.kind == _BIAS:
                offset += m.value
            if active and m.kind == _NOISE and samples is not None:
                offset += m.value * float(samples[tick - m.first])
            if active and m.kind == _DELAY:
                gain, offset = 0.0, map_of(gain, offset, float(past[(tick + 1) % past.size]))
            if active and m.kind == _OVERRIDE:
                gain, offset = 0.0, m.value
            gains[m.input], offsets[m.input] = gain, offset

    def attributes(self) -> dict[str, str | float]:
        return {}

    def close(self) -> None:
        pass


def _lose(
    m: ctypes.Structure,
    samples: Values | None,
    past: Values,
    loss: Loss,
    active: bool,
    tick: int,
    output: float,
    gain: float,
    offset: float,
) -> tuple[float, float]:
    def asks(tick: int) -> bool:
        """Return whether the part at the end of the connection fetches its inputs at this tick."""
        return m.every == 1 or tick % m.every == m.phase

    if not loss.lost and (tick == 0 or asks(tick - 1)):
        loss.held = map_of(loss.gain, loss.offset, output if m.fresh else float(past[0]))
    past[0] = output
    if asks(tick):
        loss.lost = active and (samples is None or float(samples[tick - m.first]) < m.value)
        loss.gain, loss.offset = gain, offset
    return (0.0, loss.held) if loss.lost else (gain, offset)


def _call(plan: Plan, operation: int, part: int) -> Callable[[int, float], None]:
    """Return one operation as a function of tick and time."""
    every, phase, calls = int(plan.every[part]), int(plan.phase[part]), plan.calls[part]
    if operation == STEP:
        if every == 1:
            return lambda tick, time: calls.step(time, plan.step)
        return lambda tick, time: (
            calls.step(plan.time(tick - phase), every * plan.step) if tick % every == phase else None
        )
    action = fetcher(plan, part) if operation in (SET, RENEW) else calls.get
    return lambda tick, time: action() if every == 1 or tick % every == phase else None
