"""A mass and its friction in one integration by fmpy's CVode: stick-slip, whose closed forms the solver has to meet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import POINTER, c_double
from itertools import pairwise
from math import atan, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model
from fmpy.simulation import instantiate_fmu
from fmpy.sundials import CVodeSolver
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = POINTER(c_double)
MOST_AT_A_TIME = 3


class _Part:
    """One FMU in model exchange, with its variables by name."""

    def __init__(self, fmu: Path, start: Mapping[str, float]) -> None:
        folder = fmu.with_suffix(".coupled")
        if not folder.is_dir():
            extract(str(fmu), str(folder))
        self.description = read_model_description(str(folder))
        self.fmu: FMU2Model = instantiate_fmu(str(folder), self.description, fmi_type="ModelExchange")
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.states = int(self.description.numberOfContinuousStates)
        self.indicators = int(self.description.numberOfEventIndicators)
        self.fmu.setupExperiment(startTime=0.0)
        self.set(start)
        self.fmu.enterInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, name: str) -> float:
        return float(self.fmu.getReal([self.references[name]])[0])


class Pair:
    """Mass -> friction -> mass, integrated together."""

    def __init__(self, mass: _Part, friction: _Part, tolerance: float) -> None:
        self.mass, self.friction = mass, friction
        self.parts = (mass, friction)
        self.t = 0.0
        self.events: list[float] = []
        self._connect()
        for part in self.parts:
            part.fmu.exitInitializationMode()
        self._iterate()
        self.solver = CVodeSolver(
            nx=sum(part.states for part in self.parts),
            nz=sum(part.indicators for part in self.parts),
            get_x=self._gather("getContinuousStates", "states"),
            set_x=self._set_states,
            get_dx=self._gather("getDerivatives", "states"),
            get_z=self._gather("getEventIndicators", "indicators"),
            get_nominals=self._gather("getNominalsOfContinuousStates", "states"),
            set_time=self._set_time,
            input=self,
            startTime=0.0,
            relativeTolerance=tolerance,
            maxNumSteps=100_000,
        )

    def _connect(self) -> None:
        driven = {"v": self.mass.get("v")}
        if "F_ext" in self.friction.references:
            driven["F_ext"] = self.mass.get("F_ext")
        self.friction.set(driven)
        self.mass.set({"F_friction": self.friction.get("F")})

    def apply(self, _: float) -> None:
        """What fmpy's solver calls before it sets states: nothing to do."""

    def _set_time(self, t: float) -> None:
        for part in self.parts:
            part.fmu.setTime(t)

    def _set_states(self, x: Any, n: int) -> None:
        values, first = np.ctypeslib.as_array(x, (n,)), 0
        for part in self.parts:
            own = np.ascontiguousarray(values[first : first + part.states])
            part.fmu.setContinuousStates(own.ctypes.data_as(Numbers), part.states)
            first += part.states
        self._connect()

    def _gather(self, function: str, count: str) -> Callable[[Any, int], None]:
        def gather(result: Any, n: int) -> None:
            values, first = np.ctypeslib.as_array(result, (n,)), 0
            for part in self.parts:
                own = np.zeros(getattr(part, count))
                getattr(part.fmu, function)(own.ctypes.data_as(Numbers), len(own))
                values[first : first + len(own)] = own
                first += len(own)

        return gather

    def _iterate(self) -> None:
        for part in self.parts:
            assert not part.fmu.newDiscreteStates()[0], "one iteration is enough"
        self._connect()
        for part in self.parts:
            part.fmu.enterContinuousTimeMode()

    def run(self, until: float, see: Callable[[], None] | None = None, step: float = 0.01) -> None:
        """Integrate to a time; `see` is called at each step and event."""
        repeated = 0
        while self.t < until - 1e-12:
            found, _, reached = self.solver.step(self.t, min(until, self.t + step))
            repeated = repeated + 1 if found and reached - self.t < 1e-12 else 0
            assert repeated < MOST_AT_A_TIME, f"events repeat at {self.t} s"
            self.t = reached
            self._set_time(self.t)
            if found:
                self.events.append(self.t)
                for part in self.parts:
                    part.fmu.enterEventMode()
                self._iterate()
                self.solver.reset(self.t)
            if see:
                see()


