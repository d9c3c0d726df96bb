"""Conditions on laws that overcome friction with dither or force pulses."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.condition import Condition, above, at_least, at_most, below, first_largest
from friction_fmus.conditions.linear import held_mass

Array: TypeAlias = NDArray[np.float64]


def dither_stroke(Ad: float, f: float, m: float, F: float, s0: float) -> Condition:
    """Check that dither slides and so smooths friction: its stroke Ad/(m (2 pi f)^2) exceeds the presliding range F/s0.

    Parameters
    ----------
    Ad, f : float
        Amplitude [N] and frequency [Hz] of the force.
    m : float
        Mass [kg].
    F, s0 : float
        Friction to overcome [N] and stiffness of the contact [N/m].

    Returns
    -------
    Condition
        Its value is the stroke, its bound the presliding range [m].
    """
    w = 2.0 * math.pi * f
    stroke = Ad / (m * w**2) if w > 0.0 else math.inf
    bound = F / s0
    return Condition(
        name="dither stroke",
        ok=above(stroke, bound),
        value=stroke,
        bound=bound,
        wrong=f"the stroke of the dither, Ad/(m (2 pi f)^2) = {stroke:.4g} m, must be above the presliding range "
        f"F/s0 = {bound:.4g} m",
        why="the contact follows much of the dither elastically: dither reduces friction by about half or less",
        change=f"raise Ad above {bound * m * w**2:.4g} N, or lower the frequency below "
        f"{math.sqrt(Ad * s0 / (m * F)) / (2.0 * math.pi) if F > 0.0 else math.inf:.4g} Hz",
        source="mean friction under a sliding dither: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), "
        "1994; bound derived here",
    )


def dither_frequency(f: float, Ts: float) -> Condition:
    """Check that the dither frequency is below half the sample rate: f < 1/(2 Ts).

    Parameters
    ----------
    f, Ts : float
        Frequency [Hz] and sample time [s] of the dither.

    Returns
    -------
    Condition
        Its value is the frequency, its bound half the sample rate [Hz].
    """
    bound = 0.5 / Ts
    return Condition(
        name="dither frequency",
        ok=below(f, bound),
        value=f,
        bound=bound,
        wrong=f"the dither frequency, {f:.4g} Hz, must be below half the sample rate, 1/(2 Ts) = {bound:.4g} Hz",
        why="the sampled dither is aliased: it acts at a lower frequency, or is constant",
        change=f"lower the frequency to about {0.2 * bound:.4g} Hz, or sample the dither every {0.1 / f:.4g} s"
        if f > 0.0
        else "set a frequency above 0",
        source="sampling theorem: Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997",
    )


def _breaks_away(Fp: float, Fc: float, Fs: float) -> bool:
    """Return whether a pulse moves the mass. A pulse equal to static friction does, because laws choose that force."""
    return at_least(Fp, Fs) and above(Fp, Fc)


def slide(Fp: float, Fc: float, Fs: float, tp: float, m: float) -> float:
    """Return how far a rigid mass slides under one force pulse, Fp (Fp - Fc) tp^2/(2 m Fc).

    Parameters
    ----------
    Fp : float
        Force of the pulse [N].
    Fc, Fs : float
        Coulomb and static friction [N].
    tp : float
        Length of the pulse [s].
    m : float
        Mass [kg].

    Returns
    -------
    float
        Distance [m]; 0 below static friction.
    """
    return Fp * (Fp - Fc) * tp**2 / (2.0 * m * Fc) if _breaks_away(Fp, Fc, Fs) else 0.0


def slide_in_loop(
    errors: Array, forces: Array, Fc: float, Fs: float, tp: float, m: float, Kp: float, Kd: float
) -> Array:
    """Return how far a rigid mass slides under each force pulse if a PD controller acts from the end of the pulse on.

    Parameters
    ----------
    errors, forces : array, shape (n,)
        Position error at the start [m] and force [N] of each pulse.
    Fc, Fs, tp, m : float
        As in `slide`.
    Kp, Kd : float
        Gains of the controller [N/m, N.s/m].

    Returns
    -------
    array, shape (n,)
        Distances [m], computed in exact steps of tp/20 until the mass stops.
    """
    moves = np.array([_breaks_away(float(F), Fc, Fs) for F in forces])
    v = np.where(moves, (forces - Fc) * tp / m, 0.0)
    x = v * tp / 2.0
    A, b = held_mass(m, Kd, Kp, tp / 20.0)
    for _ in range(20_000):
        if not moves.any():
            break
        # the force of Kp vanishes where the error is 0
        y = x - errors
        after, v_after = A[0, 0] * y + A[0, 1] * v - b[0] * Fc, A[1, 0] * y + A[1, 1] * v - b[1] * Fc
        moves = moves & (v_after > 0.0)
        x = np.where(moves, after + errors, x)
        v = np.where(moves, v_after, v)
    return x


def pulses(
    errors: Array, forces: Array, Fc: float, Fs: float, tp: float, m: float, Kp: float = 0.0, Kd: float = 0.0
) -> Condition:
    """Check that pulses reduce the error: each one slides by d with 0 < d/e < 2, for every error e that triggers it.

    Parameters
    ----------
    errors : array, shape (n,)
        Errors that trigger a pulse, from the tolerance up [m].
    forces : array, shape (n,)
        Force of the pulse for each error [N].
    Fc, Fs, tp, m, Kp, Kd : float
        As in `slide_in_loop`: friction of the axis, length of a pulse, mass, gains of the position loop.

    Returns
    -------
    Condition
        Its value is the d/e that differs most from 1, its bound 0 or 2.
    """
    if Kp or Kd:
        ratio = slide_in_loop(errors, forces, Fc, Fs, tp, m, Kp, Kd) / errors
    else:
        ratio = np.array([slide(float(F), Fc, Fs, tp, m) for F in forces]) / errors
    worst = first_largest(np.abs(ratio - 1.0).tolist())
    value, e, F = float(ratio[worst]), float(errors[worst]), float(forces[worst])
    stuck = at_most(value, 0.0)
    return Condition(
        name="pulses",
        ok=not stuck and below(value, 2.0),
        value=value,
        bound=0.0 if stuck else 2.0,
        wrong=f"a pulse of {F:.4g} N for {tp:.4g} s slides d = {value * e:.4g} m at an error e = {e:.4g} m; "
        f"d/e = {value:.4g} must be between 0 and 2",
        why="the pulse does not break the axis away: the error remains"
        if stuck
        else "each slide overshoots by more than the original error: the pulses alternate in direction and do not end",
        change=f"use pulses of at least the static friction, {Fs:.4g} N"
        if stuck
        else "make the pulses shorter (n_pulse), the tolerance larger, or correct m, Fc and Fs of the law",
        source="Newton's law for a rigid mass with Coulomb friction; Armstrong-Helouvry, Dupont, Canudas de Wit, "
        "Automatica 30(7), 1994",
    )
