"""Model exchange by fmpy's CVode, and co-simulation of the same FMU: two independent computations."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double, c_void_p
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.simulation import instantiate_fmu
from fmpy.sundials import CVodeSolver
from fmpy.sundials.libraries import sundials_cvode
from lxml import etree
from numpy.typing import NDArray

Array = NDArray[np.float64]
Inputs = Callable[[float], Mapping[str, float]]

MOST_ITERATIONS = 3
MOST_EVENTS_AT_A_TIME = 3


class _Inputs:
    """What fmpy's solver calls before it reads event indicators."""

    def __init__(self, fmu: Any, references: Sequence[int], inputs: Callable[[float], Sequence[float]]) -> None:
        self._fmu, self._references, self._inputs = fmu, references, inputs

    def apply(self, t: float) -> None:
        self._fmu.setReal(self._references, self._inputs(t))


def _begin(fmu: Any, start: float, values: Mapping[int, float], references: Sequence[int], u: Sequence[float]) -> None:
    fmu.setupExperiment(startTime=start)
    if values:
        fmu.setReal(list(values), list(values.values()))
    fmu.enterInitializationMode()
    fmu.setReal(references, u)
    fmu.exitInitializationMode()


class Exchange:
    """One FMU with inputs that are lines between nodes."""

    def __init__(
        self, folder: Path, nodes: Array, lines: Mapping[str, Array], start_values: Mapping[str, float]
    ) -> None:
        self.description = read_model_description(str(folder))
        self.folder = folder
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.types = {v.name: v.type for v in self.description.modelVariables}
        self.nodes = nodes
        self.inputs = [self.references[name] for name in lines]
        self.lines = np.array(list(lines.values())).reshape(len(lines), len(nodes))
        slopes = np.diff(self.lines, append=self.lines[:, -1:]) / np.diff(nodes, append=np.inf)
        self._times = nodes.tolist()
        self._pieces = np.stack([self.lines, slopes], axis=-1).transpose(1, 0, 2).tolist()
        reals = etree.parse(Path(folder) / "modelDescription.xml").iterfind("ModelVariables/ScalarVariable/Real")
        self.reinitialised = [real.getparent().get("name") for real in reals if real.get("reinit") == "true"]
        self.jumps = 0
        self.start = {self.references[name]: value for name, value in start_values.items()}

    def read(self, fmu: Any, names: Sequence[str]) -> list[float]:
        """Values of variables of any type."""
        return [float(self._getters[self.types[name]](fmu, [self.references[name]])[0]) for name in names]

    _getters: ClassVar[Mapping[str, Callable[[Any, list[int]], list[Any]]]] = {
        "Real": lambda fmu, references: fmu.getReal(references),
        "Integer": lambda fmu, references: fmu.getInteger(references),
        "Boolean": lambda fmu, references: fmu.getBoolean(references),
    }

    def holds(self) -> set[float]:
        """The nodes at which an input begins or ends to be exactly 0."""
        rests = self.lines == 0.0
        begins = ~rests[:, :-2] & rests[:, 1:-1] & rests[:, 2:]
        ends = rests[:, :-2] & rests[:, 1:-1] & ~rests[:, 2:]
        return set(map(float, self.nodes[1:-1][(begins | ends).any(axis=0)]))

    def at(self, t: float) -> list[float]:
        """The lines at a time; `np.interp` for each of them would take a third of the time of a run."""
        k = max(bisect_right(self._times, t) - 1, 0)
        return [value + slope * (t - self._times[k]) for value, slope in self._pieces[k]]

    def _instance(self, kind: str) -> Any:
        return instantiate_fmu(str(self.folder), self.description, fmi_type=kind)

    def co_simulation(self, outputs: Sequence[str], more: Sequence[float] = ()) -> Array:
        """Outputs at the nodes and `more` times, each step with the lines as input derivatives."""
        fmu: FMU2Slave = self._instance("CoSimulation")
        _begin(fmu, float(self.nodes[0]), self.start, self.inputs, self.at(float(self.nodes[0])))
        times = np.union1d(self.nodes, more)
        rows = [self.read(fmu, outputs)]
        for t, until in pairwise(times):
            k = int(np.searchsorted(self.nodes, t, side="right")) - 1
            slopes = (self.lines[:, k + 1] - self.lines[:, k]) / (self.nodes[k + 1] - self.nodes[k])
            fmu.setReal(self.inputs, self.at(float(t)))
            fmu.setRealInputDerivatives(self.inputs, [1] * len(self.inputs), slopes.tolist())
            fmu.doStep(float(t), float(until - t))
            fmu.setReal(self.inputs, self.at(float(until)))
            rows.append(self.read(fmu, outputs))
        fmu.terminate()
        fmu.freeInstance()
        return np.array(rows)

    def model_exchange(
        self, outputs: Sequence[str], tolerance: float = 1e-9, step: float | None = 1e-3
    ) -> tuple[Array, list[float]]:
        """Outputs at the nodes, and the times of the events, with a largest step; fails if events repeat."""
        fmu: FMU2Model = self._instance("ModelExchange")
        t = float(self.nodes[0])
        _begin(fmu, t, self.start, self.inputs, self.at(t))
        next_event = self._event(fmu)
        inputs = _Inputs(fmu, self.inputs, self.at)

        def set_time(at: float) -> None:
            fmu.setTime(at)
            inputs.apply(at)

        solver = CVodeSolver(
            nx=self.description.numberOfContinuousStates,
            nz=self.description.numberOfEventIndicators,
            get_x=fmu.getContinuousStates,
            set_x=fmu.setContinuousStates,
            get_dx=fmu.getDerivatives,
            get_z=fmu.getEventIndicators,
            get_nominals=fmu.getNominalsOfContinuousStates,
            set_time=set_time,
            input=inputs,
            startTime=t,
            relativeTolerance=tolerance,
            maxStep=step or float("inf"),
            maxNumSteps=100_000,
        )
        holds = self.holds()  # where the solver stops, as its polynomials do not see a kink
        rows, events, repeated = [self.read(fmu, outputs)], [], 0
        for node in map(float, self.nodes[1:]):
            while t < node:
                until = min(node, next_event)
                stop = min((at for at in holds if at > t), default=self.nodes[-1] + 1.0)
                sundials_cvode.CVodeSetStopTime(c_void_p(solver.cvode_mem), c_double(stop))
                found, _, reached = solver.step(t, until) if until > t else (False, None, until)
                repeated = repeated + 1 if found and reached <= t else 0
                assert repeated < MOST_EVENTS_AT_A_TIME, f"events repeat at {t} s"
                t = reached
                set_time(t)
                fmu.completedIntegratorStep()
                if found or t >= next_event:
                    events.append(t)
                    fmu.enterEventMode()
                    next_event = self._event(fmu)
                    solver.reset(t)
            if node in holds:
                solver.reset(t)
            rows.append(self.read(fmu, outputs))
        fmu.terminate()
        fmu.freeInstance()
        return np.array(rows), events

    def _event(self, fmu: FMU2Model) -> float:
        """Iterate the event, and return the next time event; count the events that change a state."""
        for _ in range(MOST_ITERATIONS):
            again, terminate, _, jumped, defined, at = fmu.newDiscreteStates()
            assert not terminate
            assert not jumped or self.reinitialised, "an event changes a state, but none is marked with reinit"
            self.jumps += jumped
            if not again:
                fmu.enterContinuousTimeMode()
                return float(at) if defined else float("inf")
        raise AssertionError("the event iteration does not end")
