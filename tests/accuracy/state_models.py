"""A mass on friction with states, from the equations of the papers, by solvers of SciPy: a reference for coupled runs.

Nothing here is from the library.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import asinh, copysign, exp, pi, sin
from typing import Any, Protocol

import numpy as np
from accuracy.event_driven import Phase, TooLongError
from numpy.typing import NDArray
from scipy.integrate import odeint, solve_ivp

Array = NDArray[np.float64]
Condition = Callable[[float, Array], float]
Curve = Callable[[float], float]
SECONDS = 1.0  # of processor time for one integration


class Contact(Protocol):
    """The rates of the states of a contact and its force; `ends` are positive when a mode ends, which `change`s it."""

    def rates(self, v: float, q: Array) -> tuple[Sequence[float], float]: ...


@dataclass
class Smooth:
    """A contact without modes."""

    rates: Callable[[float, Array], tuple[Sequence[float], float]]

    def ends(self) -> list[Condition]:
        return []


def stribeck(Fc: float, Fs: float, vs: float, delta: float = 2.0) -> Curve:
    """The Stribeck curve."""
    return lambda v: Fc + (Fs - Fc) * exp(-min(abs(v / vs) ** delta, 700.0))


def lugre(sigma0: float, sigma1: float, sigma2: float, g: Curve) -> Smooth:
    """Canudas de Wit and others 1995."""

    def rates(v: float, q: Array) -> tuple[Sequence[float], float]:
        rate = v - sigma0 * abs(v) * q[0] / g(v)
        return (rate,), sigma0 * q[0] + sigma1 * rate + sigma2 * v

    return Smooth(rates)


def elasto_plastic(sigma0: float, sigma1: float, sigma2: float, z_ba: float, S: Curve) -> Smooth:
    """Dupont and others 2002."""

    def rates(v: float, q: Array) -> tuple[Sequence[float], float]:
        z, top = q[0], S(v) / sigma0
        if z * v <= 0.0 or abs(z) <= z_ba:
            alpha = 0.0
        elif abs(z) >= top:
            alpha = 1.0
        else:
            alpha = 0.5 + 0.5 * sin(pi * (abs(z) - 0.5 * (top + z_ba)) / (top - z_ba))
        rate = v * (1.0 - alpha * z / copysign(top, v))
        return (rate,), sigma0 * z + sigma1 * rate + sigma2 * v

    return Smooth(rates)


def dahl(sigma: float, Fc: float, n: float) -> Smooth:
    """Dahl 1968."""

    def rates(v: float, q: Array) -> tuple[Sequence[float], float]:
        w = 1.0 - copysign(sigma * q[0] / Fc, q[0] * v)
        return (v * copysign(abs(w) ** n, w),), sigma * q[0]

    return Smooth(rates)


def bliman_sorine(f1: float, f2: float, eta: float, eps: float) -> Smooth:
    """Bliman and Sorine 1995, second order."""

    def rates(v: float, q: Array) -> tuple[Sequence[float], float]:
        s = copysign(1.0, v)
        fast, slow = abs(v) * (f1 * s - q[0]) / (eta * eps), abs(v) * (-f2 * s - q[1]) / eps
        return (fast, slow), q[0] + q[1]

    return Smooth(rates)


def load_dependent(mu_avg: float, mu_dif: float, eps: float, Fv: float, F_t: float) -> Smooth:
    """A gear under a constant load."""

    def rates(v: float, q: Array) -> tuple[Sequence[float], float]:
        z = q[0]
        return ((v - abs(v) * z) / eps,), mu_avg * abs(F_t) * z + mu_dif * F_t * z * z + Fv * v

    return Smooth(rates)


def rate_and_state(mu0: float, a: float, b: float, Dc: float, V0: float) -> Smooth:
    """Dieterich's law, regular at v = 0; the state is ln(V0 theta / Dc)."""

    def rates(v: float, q: Array) -> tuple[Sequence[float], float]:
        mu = a * asinh(v / (2.0 * V0) * exp(min((mu0 + b * q[0]) / a, 690.0)))
        return (V0 / Dc * exp(min(-q[0], 690.0)) - abs(v) / Dc,), mu

    return Smooth(rates)


@dataclass
class Reset:
    """The reset integrator of Haessig and Friedland 1991."""

    sigma0: float
    z0: float
    a: float
    beta: float
    side: float = 0.0

    def rates(self, v: float, q: Array) -> tuple[Sequence[float], float]:
        if self.side:
            return (0.0,), self.sigma0 * self.z0 * self.side
        return (v,), (1.0 + self.a) * self.sigma0 * q[0] + self.beta * v

    def ends(self) -> list[Condition]:
        if self.side:
            return [lambda v, _: -self.side * v]
        return [lambda _, q: q[0] - self.z0, lambda _, q: -q[0] - self.z0]

    def change(self, which: int, _: float, q: Array) -> Array:
        self.side = 0.0 if self.side else (1.0, -1.0)[which]
        return q


