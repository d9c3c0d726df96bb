"""Conditions on encoders, cogging, belts, and stiffness fed back by a law."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from friction_fmus.conditions.condition import Condition, above, at_most, below
from friction_fmus.conditions.position_loop import steepest_fall


def encoder_count(q: float, Kp: float, Kd: float, F: float, window: float) -> Condition:
    """Check that one encoder count does not jerk the axis: Kp q + Kd q/window is below static friction.

    Parameters
    ----------
    q : float
        Resolution of the encoder [m].
    Kp, Kd : float
        Immediate response of all laws together to a step of position and of velocity [N/m, N.s/m].
    F : float
        Static friction [N].
    window : float
        Time over which the velocity is computed from positions [s]; infinity if a sensor measures it.

    Returns
    -------
    Condition
        Its value is the force step of one count, its bound static friction [N].
    """
    value = (abs(Kp) + abs(Kd) / window) * q
    return Condition(
        name="encoder",
        ok=below(value, F),
        value=value,
        bound=F,
        wrong=f"one count of the encoder, {q:.4g} m, changes the force by Kp q + Kd q/T = {value:.4g} N; static "
        f"friction is {F:.4g} N",
        why="the velocity computed from positions jumps by q/T with each count: slow motion is jerky, back and forth",
        change=f"use an encoder finer than {q * F / value if value > 0.0 else math.inf:.4g} m, compute the velocity "
        "over a longer time (Differentiator: window, tau), or lower Kd",
        source="balance of forces, with the difference quotient of a quantised position; derived here",
    )


def cogging_slope(pitch: float, amplitude: Sequence[float], phase: Sequence[float]) -> float:
    """Return the largest slope dF/dx of a cogging force sum A_k sin(2 pi k x/pitch + phi_k).

    Parameters
    ----------
    pitch : float
        Length of a period [m].
    amplitude, phase : sequence of float
        Amplitude [N] and phase [rad] of each harmonic.

    Returns
    -------
    float
        Largest slope [N/m]; 0 without harmonics.
    """
    place = np.linspace(0.0, 2.0 * math.pi, 4097)
    slopes = sum(k * A * np.cos(k * place + phi) for k, (A, phi) in enumerate(zip(amplitude, phase, strict=True), 1))
    return float(np.max(2.0 * math.pi / pitch * slopes)) if len(amplitude) else 0.0


def cogging(Kp: float, slope: float) -> Condition:
    """Check that a position loop holds every position against cogging: Kp, plus a spring to ground, exceeds max dF/dx.

    Parameters
    ----------
    Kp, slope : float
        Stiffness of the loop and `cogging_slope` [N/m].

    Returns
    -------
    Condition
        Its value is the stiffness of the loop, its bound the slope [N/m].
    """
    return Condition(
        name="cogging",
        ok=above(Kp, slope),
        value=Kp,
        bound=slope,
        wrong=f"the stiffness of the loop, {Kp:.4g} N/m, must be above the steepest rise of the cogging force, "
        f"{slope:.4g} N/m",
        why="between the magnets the loop has no stable equilibrium: the axis jumps from pitch to pitch",
        change=f"raise Kp above {slope:.4g} N/m, or compensate the cogging (TustinFeedback, IterativeLearning)",
        source="stability of an equilibrium in a potential; derived here",
    )


def fall_at(Fc: float, Fs: float, vs: float, delta: float, v: float) -> float:
    """Return how steeply the Stribeck curve falls at a speed, -g'(v) [N.s/m]; 0 at rest, see `steepest_fall`."""
    speed = abs(v)
    if speed == 0.0 or at_most(Fs, Fc) or steepest_fall(Fc, Fs, vs, delta) == 0.0:
        return 0.0
    power = min(delta * math.log(speed / vs), 700.0)
    return (Fs - Fc) * delta / speed * math.exp(power - math.exp(min(power, 6.5)))


def belt(damping: float, Fc: float, Fs: float, vs: float, delta: float, v: float) -> Condition:
    """Check that a mass on a belt slides steadily at the belt speed v: d + s2 + g'(v) > 0.

    Parameters
    ----------
    damping : float
        Damper to the wall plus viscous friction, d + s2 [N.s/m].
    Fc, Fs, vs, delta : float
        Coulomb friction [N], static friction [N], Stribeck velocity [m/s] and exponent of the Stribeck curve.
    v : float
        Speed of the belt [m/s].

    Returns
    -------
    Condition
        Its value is the damping, its bound the fall of friction -g'(v) [N.s/m].
    """
    speed, fall = abs(v), fall_at(Fc, Fs, vs, delta, v)
    return Condition(
        name="belt",
        ok=above(damping, fall),
        value=damping,
        bound=fall,
        wrong=f"at the belt speed, {speed:.4g} m/s, friction falls with speed by {fall:.4g} N.s/m; the damping is only "
        f"{damping:.4g} N.s/m",
        why="steady sliding is unstable at this speed: the mass sticks to the belt and slips (this may be intended)",
        change=f"raise the damping above {fall:.4g} N.s/m, or change the belt speed",
        source="Leine, van Campen, de Kraker, van den Steen, Nonlinear Dynamics 16, 1998; rigid contact, linearised",
    )


def fed_back_stiffness(fed_back: float, stiffness: float) -> Condition:
    """Check that a law feeds back less stiffness than contact and loop have: gain s0_hat is below s0 + Kp + k.

    Parameters
    ----------
    fed_back : float
        Contact stiffness in the law's model, times the gain of the law [N/m].
    stiffness : float
        Stiffness of the real contact, the position loop and a spring to ground together [N/m].

    Returns
    -------
    Condition
        Its value is the stiffness fed back, its bound the stiffness of contact and loop [N/m].
    """
    return Condition(
        name="fed-back stiffness",
        ok=below(fed_back, stiffness),
        value=fed_back,
        bound=stiffness,
        wrong=f"the law feeds back a stiffness of {fed_back:.4g} N/m; contact and loop have only {stiffness:.4g} N/m",
        why="the resulting stiffness in presliding is negative: the axis leaves presliding by itself, to one side and "
        "back",
        change=f"correct sigma0 of the law, or multiply its gain by {0.9 * stiffness / fed_back:.2g}"
        if fed_back > 0.0
        else "no change is needed",
        source="sum of stiffnesses at rest; derived here",
    )
