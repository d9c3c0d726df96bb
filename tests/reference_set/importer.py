"""An importer of FMUs and SSPs in the tests: right, or with planted faults.

``python tests/reference_set/importer.py CASE OUTPUT [FAULT ...]`` runs one case of a built set.
"""

from __future__ import annotations

import csv
import math
import shutil
import sys
import tempfile
from collections.abc import Callable, Collection, Mapping, Sequence
from ctypes import c_void_p
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from reference_set.exchange_solver import ExchangeSolver
from reference_set.faulty_instance import FaultyInstance
from reference_set.input_lines import InputLines
from reference_set.raw_fmu import DISCARD, WARNING, RawFmu, RefusedError
from reference_set.ssp_reader import SspReader

from friction_fmus.reference.case import ReferenceCase, read_case, run_calls

Rows = list[list[Any]]
MOST_PASSES = 50


def points(case: ReferenceCase, faults: Collection[str] = ()) -> list[float]:
    """Communication points."""
    start, stop, step = case.experiment.start, case.experiment.stop, case.experiment.step
    if "start-time-zero" in faults:
        start = 0.0
    whole = math.floor((stop - start) / step * (1.0 + 1e-12))
    found = [start + k * step for k in range(whole + 1)]
    if "time-accumulates-by-addition" in faults:
        found = list(accumulate([start, *[step] * whole]))
    if stop - found[-1] > 1e-9 * step and "last-partial-step-skipped" not in faults:
        found.append(found[-1] + step if "stop-time-overrun" in faults else stop)
    return found


class Importer:
    """Runs one case."""

    def __init__(self, case: ReferenceCase, faults: Collection[str] = ()) -> None:
        """Unpack nothing yet."""
        self.case, self.faults = case, frozenset(faults)
        self.rows: Rows = []
        self._folder = Path(tempfile.mkdtemp(prefix="importer"))
        self._instances: list[FaultyInstance] = []

    def run(self) -> Rows:
        """The rows of the results: time and outputs."""
        try:
            if self.case.kind == "ssp":
                self._system()
            elif self.case.call:
                self._calls()
            elif self.case.kind == "me":
                self._exchange()
            else:
                self._simulation()
        finally:
            for instance in self._instances:
                instance.free()
            shutil.rmtree(self._folder)
        return self.rows

    def _instance(self, fmu: RawFmu, name: str, kind: str, events: bool = False) -> FaultyInstance:
        made = FaultyInstance(fmu, kind, name, self.faults, events=events)
        self._instances.append(made)
        return made

    def _open(self) -> tuple[RawFmu, InputLines]:
        fmu = RawFmu(self.case.file, self._folder / "fmu")
        path = self.case.folder / "inputs.csv" if self.case.inputs else None
        return fmu, InputLines(
            path, {v.name: v.is_float and v.variability == "continuous" for v in fmu.variables.values()}
        )

    @property
    def _start(self) -> float:
        return 0.0 if "start-time-zero" in self.faults else self.case.experiment.start

    def _initialise(self, instance: FaultyInstance, inputs: InputLines) -> None:
        times = self.case.experiment
        at = inputs.at(self._start, left=False)
        late = "get-before-set" in self.faults or "inputs-after-step" in self.faults
        instance.start(self.case.start, {} if late else at, self._start, times.stop, times.tolerance)

    # ---- co-simulation

    def _simulation(self) -> None:
        fmu, inputs = self._open()
        events = "event-mode" in self.case.needs
        instance = self._instance(fmu, "instance", "cs", events)
        self._initialise(instance, inputs)
        run = _Simulation(instance, inputs, self._start, self.faults)
        read = instance.reader(self.case.outputs) if not self.faults else lambda: instance.get(self.case.outputs)
        times = points(self.case, self.faults)
        self.rows.append([times[0], *read()])
        lines = fmu.flag("cs", "canInterpolateInputs") == "true" and "inputs-not-interpolated" not in self.faults
        before = times[0]
        for t, end in pairwise(times):
            at = before if "inputs-held-one-step-late" in self.faults else t
            if "inputs-after-step" not in self.faults:
                run.apply(at, lines)
            for reached in run.advance(t, end):
                self.rows.append([reached, *read()])
            if run.ended:
                break
            if "inputs-after-step" in self.faults:
                run.apply(t, False)
            before = t
        if not run.ended:
            instance.must("Terminate")

    # ---- model exchange

    def _exchange(self) -> None:
        fmu, inputs = self._open()
        instance = self._instance(fmu, "instance", "me")
        self._initialise(instance, inputs)
        clocks = [v.name for v in fmu.variables.values() if v.type == "Clock" and v.causality == "input"]

        def record(t: float) -> None:
            self.rows.append([t, *instance.get(self.case.outputs)])

        solver = ExchangeSolver(instance, inputs, self._start, record, clocks)
        for point in points(self.case, self.faults)[1:]:
            if not solver.ended:
                solver.run(point)
        if not solver.ended:
            instance.must("Terminate")

    # ---- calls

    def _calls(self) -> None:
        fmu, _ = self._open()

        def make(name: str) -> CaseInstance:
            if "second-instance-aliases-first" in self.faults and self._instances:
                return first[0]
            made = CaseInstance(self.case, self._instance(fmu, name, self.case.kind), len(self._instances) > 1)
            first.append(made)
            return made

        first: list[CaseInstance] = []
        self.rows = run_calls(self.case, make)

    # ---- systems

    def _system(self) -> None:
        system = _System(SspReader(self.case.file, self._folder, self.faults), self._instance, self.faults)
        times = points(self.case, self.faults)
        system.start(self._start, self.case.experiment.stop, self.case.experiment.tolerance)
        self.rows.append([times[0], *system.get(self.case.outputs)])
        for t, end in pairwise(times):
            system.step(t, end)
            self.rows.append([end, *system.get(self.case.outputs)])
        for instance in self._instances:
            instance.must("Terminate")


