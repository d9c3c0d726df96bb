"""Model exchange in the importer of the tests: a method of Dormand and Prince, events found by bisection."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence

from reference_set.faulty_instance import FaultyInstance
from reference_set.input_lines import InputLines

Vector = list[float]

_C = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
_A: tuple[tuple[float, ...], ...] = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Coefficients of Dormand and Prince, J. Comput. Appl. Math. 6 (1980), and the difference of the two solutions."""

TOLERANCE = 1e-10
MOST_ITERATIONS = 100
MOST_STEPS = 20_000


class ExchangeSolver:
    """Integrates one FMU; `record` receives the time wherever a row of the results is due."""

    def __init__(
        self,
        instance: FaultyInstance,
        inputs: InputLines,
        start: float,
        record: Callable[[float], None],
        clocks: Collection[str] = (),
    ) -> None:
        """Handle the event of the initialisation."""
        fmu, self.instance, self.inputs, self.record, self.faults = (
            instance.fmu,
            instance,
            inputs,
            record,
            instance.faults,
        )
        self.t, self.ended, self.next = start, False, math.inf
        self._n, self._point, self._steps = len(fmu.derivatives), start, 0
        self._states = instance.vector("GetContinuousStates", self._n)
        self._rates = instance.vector(
            "GetContinuousStateDerivatives" if fmu.version == 3 else "GetDerivatives", self._n
        )
        self._indicators = instance.vector("GetEventIndicators", fmu.indicators)
        self._write = instance.writer(inputs.lines)
        self._ticks = {name: start for name in clocks}
        self._update([name for name in clocks if self._ticks[name] <= start])
        self.x = self._states() if self._n else []
        nominals = instance.vector("GetNominalsOfContinuousStates", self._n)() if self._n else []
        self._scale = [TOLERANCE * (abs(each) or 1.0) for each in nominals]
        self._z = self._indicators() if fmu.indicators else []
        self._h = math.inf
        self.record(start)

    # ---- events

    def _update(self, ticking: Sequence[str] = ()) -> None:
        """Iterate an event, and return to continuous time."""
        changed = False
        for _ in range(MOST_ITERATIONS):
            if ticking:
                self.instance.put(dict.fromkeys(ticking, True))
            made = self.instance.update()
            for name in ticking:
                self._ticks[name] = self._ticks[name] + self.instance.interval(name)
            ticking = ()
            changed |= made.changed
            self.next = math.inf if "missed-time-event" in self.faults else made.next
            if made.terminate and "terminated-ignored" not in self.faults:
                self.ended = True
                return
            if not made.again or "no-event-iteration" in self.faults:
                break
        else:
            raise RuntimeError(f"the event at {self.t} s does not end")
        self.instance.must("EnterContinuousTimeMode")
        if changed and self._n and "no-new-states-after-event" not in self.faults:
            self.x = self._states()

    def _event(self) -> None:
        self.instance.must("EnterEventMode")
        if "input-jump-without-event" not in self.faults:
            self.instance.put(self.inputs.at(self.t))
        self._update([name for name, t in self._ticks.items() if t <= self.t])
        if self.ended:
            return
        if self.instance.fmu.indicators:
            self._z = self._indicators()
        self._h = math.inf

    # ---- integration

    def _apply(self, t: float, x: Vector, left: bool) -> None:
        self.instance.set_time(t)
        if self._n:
            self.instance.set_states(x)
        if self.inputs.lines:
            held = "inputs-not-interpolated" in self.faults
            values = self.inputs.at(self._point) if held else self.inputs.at(t, left=left)
            self._write([values[name] for name in self.inputs.lines])

    def _derivatives(self, t: float, x: Vector, left: bool) -> Vector:
        self._apply(t, x, left)
        return self._rates()

    def _try(self, h: float, first: Vector) -> tuple[Vector, float]:
        """The states after a step, and its error relative to what is tolerated."""
        k = [first]
        for stage in range(1, 7):
            x = [x0 + h * sum(a * each[i] for a, each in zip(_A[stage], k, strict=True)) for i, x0 in enumerate(self.x)]
            k.append(self._derivatives(self.t + _C[stage] * h, x, True))
        error = 0.0
        for i, scale in enumerate(self._scale):
            e = h * sum(c * each[i] for c, each in zip(_ERROR, k, strict=True))
            error = max(error, abs(e) / (scale + TOLERANCE * max(abs(self.x[i]), abs(x[i]))))
        return x, error

    def _crossed(self, t: float, x: Vector) -> bool:
        self._apply(t, x, True)
        return any((a > 0.0) != (b > 0.0) for a, b in zip(self._z, self._indicators(), strict=True))

    def _step(self, stop: float) -> bool:
        """One step towards a time, up to the first state event; whether there is one."""
        first = self._derivatives(self.t, self.x, False) if self._n else []
        h, at_end = min(self._h, stop - self.t), False
        if not math.isfinite(self._h):
            h = min(h, 1e-3 * (stop - self.t) if self._n else h)
        while self._n:
            at_end = self.t + h >= stop * (1.0 - 1e-15)
            x, error = self._try(h, first)
            if error <= 1.0 or h < 1e-13 * max(1.0, abs(self.t)):
                self._h = h * min(5.0, 0.9 * max(error, 1e-6) ** -0.2)
                break
            h *= max(0.2, 0.9 * error**-0.2)
        else:
            x, at_end = [], True
        end = stop if at_end else self.t + h
        watched = self.instance.fmu.indicators and not self.faults & {
            "missed-state-event",
            "state-event-at-end-of-step",
        }
        if not watched or not self._crossed(end, x):
            self._accept(end, x)
            return False
        low, high = 0.0, end - self.t
        while high - low > 4e-16 * max(abs(self.t), high):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            tried = self._try(middle, first)[0] if self._n else []
            if self._crossed(self.t + middle, tried):
                high = middle
            else:
                low = middle
        self._accept(self.t + high, self._try(high, first)[0] if self._n else [])
        return True

    def _accept(self, t: float, x: Vector) -> None:
        self.t, self.x = t, x
        self._apply(t, x, True)

    def run(self, point: float) -> None:
        """Integrate to a communication point, with rows before and after an event there."""
        late = self.faults & {"time-event-at-end-of-step"}
        jumps = self.inputs.jumps()
        stops = self.inputs.kinks()
        while self.t < point and not self.ended:
            self._steps += 1
            if self._steps > MOST_STEPS:
                raise RuntimeError(f"there are more than {MOST_STEPS} steps and events up to {self.t} s")
            event_at = max(self.next, point) if late else self.next
            ticks = min(self._ticks.values(), default=math.inf)
            kink = next((t for t in stops if t > self.t), math.inf)
            stop = min(point, event_at, ticks, kink)
            found = self._step(stop) if stop > self.t else False
            silent = "no-completed-integrator-step" in self.faults
            asked, ends = (False, False) if silent else self.instance.completed()
            if ends and "terminated-ignored" not in self.faults:
                self.ended = True
            jumped = self.t in jumps and "input-jump-without-event" not in self.faults
            if "state-event-at-end-of-step" in self.faults and self.t == point and self.instance.fmu.indicators:
                found = self._crossed(self.t, self.x)
            if self.t == point or self.ended:
                self.record(self.t)
            if not self.ended and (found or asked or jumped or self.t >= event_at or self.t >= ticks):
                self._event()
                if self.t == point or self.ended:
                    self.record(self.t)
        self._point = point
