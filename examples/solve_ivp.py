"""Stick-slip on static friction, integrated by scipy's solve_ivp over the derivatives and events of an FMU.

A spring whose end moves at constant speed pulls a mass. The equations of the mass are in this file, the contact is the
FMU ``Stiction`` in model exchange. The script prints the period of the stick-slip and its closed form.
"""

from collections.abc import Callable
from ctypes import POINTER, c_double
from math import atan, pi, sqrt
from typing import Any

import fmpy
import numpy as np
from fmpy.simulation import instantiate_fmu
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from friction_fmus import fmu

Array = NDArray[np.float64]

PAST = 1e-14  # a root is taken behind an event, in the unit of its indicator


class Exchanged:
    """An FMU in model exchange."""

    def __init__(self, name: str, **start: float) -> None:
        """Instantiate a block with start values of parameters and inputs."""
        folder = fmpy.extract(str(fmu(name)))
        description = fmpy.read_model_description(folder)
        self._reference = {v.name: v.valueReference for v in description.modelVariables}
        self._fmu: Any = instantiate_fmu(folder, description, fmi_type="ModelExchange")
        self._indicators: int = description.numberOfEventIndicators
        self._size: int = description.numberOfContinuousStates
        self._fmu.setupExperiment()
        self._set(start)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        self._decide()
        self.states = self._read(self._fmu.getContinuousStates, self._size)

    def _set(self, values: dict[str, float]) -> None:
        self._fmu.setReal([self._reference[name] for name in values], list(values.values()))

    def _read(self, function: Callable[..., object], size: int) -> Array:
        values = np.zeros(size)
        function(values.ctypes.data_as(POINTER(c_double)), size)
        return values

    def _decide(self) -> None:
        again = True
        while again:
            again, *_ = self._fmu.newDiscreteStates()
        self._fmu.enterContinuousTimeMode()

    def at(self, t: float, states: Array, **inputs: float) -> None:
        """Set time, states and inputs."""
        self._fmu.setTime(t)
        self._fmu.setContinuousStates(np.array(states).ctypes.data_as(POINTER(c_double)), self._size)
        self._set(inputs)

    def rates(self) -> Array:
        """Return the derivatives of the states."""
        return self._read(self._fmu.getDerivatives, self._size)

    def output(self, name: str) -> float:
        """Return the value of an output."""
        return float(self._fmu.getReal([self._reference[name]])[0])

    def events(self, put: Callable[[float, Array], None]) -> list[Callable[[float, Array], float]]:
        """Return one terminal event for each indicator; `put` passes time and states of the system to `at`."""

        def event(number: int) -> Callable[[float, Array], float]:
            def left(t: float, y: Array) -> float:
                put(t, y)
                return float(self._read(self._fmu.getEventIndicators, self._indicators)[number]) + PAST

            left.terminal = True  # type: ignore[attr-defined]
            left.direction = -1.0  # type: ignore[attr-defined]
            return left

        return [event(number) for number in range(self._indicators)]

    def pass_event(self) -> Array:
        """Let the FMU decide what holds until the next event, and return its states."""
        self._fmu.enterEventMode()
        self._decide()
        return self._read(self._fmu.getContinuousStates, self._size)


M, K, V = 1.0, 1e3, 0.01  # mass [kg], spring [N/m], speed of its end [m/s]
FS, FC = 1.5, 1.0  # static and Coulomb friction [N]
STOP = 2.0  # [s]


def main() -> None:
    """Integrate from event to event; print the period between break-aways."""
    contact = Exchanged("Stiction", Fs=FS, Fc=FC, Fv=0.0)

    def put(t: float, y: Array) -> None:
        contact.at(t, y[2:], v=y[1], F_ext=K * (V * t - y[0]))

    def rates(t: float, y: Array) -> list[float]:
        put(t, y)
        return [y[1], (K * (V * t - y[0]) - contact.output("F")) / M, *contact.rates()]

    t, y, starts = 0.0, np.concatenate([[0.0, 0.0], contact.states]), []
    while t < STOP:
        run = solve_ivp(rates, (t, STOP), y, events=contact.events(put), rtol=1e-9, atol=1e-12)
        t, y = float(run.t[-1]), run.y[:, -1]
        if run.status == 1:  # an event
            put(t, y)
            y[2:] = contact.pass_event()
            if run.t_events is not None and run.t_events[1].size:  # the force exceeds the static friction
                starts.append(t)

    period, fall, w = float(np.mean(np.diff(starts))), (FS - FC) / K, sqrt(K / M)
    # sticks while the spring winds up again by 2 fall, slips for the rest of an oscillation about sliding at V
    expected = 2.0 * fall / V + 2.0 * (pi - atan(fall * w / V)) / w
    # taken late by PAST, each event delays the break-away by sqrt(2 PAST M/(K V)) = 0.04 us
    assert abs(period - expected) < 2e-7
    print(f"period {period:.6f} s, closed form {expected:.6f} s")


if __name__ == "__main__":
    main()