class _Simulation:
    """Steps of one FMU from communication point to communication point, with its events."""

    def __init__(self, instance: FaultyInstance, inputs: InputLines, start: float, faults: frozenset[str]) -> None:
        self.instance, self.inputs, self.faults, self.ended = instance, inputs, faults, False
        self._next = math.inf
        fmu = instance.fmu
        clocks = [v.name for v in fmu.variables.values() if v.type == "Clock" and v.causality == "input"]
        self._ticks = dict.fromkeys(clocks if instance.events else (), start)
        self._step = instance.stepper() if not faults else instance.step
        self._write = instance.writer(inputs.lines)
        if instance.events:
            self._event(start, entered=True)

    def apply(self, t: float, lines: bool) -> None:
        """Set the inputs of a time, and their slopes."""
        if not self.inputs.times:
            return
        self.instance.put(self.inputs.at(t))
        if lines and self.inputs.lines and self.instance.version == 2:
            slopes = self.inputs.slopes(t)
            status = self.instance.slopes(self.inputs.lines, [slopes[name] for name in self.inputs.lines])
            if status > WARNING:
                raise RefusedError("SetRealInputDerivatives", status, self.instance.log)

    def advance(self, t: float, end: float) -> list[float]:
        """Reach the next communication point, and say for which times rows are due."""
        if not self.instance.events:
            return [self._without_events(t, end)]
        while t < end and not self.ended:
            late = "time-event-at-end-of-step" in self.faults
            event = math.inf if "missed-time-event" in self.faults else self._next
            until = end if late else min(end, event, *self._ticks.values())
            if "early-return-ignored" in self.faults:
                self._judge(self.instance.step(t, end - t).status)
                return [end]
            made = self.instance.step(t, until - t)
            self._judge(made.status)
            t = made.time
            if made.terminate and "terminated-ignored" not in self.faults:
                self.ended = True
                return [t]
            if made.event or t >= event or any(t >= tick for tick in self._ticks.values()):
                self._event(t)
        return [t]

    def _without_events(self, t: float, end: float) -> float:
        size = end - t
        while t < end and not self.ended:
            made = self._step(t, min(size, end - t))
            if made.status == DISCARD and "discard-ignored" not in self.faults:
                if made.terminate and "terminated-ignored" not in self.faults:
                    self.ended = True
                elif made.time <= t:
                    size *= 0.5
                    if size < 1e-6 * (end - t):
                        raise RefusedError("DoStep", made.status, self.instance.log)
                t = made.time
                continue
            self._judge(made.status)
            t = made.time if made.early and "early-return-ignored" not in self.faults else min(t + size, end)
            if made.terminate and "terminated-ignored" not in self.faults:
                self.ended = True
        return t

    def _judge(self, status: int) -> None:
        if status == DISCARD and "discard-ignored" in self.faults:
            return
        if status > WARNING and "error-ignored" not in self.faults:
            raise RefusedError("DoStep", status, self.instance.log)

    def _event(self, t: float, *, entered: bool = False) -> None:
        if not entered:
            self.instance.must("EnterEventMode")
            if self.inputs.times:
                self.instance.put(self.inputs.at(t))
        ticking = [name for name, at in self._ticks.items() if at <= t * (1.0 + 1e-15)]
        if ticking:
            self.instance.put(dict.fromkeys(ticking, True))
        for _ in range(MOST_PASSES):
            made = self.instance.update()
            for name in ticking:
                self._ticks[name] += self.instance.interval(name)
            ticking = []
            self._next = made.next
            self.ended |= made.terminate and "terminated-ignored" not in self.faults
            if not made.again or self.ended or "no-event-iteration" in self.faults:
                break
        if not self.ended:
            self.instance.must("EnterStepMode")