@pytest.fixture
def couple(build_fmu: Callable[..., Path]) -> Callable[..., Pair]:
    def make(friction: str, mass: Mapping[str, float], contact: Mapping[str, float], tolerance: float = 1e-11) -> Pair:
        return Pair(_Part(build_fmu("Mass"), mass), _Part(build_fmu(friction), contact), tolerance)

    return make


def crossings(pair: Pair, until: float, level: float) -> list[float]:
    """The times at which v rises through `level`, by a cubic through the ends of each step of 1 ms."""
    seen: list[tuple[float, float, float]] = []
    pair.run(until, lambda: seen.append((pair.t, pair.mass.get("v"), pair.mass.get("a"))), step=1e-3)
    times = []
    for (t0, v0, a0), (t1, v1, a1) in pairwise(seen):
        if v0 < level <= v1 and t1 > t0:
            h = t1 - t0
            cubic = np.polynomial.Polynomial(
                [v0 - level, a0 * h, 3 * (v1 - v0) - h * (2 * a0 + a1), 2 * (v0 - v1) + h * (a0 + a1)]
            )
            (root,) = [r.real for r in cubic.roots() if abs(r.imag) < 1e-9 and -1e-9 <= r.real <= 1 + 1e-9]
            times.append(t0 + h * root)
    return times


def test_stick_slip_over_lugre(couple: Callable[..., Pair]) -> None:
    """Benchmark B5: Canudas de Wit and others 1995, figure 6, reference confirmed with MuJoCo."""
    pair = couple("LuGre", {"m": 1.0, "k": 2.0, "v_support": 0.1}, {})
    slips = crossings(pair, 20.5, 0.05)
    assert slips[0] == pytest.approx(7.540397, abs=1e-6)
    assert slips[2] - slips[1] == pytest.approx(6.36271982, rel=1e-7)
    assert pair.events == []


def test_stick_slip_with_a_drop_of_friction(couple: Callable[..., Pair]) -> None:
    """Benchmark B13, closed form: m = 1 kg, k = 2 N/m, Fs = 1.5 N, Fc = 1 N, pulled at 0.1 m/s."""
    m, k, V, drop = 1.0, 2.0, 0.1, 0.5
    w = sqrt(k / m)
    period = 2 * drop / (k * V) + (2 * pi - 2 * atan(drop * w / (k * V))) / w
    pair = couple("Stiction", {"m": m, "k": k, "v_support": V}, {"Fs": 1.5, "Fc": 1.0, "Fv": 0.0})
    slips = crossings(pair, 31.0, 0.05)
    assert np.diff(slips) == pytest.approx(period, rel=1e-9)
    assert len(pair.events) <= 4 * len(slips)  # it sticks, breaks away, leaves rest, and the flag changes


def test_decay_of_an_oscillator(couple: Callable[..., Pair]) -> None:
    """Benchmark B12, closed form: 4 Fc / k a cycle, at rest at 0.05 m after 7 half cycles."""
    pair = couple("Coulomb", {"m": 1.0, "k": 4.0, "x0": 1.0}, {"Fc": 0.3}, 1e-12)
    pair.run(pi)
    assert pair.mass.get("x") == pytest.approx(0.7, abs=1e-9)
    pair.run(12.0)
    assert pair.mass.get("x") == pytest.approx(0.05, abs=1e-9)
    at_rest = len(pair.events)
    pair.run(1e6, step=1e5)
    assert len(pair.events) == at_rest
    # the solver stops the mass to 1e-14 m/s, and nothing but friction could stop the rest
    assert pair.mass.get("x") == pytest.approx(0.05, abs=1e-7)


@pytest.mark.parametrize("friction", ["GMS", "Leuven", "ModifiedLeuven", "ElastoPlastic", "MaxwellSlip"])
def test_a_pulled_mass_comes_to_rest(friction: str, couple: Callable[..., Pair]) -> None:
    """At rest in presliding, its oscillation decays or goes on, with two events a cycle at most for each element."""
    pair = couple(friction, {"m": 1.0, "k": 2.0, "d": 2.0, "F_drive": 0.4}, {}, 1e-9)
    pair.run(0.5, step=1e-3)
    assert len(pair.events) < 20 * 0.5 * sqrt(1e5) / pi
    assert 0.0 < pair.mass.get("x") < 1e-4
