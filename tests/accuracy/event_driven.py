"""A mass on rigid friction from event to event: the reference for coupled runs. Nothing here is from the library.

Rest and motion are told apart exactly: at rest, friction is whatever balances the other forces within its limits; in
motion, it is the force of the model in the direction of motion. Motion under Coulomb and viscous friction is linear and
solved in closed form; under a Stribeck curve by SciPy, with the end of the motion located to rounding.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import copysign, inf, log, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Array = NDArray[np.float64]
Curve = Callable[[float], float]
LONGEST = 5_000  # pieces of a motion
SECONDS = 1.0  # of processor time for one motion


class TooLongError(Exception):
    """The motion has more pieces than are worth following."""


@dataclass(frozen=True)
class Contact:
    """Friction of ``Fc sign(v) + Fv v``, or ``curve(|v|) sign(v) + Fv v``, and of at most Fs at rest."""

    Fc: float
    Fs: float
    Fv: float = 0.0
    curve: Curve | None = None

    def sliding(self, v: float, way: float) -> float:
        """Friction in motion; at v = 0 its limit from the direction `way`."""
        return way * (self.Fc if self.curve is None else self.curve(abs(v))) + self.Fv * v

    def scaled(self, factor: float) -> Contact:
        """Friction so many times as high."""
        curve = self.curve
        other = None if curve is None else (lambda v: factor * curve(v))
        return Contact(factor * self.Fc, factor * self.Fs, factor * self.Fv, other)


@dataclass(frozen=True)
class Phase:
    """From this time on: the applied force and the velocity of the support."""

    begin: float
    force: float = 0.0
    support: float = 0.0


@dataclass(frozen=True)
class Pulled:
    """A mass on a spring and a damper to a support, over friction against a belt."""

    contact: Contact
    m: float = 1.0
    k: float = 0.0
    d: float = 0.0
    x0: float = 0.0
    v0: float = 0.0
    support0: float = 0.0
    belt: float = 0.0
    phases: Sequence[Phase] = (Phase(0.0),)

    def run(self, t: Array) -> dict[str, Array]:
        """Return x, v, F, the times of `changes` between rest and motion, and F at the times `away` of the latter."""
        walk = _Walk(self, t)
        walk.all()
        return walk.found


@dataclass
class _Walk:
    """Progress of the mass, relative to the belt: x and v are those of the mass less those of the belt."""

    of: Pulled
    t: Array
    now: float = 0.0
    pieces: int = 0
    found: dict[str, Array] = field(default_factory=dict)

    def all(self) -> None:
        of = self.of
        self.now, self.latest = float(self.t[0]), time.process_time() + SECONDS
        self.x, self.v, self.support = of.x0, of.v0 - of.belt, of.support0
        self.found = {name: np.empty(len(self.t)) for name in ("x", "v", "F")}
        self.changes: list[tuple[float, bool]] = []
        self.forces: list[float] = []
        ends = [phase.begin for phase in of.phases[1:]] + [inf]
        for phase, end in zip(of.phases, ends, strict=True):
            self.phase, self.end = phase, min(end, float(self.t[-1]))
            while self.now < self.end:
                self.pieces += 1
                if self.pieces > LONGEST:
                    raise TooLongError
                self._piece()
        self._keep(self.t[-1], np.inf, lambda tau: (self.x + 0 * tau, self.v + 0 * tau), self._friction_now)
        self.found["changes"] = np.array([time for time, _ in self.changes])
        self.found["away"] = np.array([time for time, rests in self.changes if not rests])
        self.found["F_away"] = np.array(self.forces)

    # forces at the current time, all but friction, for motion with the belt
    def needed(self, x: float, v: float, support: float) -> float:
        of, p = self.of, self.phase
        return p.force - of.k * (x - support) - of.d * (v + of.belt - p.support)

    def _friction_now(self, tau: Array) -> Array:
        P = self.needed(self.x, self.v, self.support)
        F = P if self._rests(P) else self.of.contact.sliding(self.v, copysign(1.0, self.v if self.v != 0.0 else P))
        return F + 0 * tau

    def _rests(self, P: float) -> bool:
        return self.v == 0.0 and abs(P) <= self.of.contact.Fs * (1.0 + 1e-12)

    def _keep(
        self, begin: float, end: float, motion: Callable[[Array], tuple[Array, Array]], friction: Callable[..., Array]
    ) -> None:
        rows = slice(*np.searchsorted(self.t, [begin, end]))
        tau = self.t[rows] - begin
        if len(tau):
            x, v = motion(tau)
            of = self.of
            self.found["x"][rows] = x + of.belt * (self.t[rows] - self.t[0])
            self.found["v"][rows] = v + of.belt
            self.found["F"][rows] = friction(tau)

    def _piece(self) -> None:
        P = self.needed(self.x, self.v, self.support)
        if self.v == 0.0:
            rate = self.of.k * (self.phase.support - self.of.belt)  # of P at rest
            inside = abs(P) < self.of.contact.Fs * (1.0 - 1e-12)
            if inside or (self._rests(P) and P * rate <= 0.0):
                self._note(True)
                self._rest(P, rate)
                return
        self._note(False)
        self._move(copysign(1.0, self.v if self.v != 0.0 else P))

    def _note(self, rests: bool) -> None:
        if not self.changes or self.changes[-1][1] != rests:
            self.changes.append((self.now, rests))
            if not rests:
                P, c = self.needed(self.x, self.v, self.support), self.of.contact
                self.forces.append(c.sliding(self.v, copysign(1.0, self.v)) if self.v else min(max(P, -c.Fs), c.Fs))

    def _rest(self, P: float, rate: float) -> None:
        Fs = self.of.contact.Fs
        left = inf if rate == 0.0 else (copysign(Fs, rate) - P) / rate
        length = min(left, self.end - self.now)
        at = self.x
        self._keep(self.now, self.now + length, lambda tau: (at + 0 * tau, 0 * tau), lambda tau: P + rate * tau)
        self._advance(length, at, 0.0)

    def _advance(self, length: float, x: float, v: float) -> None:
        whole = self.now + length >= self.end
        self.support += (self.phase.support - self.of.belt) * length
        self.now = self.end if whole else self.now + length
        self.x, self.v = x, v

    def _move(self, way: float) -> None:
        if self.of.contact.curve is None:
            self._linear(way)
        else:
            self._curved(way)

    def _linear(self, way: float) -> None:
        of, c, left = self.of, self.of.contact, self.end - self.now
        V = self.phase.support - of.belt
        damping = of.d + c.Fv
        a = (self.needed(self.x, self.v, self.support) - c.sliding(self.v, way)) / of.m
        if self.v == 0.0:
            if way * a < -1e-9 * c.Fs / of.m:  # static friction below sliding friction
                raise TooLongError
            a = way * max(way * a, 0.0)
        if of.k == 0.0 and damping == 0.0:
            x0, v0 = self.x, self.v
            motion = lambda tau: (x0 + v0 * tau + 0.5 * a * tau**2, v0 + a * tau)  # noqa: E731
            stop = -v0 / a if way * a < 0.0 else inf
        else:
            motion, stop = _modes(of, damping, V, (self.x, self.v, a), way, left)
        stop = inf if c.Fc == c.Fs == 0.0 else stop
        length = min(stop, left)
        self._keep(self.now, self.now + length, motion, lambda tau: way * c.Fc + c.Fv * motion(tau)[1])
        x, v = motion(np.array(length))
        self._advance(length, float(x), 0.0 if stop <= left else float(v))

    def _curved(self, way: float) -> None:
        of, c = self.of, self.of.contact
        V, s0, begin = self.phase.support - of.belt, self.support, self.now
        left = self.end - begin

        def rhs(tau: float, y: Array) -> list[float]:
            if time.process_time() > self.latest:
                raise TooLongError
            slip = way * max(way * y[1], 0.0)
            return [y[1], (self.needed(y[0], y[1], s0 + V * tau) - c.sliding(slip, way)) / of.m]

        def stops(_: float, y: Array) -> float:
            return way * y[1]

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        a = abs(rhs(0.0, np.array([self.x, self.v]))[1])
        y0 = np.array([self.x, self.v])
        run: Any = solve_ivp(
            rhs,
            (0.0, left),
            y0,
            "LSODA" if of.m < 1e-3 else "DOP853",
            events=stops,
            rtol=1e-11,
            atol=[1e-16, 1e-16],
            dense_output=True,
            first_step=min(left, 1e-9) if a == 0.0 else None,
        )
        stopped = run.status == 1
        length = float(run.t[-1])
        motion = lambda tau: tuple(run.sol(tau)[:2])  # noqa: E731
        force = lambda tau: np.array([c.sliding(v, way) for v in run.sol(tau)[1]])  # noqa: E731
        self._keep(begin, begin + length, motion, force)
        self._advance(length if stopped else left, float(run.y[0, -1]), 0.0 if stopped else float(run.y[1, -1]))


def _modes(
    of: Pulled, damping: float, V: float, start: tuple[float, float, float], way: float, left: float
) -> tuple[Callable[[Any], tuple[Any, Any]], float]:
    """Return the motion of a damped oscillator whose support moves at V, and the time at which it first stops."""
    x, v, a = start
    if of.k == 0.0:
        rates = np.array([-damping / of.m])
        V = v + a * of.m / damping
        sizes = np.array([v - V])
    else:
        half = damping / (2.0 * of.m)
        root = np.sqrt(complex(half**2 - of.k / of.m))
        if abs(root) < 1e-9 * half:
            root = 1e-6 * half  # critical damping, to 1e-12
        slow = -of.k / of.m / (half + root) if root.real else root - half
        rates = np.array([-half - root, slow])
        c0 = (a - rates[1] * (v - V)) / (rates[0] - rates[1])
        sizes = np.array([c0, v - V - c0])

    def motion(tau: Any) -> tuple[Any, Any]:
        power = np.multiply.outer(np.asarray(tau), rates)
        moved = (np.expm1(power) * (sizes / rates)).sum(-1)
        return (x + V * tau + moved).real, (V + (np.exp(power) * sizes).sum(-1)).real

    def speed(tau: float) -> float:
        return way * float(motion(tau)[1])

    turning: list[float] = []  # the first extrema of v: none later is lower, as the amplitude falls
    if of.k > 0.0 and rates[0].imag:
        w = abs(rates[0].imag)
        b = sizes[0] * rates[0]
        # v' is twice the real part of b exp(rate tau)
        phase = np.angle(b)
        sense = copysign(1.0, rates[0].imag)
        first = ((pi / 2 - phase) * sense) % pi
        turning = [(first + j * pi) / w for j in range(4)]
    elif of.k > 0.0:
        ratio = -(sizes[0] * rates[0]).real / (sizes[1] * rates[1]).real if sizes[1] else 0.0
        if ratio > 0.0:
            at = log(ratio) / (rates[1] - rates[0]).real
            turning = [at] if at > 0.0 else []
    points = [0.0, *[tau for tau in turning if 0.0 < tau < left], left]
    for low, high in pairwise(points):
        if speed(high) <= 0.0 < max(speed(low), speed(0.5 * (low + high))):
            low = low if speed(low) > 0.0 else 0.5 * (low + high)
            return motion, float(brentq(speed, low, high, xtol=1e-300, rtol=1e-14))
    return motion, inf


def two_in_series(
    contacts: Sequence[Contact], masses: Sequence[float], k: float, d: float, force: Callable[[Any], Any], t: Array
) -> dict[str, Array]:
    """Return the motion of two masses in a row, the first of them driven, each on a contact without a curve."""
    ways, y, now, count = [0, 0], np.zeros(4), float(t[0]), 0
    found = {name: np.empty(len(t)) for name in ("x1", "v1", "x2", "v2")}

    def needed(tau: float, y: Array) -> list[float]:
        spring = k * (y[0] - y[2]) + d * (y[1] - y[3])
        return [float(force(tau)) - spring, spring]

    while now < t[-1]:
        count += 1

        def rhs(tau: float, y: Array) -> list[float]:
            a = [
                (P - c.sliding(v, way)) / m if way else 0.0
                for P, c, v, way, m in zip(needed(tau, y), contacts, y[1::2], ways, masses, strict=True)
            ]
            return [y[1], a[0], y[3], a[1]]

        def end(i: int) -> Callable[[float, Array], float]:
            way, c = ways[i], contacts[i]

            def left(tau: float, q: Array) -> float:
                return way * q[2 * i + 1] if way else c.Fs - abs(needed(tau, q)[i])

            left.terminal, left.direction = True, -1.0  # type: ignore[attr-defined]
            return left

        run: Any = solve_ivp(
            rhs,
            (now, t[-1]),
            y,
            "DOP853",
            events=[end(0), end(1)],
            rtol=1e-11,
            atol=1e-13,
            dense_output=True,
            max_step=0.01,
        )
        rows = slice(*np.searchsorted(t, [now, run.t[-1] if run.status == 1 else np.inf]))
        for name, values in zip(("x1", "v1", "x2", "v2"), run.sol(t[rows]), strict=True):
            found[name][rows] = values
        now, y = float(run.t[-1]), run.y[:, -1].copy()
        for i, times in enumerate(run.t_events if run.status == 1 else ()):
            if times.size:
                P = needed(now, y)[i]
                broke = not ways[i] or abs(P) > contacts[i].Fs
                y[2 * i + 1] = 0.0
                ways[i] = int(copysign(1.0, P)) if broke else 0
    return found


class Band:
    """The lowest and highest value of a curve around any time."""

    def __init__(self, t: Array, y: Array) -> None:
        self.t, self.levels = t, [(y, y)]
        while 2 ** len(self.levels) <= len(t):
            low, high = self.levels[-1]
            reach = 2 ** (len(self.levels) - 1)
            self.levels.append((np.minimum(low[:-reach], low[reach:]), np.maximum(high[:-reach], high[reach:])))

    def outside(self, t: Array, y: Array, late: Array | float) -> Array:
        """Return how far values are from all that the curve has within so many seconds."""
        first = np.searchsorted(self.t, t - late).clip(0, len(self.t) - 1)
        last = (np.searchsorted(self.t, t + late, "right") - 1).clip(first)
        level = np.floor(np.log2(last - first + 1)).astype(int)
        off = np.zeros(len(t))
        for n in np.unique(level):
            low, high = self.levels[n]
            rows, other = level == n, last - 2**n + 1
            lowest = np.minimum(low[first[rows]], low[other[rows]])
            highest = np.maximum(high[first[rows]], high[other[rows]])
            off[rows] = np.maximum(0.0, np.maximum(y[rows] - highest, lowest - y[rows]))
        return off