class CaseInstance:
    """What `run_calls` calls."""

    def __init__(self, case: ReferenceCase, instance: FaultyInstance, second: bool) -> None:
        """Nothing is called yet."""
        self.time = case.experiment.start
        self._case, self._instance, self._faults = case, instance, instance.faults
        self._times: dict[int, float] = {}
        self._second = second

    def start(self, values: Mapping[str, Any]) -> None:
        """Set start values and initialise."""
        times = self._case.experiment
        if self._second and "parameters-of-first-instance-only" in self._faults:
            values = {}
        self.time = 0.0 if "start-time-zero" in self._faults else times.start
        self._instance.start(values, {}, self.time, None, times.tolerance)

    def set(self, values: Mapping[str, Any]) -> None:
        """Set values."""
        self._instance.put(values)

    def get(self, names: Sequence[str]) -> list[Any]:
        """Values."""
        found: list[Any] = self._instance.get(names)
        return found

    def step(self, size: float) -> None:
        """One step."""
        made = self._instance.step(self.time, size)
        if made.status > WARNING:
            ignored = "discard-ignored" if made.status == DISCARD else "error-ignored"
            if ignored not in self._faults:
                self.time = made.time if made.status == DISCARD else self.time
                raise RefusedError("DoStep", made.status, self._instance.log)
        self.time = made.time if made.early and "early-return-ignored" not in self._faults else self.time + size

    def save(self) -> c_void_p:
        """A saved state."""
        state: c_void_p = self._instance.save()
        self._times[id(state)] = self.time
        return state

    def restore(self, state: Any) -> None:
        """Restore a saved state."""
        self._instance.restore(state)
        if "state-without-time" not in self._faults:
            self.time = self._times[id(state)]

    def serialise(self) -> tuple[bytes, float]:
        """The bytes of the state of now, with its time."""
        return self._instance.serialise(self._instance.save()), self.time

    def deserialise(self, data: tuple[bytes, float]) -> None:
        """Restore a state from bytes."""
        state = self._instance.deserialise(data[0])
        self._instance.keep(state)
        self._instance.restore(state)
        if "state-without-time" not in self._faults:
            self.time = data[1]

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Directional derivatives."""
        return self._instance.directional(unknowns, knowns, seed)

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """Adjoint derivatives."""
        return self._instance.adjoint(unknowns, knowns, seed)

    def reset(self) -> None:
        """Reset."""
        self._instance.reset()

    def terminate(self) -> None:
        """Terminate."""
        self._instance.must("Terminate")


class _System:
    """Components that step together; at each communication point their inputs agree with the outputs."""

    def __init__(self, reader: SspReader, instantiate: Callable[..., FaultyInstance], faults: frozenset[str]) -> None:
        self.reader, self.faults = reader, faults
        self.parts: dict[str, FaultyInstance] = {}
        first: dict[str, str] = {}
        self._renamed: set[str] = set()
        for name, component in reader.components.items():
            owner = first.setdefault(component.source, name)
            if owner != name and "second-instance-aliases-first" in faults:
                self.parts[name] = self.parts[owner]
            else:
                self.parts[name] = instantiate(component.fmu, name, "cs")
            if owner != name:
                self._renamed.add(name)
        self._old: list[Any] | None = None

    def start(self, start: float, stop: float, tolerance: float) -> None:
        """Initialise all."""
        late = "start-values-after-initialisation" in self.faults
        for name, component in self.reader.components.items():
            aliased = name in self._renamed and "second-instance-aliases-first" in self.faults
            if aliased:
                continue
            values = component.start
            if name in self._renamed and "parameters-of-first-instance-only" in self.faults:
                values = {}
            part = self.parts[name]
            if "start-values-ignored" not in self.faults and not late:
                part.put(values)
            part.enter_initialization(start, stop, tolerance)
        if "get-before-set" not in self.faults:
            self._exchange()
        for part in dict.fromkeys(self.parts.values()):
            part.must("ExitInitializationMode")
        for name, component in self.reader.components.items():
            if late:
                self.parts[name].set(component.start)

    def get(self, names: Sequence[str]) -> list[Any]:
        """Values of variables of components."""
        found = []
        for name in names:
            part, variable = self._place(name)
            found += self.parts[part].get([variable])
        return found

    def _place(self, name: str) -> tuple[str, str]:
        part = max((each for each in self.parts if name.startswith(f"{each}.")), key=len)
        return part, name.removeprefix(f"{part}.")

    def _outputs(self) -> list[Any]:
        """The values that the connections carry, converted."""
        found = []
        for link in self.reader.links:
            (value,) = self.parts[link.source[0]].get([link.source[1]])
            plain = not isinstance(value, float) or (link.gain, link.shift) == (1.0, 0.0)
            found.append(value if plain else link.gain * value + link.shift)
        return found

    def _set(self, values: Sequence[Any]) -> None:
        for link, value in zip(self.reader.links, values, strict=True):
            self.parts[link.target[0]].put({link.target[1]: value})

    def _exchange(self) -> None:
        """Set the inputs so that they agree with the outputs."""
        values = self._outputs()
        if "connection-delayed-one-step" in self.faults:
            delayed, self._old = self._old, values
            if delayed is not None:
                self._set(delayed)
            return
        for _ in range(1 if self.faults & {"algebraic-loop-one-pass", "get-before-set"} else len(values) + 1):
            self._set(values)
            again = self._outputs()
            if again == values:
                return
            values = again
        if not self.faults & {"algebraic-loop-one-pass", "get-before-set"}:
            self._solve(values)

    def _solve(self, values: list[Any]) -> None:
        """Newton's method for the inputs of an algebraic loop; the loops of the cases are smooth."""
        loop = [i for i, value in enumerate(values) if isinstance(value, float)]
        w = np.array([values[i] for i in loop])

        def residual(at: np.ndarray) -> np.ndarray:
            trial = list(values)
            for place, i in enumerate(loop):
                trial[i] = float(at[place])
            self._set(trial)
            found = self._outputs()
            return np.array([found[i] for i in loop]) - at

        for _ in range(MOST_PASSES):
            r = residual(w)
            if np.abs(r).max() <= 1e-14 * (1.0 + np.abs(w).max()):
                return
            jacobian = np.empty((len(w), len(w)))
            for j in range(len(w)):
                d = 1e-4 * max(1.0, abs(w[j]))
                moved = w.copy()
                moved[j] += d
                back = w.copy()
                back[j] -= d
                jacobian[:, j] = (residual(moved) - residual(back)) / (2.0 * d)
            w = w - np.linalg.solve(jacobian, r)
        raise RuntimeError("the algebraic loop has no solution")

    def step(self, t: float, end: float) -> None:
        """A communication step of all, with the inputs held."""
        self._exchange()
        for part in dict.fromkeys(self.parts.values()):
            made = part.step(t, end - t)
            if made.status > WARNING and not (made.status == DISCARD and "discard-ignored" in self.faults):
                raise RefusedError("DoStep", made.status, part.log)
        if "get-before-set" not in self.faults and "connection-delayed-one-step" not in self.faults:
            self._exchange()


def write(case: ReferenceCase, rows: Rows, path: Path) -> None:
    """Write rows as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["time", *case.outputs], *rows])


if __name__ == "__main__":
    chosen = read_case(Path(sys.argv[1]))
    write(chosen, Importer(chosen, sys.argv[3:]).run(), Path(sys.argv[2]))
