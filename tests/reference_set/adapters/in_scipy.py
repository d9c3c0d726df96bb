"""A loop of SciPy's `solve_ivp` (LSODA) over the functions of fmpy, with events by its root finder: model exchange."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import fmpy
import numpy as np
from adapter import AdaptedCase, Rows, main
from fmpy.simulation import apply_start_values, instantiate_fmu, settable_in_instantiated
from scipy.integrate import solve_ivp

LACKS = ("call", "cs", "ssp")
TYPES = {"Real": "Real", "Float64": "Float64", "Enumeration": "Integer"}


def run(case: AdaptedCase) -> Rows:
    """Rows of the results."""
    folder = fmpy.extract(str(case.file))
    try:
        return list(integrated(case, folder))
    finally:
        shutil.rmtree(folder)


def root(indicators: Callable[[float, np.ndarray], np.ndarray], i: int, above: bool) -> Any:
    """The i-th indicator as an event of `solve_ivp` that is passed in one direction; 0 counts as below."""

    def value(t: float, x: np.ndarray) -> float:
        return float(indicators(t, x)[i]) - (0.0 if above else 1e-14)

    value.terminal, value.direction = True, -1.0 if above else 1.0  # type: ignore[attr-defined]
    return value


def integrated(case: AdaptedCase, folder: str) -> Rows:
    """Integrate from event to event."""
    said = fmpy.read_model_description(folder)
    fmu: Any = instantiate_fmu(folder, said, "ModelExchange")
    variables = {v.name: v for v in said.modelVariables}
    inputs, times = case.inputs(), case.times()
    three = said.fmiVersion.startswith("3")
    setup: dict[str, Any] = {"startTime": case.start, "stopTime": case.stop}
    if not three:
        fmu.setupExperiment(**setup)
    apply_start_values(fmu, said, dict(case.values), settable_in_instantiated)
    fmu.enterInitializationMode(**(setup if three else {}))

    def put(values: dict[str, Any]) -> None:
        for name, value in values.items():
            kind = variables[name].type
            typed = {"Integer": int, "Enumeration": int, "Boolean": bool}.get(kind, float)(value)
            getattr(fmu, f"set{TYPES.get(kind, kind)}")([variables[name].valueReference], [typed])

    def get(name: str) -> Any:
        kind = variables[name].type
        return getattr(fmu, f"get{TYPES.get(kind, kind)}")([variables[name].valueReference])[0]

    put(inputs.at(case.start))
    fmu.exitInitializationMode()
    n, m = said.numberOfContinuousStates, said.numberOfEventIndicators
    x, dx, z = np.zeros(n), np.zeros(n), np.zeros(m)
    address = {id(a): a.ctypes.data_as(fmpy.fmi2.POINTER(fmpy.fmi2.c_double)) for a in (x, dx, z)}

    def states() -> np.ndarray:
        if n:
            fmu.getContinuousStates(address[id(x)], n)
        return x.copy()

    def place(t: float, at: np.ndarray) -> None:
        fmu.setTime(t)
        if n:
            x[:] = at
            fmu.setContinuousStates(address[id(x)], n)
        values = inputs.at(t, left=True)
        put({name: values[name] for name in inputs.lines})

    def rates(t: float, at: np.ndarray) -> np.ndarray:
        place(t, at)
        if n:
            (fmu.getContinuousStateDerivatives if three else fmu.getDerivatives)(address[id(dx)], n)
        return dx.copy()

    def indicators(t: float, at: np.ndarray) -> np.ndarray:
        place(t, at)
        if m:
            fmu.getEventIndicators(address[id(z)], m)
        return z.copy()

    def event() -> tuple[float, bool]:
        for _ in range(100):
            again, ends, _, _, defined, following = (fmu.updateDiscreteStates if three else fmu.newDiscreteStates)()
            if ends or not again:
                break
        if not ends:
            fmu.enterContinuousTimeMode()
        return (float(following) if defined else math.inf), bool(ends)

    following, ended = event()
    t, state = case.start, states()
    jumps, kinks = inputs.jumps(), inputs.kinks()
    yield [t, *map(get, case.outputs)]
    for point in times[1:]:
        while t < point and not ended:
            stop = min(point, following, min((each for each in kinks if each > t), default=math.inf))
            found = False
            if stop > t:
                before = indicators(t, state)
                roots = [root(indicators, i, bool(before[i] > 0.0)) for i in range(m)]
                if n:
                    made = solve_ivp(rates, (t, stop), state, "LSODA", rtol=1e-9, atol=1e-12, events=roots or None)
                    t, state, found = float(made.t[-1]), made.y[:, -1], made.status == 1
                else:
                    t = stop
                size = 1e-14 * max(1.0, abs(t))
                while (
                    found and not ((before > 0.0) != (indicators(t, state) > 0.0)).any()
                ):  # the root is not passed yet
                    t, state, size = t + size, state + size * rates(t, state), 2.0 * size
                found = found or bool(((before > 0.0) != (indicators(t, state) > 0.0)).any())
            place(t, state)
            asked, ended = fmu.completedIntegratorStep()
            if t == point:
                yield [t, *map(get, case.outputs)]
            if not ended and (found or asked or t >= following or t in jumps):
                fmu.enterEventMode()
                put(inputs.at(t))
                following, ended = event()
                state = states()
                if t == point or ended:
                    yield [t, *map(get, case.outputs)]
    fmu.freeInstance()


if __name__ == "__main__":
    main(run, LACKS, lambda: version("scipy"))