@dataclass
class Seven:
    """The seven-parameter model without its delay; states: deflection, dwell time."""

    kt: float
    Fc: float
    Fv: float
    first: float
    longest: float
    vs: float
    gamma: float
    side: float = 0.0
    excess: float = 0.0
    last: float = field(init=False)

    def __post_init__(self) -> None:
        self.last = self.first

    def _excess(self, t2: float) -> float:
        return self.last + (self.longest - self.last) * t2 / (t2 + self.gamma)

    def rates(self, v: float, q: Array) -> tuple[Sequence[float], float]:
        if not self.side:
            return (v, 1.0), self.kt * q[0]
        return (0.0, 0.0), (self.Fc + self.excess / (1.0 + (v / self.vs) ** 2)) * self.side + self.Fv * v

    def ends(self) -> list[Condition]:
        if self.side:
            return [lambda v, _: -self.side * v]
        return [lambda _, q, s=s: s * self.kt * q[0] - self.Fc - self._excess(q[1]) for s in (1.0, -1.0)]

    def change(self, which: int, _: float, q: Array) -> Array:
        if self.side:
            self.last = self.excess
            q = np.array([self.side * (self.Fc + self.last) / self.kt, 0.0])
            self.side = 0.0
        else:
            self.side, self.excess = (1.0, -1.0)[which], self._excess(q[1])
        return q


@dataclass(frozen=True)
class Carried:
    """A mass on a spring and a damper to a support, over a contact with states."""

    contact: Callable[[], Any]
    q0: Sequence[float]
    m: float
    k: float
    d: float
    v0: float
    phases: Sequence[Phase]
    scales: Sequence[float]
    """Typical sizes of x, v and the states."""
    strict: int = 0
    """Tolerances are divided by as many powers of 10, absolute ones of 100."""

    def run(self, t: Array) -> dict[str, Array]:
        """Return x, v and F."""
        contact = self.contact()
        y, support = np.array([0.0, self.v0, *self.q0]), 0.0
        found = {name: np.empty(len(t)) for name in ("x", "v", "F")}
        ends = [*(phase.begin for phase in self.phases[1:]), np.inf]
        latest = time.process_time() + SECONDS * 4.0**self.strict
        for phase, until in zip(self.phases, ends, strict=True):
            begin, end = float(max(phase.begin, t[0])), float(min(until, t[-1]))
            if end <= begin:
                continue

            rhs = self._motion(contact, phase, begin, support, latest)
            last = until > t[-1]
            rows = slice(*np.searchsorted(t, [begin, np.inf if last else end]))
            walk = _modal if contact.ends() else _smooth
            y = walk(
                *(rhs, begin, end, y, t[rows], contact, np.array(self.scales) / 100.0**self.strict),
                *({n: values[rows] for n, values in found.items()}, 0.1**self.strict),
            )
            support += phase.support * (end - begin)
        if not all(np.isfinite(values).all() for values in found.values()):
            raise TooLongError
        return found

    def _motion(self, contact: Any, phase: Phase, begin: float, support: float, latest: float) -> Any:
        def rhs(tau: float, y: Array) -> list[float]:
            if time.process_time() > latest:
                raise TooLongError
            rates, F = contact.rates(y[1], y[2:])
            push = phase.force - self.k * (y[0] - support - phase.support * (tau - begin))
            return [y[1], (push - self.d * (y[1] - phase.support) - F) / self.m, *rates]

        return rhs


def _smooth(
    rhs: Any,
    begin: float,
    end: float,
    y: Array,
    t: Array,
    contact: Any,
    scales: Array,
    out: dict[str, Array],
    share: float,
) -> Array:
    grid = np.unique(np.concatenate([[begin], t, [end]]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            run = odeint(rhs, y, grid, tfirst=True, rtol=1e-10 * share, atol=1e-11 * scales, mxstep=1_000_000, h0=1e-12)
        except Warning:
            raise TooLongError from None
    rows = np.searchsorted(grid, t)
    _keep(run[rows].T, contact, out, slice(None))
    return np.asarray(run[-1])


def _modal(
    rhs: Any,
    begin: float,
    end: float,
    y: Array,
    t: Array,
    contact: Any,
    scales: Array,
    out: dict[str, Array],
    share: float,
) -> Array:
    now, last = begin, -1
    while now < end:
        if last and contact.ends()[0](y[1], y[2:]) > 0.0:  # a reversal by rounding, when another mode ended
            y[2:] = contact.change(0, y[1], y[2:])
        last = -1
        conditions = [lambda _, y, g=g: g(y[1], y[2:]) for g in contact.ends()]
        for condition in conditions:
            condition.terminal, condition.direction = True, 1.0
        run: Any = solve_ivp(
            rhs, (now, end), y, "LSODA", events=conditions, rtol=1e-10 * share, atol=1e-12 * scales, dense_output=True
        )
        if run.status < 0:
            raise TooLongError
        rows = slice(*np.searchsorted(t, [now, run.t[-1] if run.status == 1 else np.inf]))
        if len(t[rows]):
            _keep(run.sol(t[rows]), contact, out, rows)
        now, y = float(run.t[-1]), run.y[:, -1].copy()
        if run.status == 1:
            last = next(i for i, times in enumerate(run.t_events) if times.size)
            y[2:] = contact.change(last, y[1], y[2:])
    return y


def _keep(values: Array, contact: Any, out: dict[str, Array], rows: slice) -> None:
    out["x"][rows], out["v"][rows] = values[0], values[1]
    out["F"][rows] = [contact.rates(y[1], y[2:])[1] for y in values.T]
