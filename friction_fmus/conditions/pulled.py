"""Stick-slip of a mass that is pulled over a contact by a spring."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from friction_fmus.conditions.axis import fall_at
from friction_fmus.conditions.condition import Condition, above, at_most

PRECISION = 1e-4
"""Relative precision of critical speeds, stiffnesses and damping coefficients."""

MUCH_STIFFER = 100.0
"""Ratio to the present stiffness from which on a stiffer spring is no remedy."""

LARGEST_RATIO = 1e9
"""Largest ratio of a critical value to the present one that is searched."""


def sticks_again(
    m: float, k: float, damping: float, Fc: float, Fs: float, vs: float | None, delta: float, v: float
) -> bool:
    """Return whether a pulled mass that broke away comes to rest again.

    With w = V - v, the spring force q less its value in steady sliding at Coulomb friction, and the damping c,
    m w' = -q - c w + g(V - w) - Fc and q' = k w. The mass breaks away with w = V; it comes to rest again if w reaches V
    once more.
    """
    if at_most(Fs, Fc) or damping >= 2.0 * math.sqrt(k * m):
        return False
    if vs is None:
        return _sticks_after_a_jump(m, k, damping, Fs - Fc, v)
    from scipy.integrate import solve_ivp  # imported here, as few systems need it

    # in units of Fs - Fc, of the period / 2 pi and of the speed that they give
    time = math.sqrt(m / k)
    scale = (Fs - Fc) * time / m
    speed, fall_speed, c = v / scale, vs / scale, damping * time / m

    def force(w: float) -> float:
        return math.exp(-(min((abs(speed - w) / fall_speed), 1e3) ** delta)) if speed != w else 1.0

    def rates(_: float, y: np.ndarray) -> list[float]:
        w, q = y
        return [-q - c * w + force(w), w]

    def rests(_: float, y: np.ndarray) -> float:
        return float(speed - y[0])

    def turns(_: float, y: np.ndarray) -> float:
        return rates(0.0, y)[0]

    for event in (rests, turns):
        event.terminal = True  # type: ignore[attr-defined]
        event.direction = -1.0  # type: ignore[attr-defined]
    start = [speed, 1.0 - c * speed + max(1e-3 * min(1e-3, c * speed), 1e-12)]
    found = solve_ivp(rates, (0.0, 1e3), start, events=(rests, turns), rtol=1e-7, atol=1e-10)
    rested, turned = (y.size for y in found.y_events or ())
    # a maximum that just exceeds the speed may lie between two steps
    return bool(rested) or (bool(turned) and float(found.y[0, -1]) >= speed)


def _sticks_after_a_jump(m: float, k: float, damping: float, drop: float, v: float) -> bool:
    """Return whether the mass comes to rest again if friction drops at once; closed form.

    m w'' + c w' + k w = 0 with w = V, w' = -(Fs - Fc)/m: the first maximum of w, at which w' = 0, is at least V.
    """
    a = damping / (2.0 * m)
    b = math.sqrt(k / m - a * a)
    s = (-drop / m + a * v) / b  # w = exp(-a t) (V cos(b t) + s sin(b t))
    at = math.atan2(b * s - a * v, a * s + b * v) % math.pi  # w' = 0
    if v * math.cos(at) + s * math.sin(at) < 0.0:  # the minimum before
        at += math.pi
    return math.exp(-a * at / b) * (v * math.cos(at) + s * math.sin(at)) >= v


@cache
def critical_speed(m: float, k: float, damping: float, Fc: float, Fs: float, vs: float | None, delta: float) -> float:
    """Return the speed of pulling above which a mass that broke away does not stick again.

    For small damping and a sudden drop it is (Fs - Fc) / sqrt(2 pi c sqrt(k m)).

    Parameters
    ----------
    m, k, damping, Fc, Fs, vs, delta : float
        As in `sticks_again`.

    Returns
    -------
    float
        Critical speed [m/s]; 0 if the mass never sticks again, infinity if it does at every speed.
    """
    if at_most(Fs, Fc) or damping >= 2.0 * math.sqrt(k * m):
        return 0.0
    if damping <= 0.0:
        return math.inf
    guess = (Fs - Fc) / math.sqrt(2.0 * math.pi * damping * math.sqrt(k * m))
    return _last(lambda v: sticks_again(m, k, damping, Fc, Fs, vs, delta, v), guess)


def pulled_mass(
    m: float, k: float, damping: float, Fc: float, Fs: float, vs: float | None, delta: float, v: float
) -> Condition:
    """Check that a mass that is pulled by a spring ends in steady sliding.

    Parameters
    ----------
    m, k, damping, Fc, Fs, vs, delta, v : float
        As in `sticks_again`; the sign of `v` has no influence.

    Returns
    -------
    Condition
        Its value is the speed, its bound the critical speed [m/s]. The contact counts as rigid; bristles lower the
        critical speed.
    """
    speed = abs(v)
    critical = critical_speed(m, k, damping, Fc, Fs, vs, delta)

    def sticks(stiffness: float = k, coefficient: float = damping, static: float = Fs) -> bool:
        unstable = vs is not None and above(fall_at(Fc, static, vs, delta, speed), coefficient)
        return unstable or sticks_again(m, stiffness, coefficient, Fc, static, vs, delta, speed)

    ok = not sticks()
    if ok and speed < critical:
        critical = 0.0  # the mass creeps steadily below the Stribeck velocity
    remedies = []
    if not ok:
        if math.isfinite(critical):
            remedies.append(f"pull faster than {critical:.4g} m/s")
        if (stiffest := _last(lambda stiffness: sticks(stiffness), k)) < MUCH_STIFFER * k:
            remedies.append(f"use a spring stiffer than {stiffest:.4g} N/m")
        most = _last(lambda coefficient: sticks(coefficient=coefficient), max(damping, 1e-3 * math.sqrt(k * m)))
        remedies.append(f"raise the damping above {most:.4g} N.s/m")
        drop = 1.0 / _last(lambda inverse: sticks(static=Fc + 1.0 / inverse), 1.0 / (Fs - Fc))
        remedies.append(f"reduce Fs - Fc, {Fs - Fc:.4g} N, below {drop:.4g} N")
    return Condition(
        name="stick-slip cycle",
        ok=ok,
        value=speed,
        bound=critical,
        wrong=f"the spring of {k:.4g} N/m pulls the mass at {speed:.4g} m/s, which is not above the critical speed, "
        f"{critical:.4g} m/s",
        why=f"after break-away at Fs = {Fs:.4g} N friction falls to Fc = {Fc:.4g} N; the mass overtakes the pulled "
        "end, comes to rest, and the cycle repeats: it sticks and slips (this may be intended)",
        change=f"{', '.join(remedies[:-1])}, or {remedies[-1]}" if remedies else "no change is needed",
        source="Bo, Pavelescu, Wear 82, 1982 (critical velocity); rigid contact, computed here",
    )


def _last(sticks: Callable[[float], bool], guess: float) -> float:
    """Return the border above which something does not stick; infinity if there is none, 0 if it never sticks."""
    low, high = guess, guess
    while not sticks(low):
        low /= 2.0
        if low < guess / LARGEST_RATIO:
            return 0.0
    while sticks(high):
        high *= 2.0
        if high > guess * LARGEST_RATIO:
            return math.inf
    while high > (1.0 + PRECISION) * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if sticks(middle) else (low, middle)
    return high
