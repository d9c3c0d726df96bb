"""A mass pulled by a spring over friction, from the equations of the papers, by SciPy from event to event.

Nothing here is from the library: tests compare its FMUs with these integrations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import copysign, exp, expm1, log1p
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Array = NDArray[np.float64]
Condition = Callable[[float, Array], float]

FC, FS, VS = 1.0, 1.5, 1e-3  # N, N, m/s
MASS, SPRING = 1.0, 200.0  # kg, N/m


def stribeck(v: float) -> float:
    return FC + (FS - FC) * exp(-((v / VS) ** 2))


@dataclass
class Slip:
    """The generalised Maxwell slip model of Al-Bender, Lampaert, Swevers (2005); its states are the forces."""

    k: Sequence[float]
    alpha: Sequence[float]
    C: float
    sigma: float
    method: str = "DOP853"
    curve: Callable[[float], float] = stribeck
    side: float = 1.0
    slipping: set[int] = field(default_factory=set)

    def rates(self, v: float, q: Array) -> tuple[list[float], float]:
        S, d = self.curve(v), self.side
        rates = [
            d * self.C * (a - d * f / S) if i in self.slipping else k * v
            for i, (k, a, f) in enumerate(zip(self.k, self.alpha, q, strict=True))
        ]
        return rates, float(sum(q)) + self.sigma * sum(rate / k for rate, k in zip(rates, self.k, strict=True))

    def ends(self) -> list[Condition]:
        """A reversal, and the onset of slip of each element."""
        onsets = [lambda v, q, i=i: self.side * q[i] - self.alpha[i] * self.curve(v) for i in self._sticking()]
        return [lambda v, _: -self.side * v, *onsets]

    def _sticking(self) -> list[int]:
        return [i for i in range(len(self.k)) if i not in self.slipping]

    def change(self, which: int, _: float, q: Array) -> Array:
        if which == 0:
            self.side = -self.side
            self.slipping = set()
        else:
            self.slipping.add(self._sticking()[which - 1])
        return q


@dataclass
class Leuven:
    """The integrated model of Swevers, Al-Bender, Ganseman, Prajogo (2000); its state is z."""

    A: float
    zc: float
    n: float
    sigma1: float
    k: Sequence[float] = (0.0,)
    method: str = "Radau"
    level: Callable[[float], float] = stribeck
    side: float = 1.0
    reversals: list[float] = field(default_factory=list)

    def curve(self, z: float) -> float:
        return copysign(-self.A * expm1(-abs(z) / self.zc), z)

    def base(self) -> float:
        return self.reversals[-1] if self.reversals else 0.0

    def rates(self, v: float, q: Array) -> tuple[list[float], float]:
        r = self.curve(q[0]) / (self.side * self.level(v) - self.base())
        rate = v * (1.0 - copysign(abs(r) ** self.n, r))
        return [rate], self.base() + self.curve(q[0]) + self.sigma1 * rate

    def ends(self) -> list[Condition]:
        """A reversal, the onset of sliding, and the end of a loop."""
        d, base = self.side, self.base()
        found: list[Condition] = [lambda v, _: -d * v]
        if self.reversals:
            found.append(lambda v, q: d * self.curve(q[0]) - (1.0 - 1e-3) * (self.level(v) - d * base))
        if len(self.reversals) >= 2:
            found.append(lambda _, q: d * (base + self.curve(q[0]) - self.reversals[-2]))
        return found

    def change(self, which: int, v: float, q: Array) -> Array:
        force = self.base() + self.curve(q[0])
        if which == 0:
            self.side = -self.side
            self.reversals.append(force)
        elif which == 1:
            self.reversals.clear()
        else:
            del self.reversals[-2:]
        z = force - self.base()
        return np.array([copysign(-self.zc * log1p(-abs(z) / self.A), z)])


def _rises(run: Any, v_up: float) -> list[float]:
    below = run.y[1] < v_up
    steps = np.flatnonzero(below[:-1] & ~below[1:])
    return [float(brentq(lambda t: run.sol(t)[1] - v_up, run.t[k], run.t[k + 1], xtol=1e-14)) for k in steps]


def pulled(contact: Slip | Leuven, speed: float, until: float, v_up: float) -> list[float]:
    """Return the times at which the velocity of the mass rises through v_up; its spring is pulled at a speed."""

    def rhs(t: float, y: Array) -> list[float]:
        rates, friction = contact.rates(y[1], y[2:])
        return [y[1], (SPRING * (speed * t - y[0]) - friction) / MASS, *rates]

    t, y, found = 0.0, np.zeros(2 + len(contact.k)), []
    while t < until:
        conditions = [lambda _, y, end=end: end(y[1], y[2:]) for end in contact.ends()]
        for condition in conditions:
            condition.terminal, condition.direction = True, 1.0
        run = solve_ivp(
            rhs, (t, until), y, contact.method, events=conditions, rtol=1e-12, atol=1e-16, dense_output=True
        )
        found += _rises(run, v_up)
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status == 1:
            which = next(i for i, times in enumerate(run.t_events) if times.size)
            y[2:] = contact.change(which, y[1], y[2:])
    return found


def turns(
    sliding: Callable[[float, float], float], held: tuple[float, float], mass: Mapping[str, float]
) -> list[tuple[float, float]]:
    """Return times and positions at which an oscillator turns, until friction between the limits `held` keeps it.

    `sliding` is the friction as a function of velocity and direction; the oscillator starts at rest.
    """
    m, k, d = mass["m"], mass["k"], mass["d"]
    t, x, found = 0.0, mass["x0"], []
    while not held[0] <= -k * x <= held[1]:
        way = copysign(1.0, -x)

        def rhs(_: float, y: Array, way: float = way) -> list[float]:
            return [y[1], (-k * y[0] - d * y[1] - sliding(y[1], way)) / m]

        def at_rest(_: float, y: Array, way: float = way) -> float:
            return way * y[1]

        at_rest.terminal, at_rest.direction = True, -1.0  # type: ignore[attr-defined]
        precise: dict[str, Any] = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-16}
        away = solve_ivp(rhs, (t, t + 1e-4), [x, 0.0], **precise)  # so that the next event is the end of the motion
        run = solve_ivp(rhs, (t + 1e-4, t + 10.0), away.y[:, -1], events=at_rest, **precise)
        t, x = float(run.t[-1]), float(run.y[0, -1])
        found.append((t, x))
    return found
