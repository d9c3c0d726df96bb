"""Instances for model exchange, driven through events and continuous time as a solver drives them."""

from __future__ import annotations

import ctypes
import math
from ctypes import byref, c_double, c_int
from typing import Final, Self

from .fmi2_library import ERROR, RawInstance, RawLibrary, RefusedError

MOST_ITERATIONS: Final = 100  # largest number of calls of fmi2NewDiscreteStates for one event
UNSET: Final = -7  # what the results of a call hold before it

_SUBSTEPS: Final = 4
_LARGEST: Final = 0.1  # largest change of a state in a substep over its nominal value: plausible, not accurate


class EventInfo(ctypes.Structure):
    """fmi2EventInfo."""

    _fields_ = (
        *((name, c_int) for name in ("iterate", "terminate", "nominals", "values", "scheduled")),
        ("next", c_double),
    )


def start(library: RawLibrary, name: str = "checked") -> RawInstance:
    """Return a new instance of the interface that is checked."""
    return RawExchange(library, name) if library.exchange else RawInstance(library, name)


class RawExchange(RawInstance):
    """One instance for model exchange; between steps it is in event mode."""

    def __init__(self, library: RawLibrary, name: str = "checked") -> None:
        """Instantiate."""
        super().__init__(library, name)
        self.info, self.settled = EventInfo(), True  # of the last event iteration, and whether it came to its end
        self.unset: set[str] = set()  # functions that did not set all of their flags

    def settle(self) -> None:
        """Iterate in event mode until the discrete states have settled."""
        for _ in range(MOST_ITERATIONS):
            info = self.info = EventInfo(UNSET, UNSET, UNSET, UNSET, UNSET, math.nan)
            self.must("NewDiscreteStates", byref(info))
            if UNSET in (info.iterate, info.terminate, info.nominals, info.values, info.scheduled):
                self.unset.add("NewDiscreteStates")
            self.settled = info.iterate in (0, UNSET)
            if self.settled:
                return

    def continuous(self) -> Self:
        """Initialise and enter continuous-time mode."""
        self.initialise()
        self.settle()
        self.must("EnterContinuousTimeMode")
        return self

    def values(self, function: str, n: int) -> list[float]:
        """Return the values of a function such as GetDerivatives."""
        if n == 0:
            return []
        buffer = (c_double * n)()
        self.must(function, buffer, n)
        return list(buffer)

    def states(self) -> list[float]:
        """Return the continuous states."""
        return self.values("GetContinuousStates", len(self.library.job["states"]))

    def derivatives(self) -> list[float]:
        """Return the derivatives of the states."""
        return self.values("GetDerivatives", len(self.library.job["states"]))

    def nominals(self) -> list[float]:
        """Return the nominal values of the states, with 1 for one that is not positive."""
        found = self.values("GetNominalsOfContinuousStates", len(self.library.job["states"]))
        return [value if 0.0 < value < math.inf else 1.0 for value in found]

    def indicators(self) -> list[float]:
        """Return the event indicators."""
        return self.values("GetEventIndicators", self.library.job["indicators"])

    def go_to(self, t: float, x: list[float]) -> None:
        """Set time and states."""
        self.must("SetTime", t)
        if x:
            self.must("SetContinuousStates", (c_double * len(x))(*x), len(x))

    def step_status(self, t: float, h: float) -> int:
        """Advance by Euler steps and events, and return a status."""
        try:
            self._advance(t, h)
        except RefusedError:
            return ERROR
        return 0

    def step(self, t: float, h: float) -> None:
        """Advance by Euler steps and events, which must succeed."""
        self._advance(t, h)

    def complete(self) -> bool:
        """Report a completed solver step and return whether the FMU asks for an event."""
        enter, end = c_int(UNSET), c_int(UNSET)
        self.must("CompletedIntegratorStep", 1, byref(enter), byref(end))
        if UNSET in (enter.value, end.value):
            self.unset.add("CompletedIntegratorStep")
        return enter.value == 1

    def _advance(self, t: float, h: float) -> None:
        self.settle()
        self.must("EnterContinuousTimeMode")
        x, nominals, above = self.states(), self.nominals(), self._above()
        for k in range(1, _SUBSTEPS + 1):
            now = t + h * k / _SUBSTEPS if k < _SUBSTEPS else t + h
            x = [
                value + max(-limit, min(limit, rate * h / _SUBSTEPS))
                for value, limit, rate in zip(x, (_LARGEST * n for n in nominals), self.derivatives(), strict=True)
            ]
            self.go_to(now, x)
            asked = self.complete() if self.library.job["completes"] else False
            due = self.info.scheduled == 1 and self.info.next <= now
            if k < _SUBSTEPS and (asked or due or self._above() != above):
                self.must("EnterEventMode")
                self.settle()
                self.must("EnterContinuousTimeMode")
                x, above = self.states(), self._above()
        self.must("EnterEventMode")
        self.settle()

    def _above(self) -> list[bool]:
        return [value > 0.0 for value in self.indicators()]
