"""Conditions of what is around the loop: encoders, cogging, belts, and stiffness that a law feeds back."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from friction_fmus.conditions.condition import Condition, above, at_most, below
from friction_fmus.conditions.position_loop import steepest_fall


def encoder_count(q: float, Kp: float, Kd: float, F: float, window: float) -> Condition:
    """A count of the encoder does not jolt the axis: Kp q + Kd q/window is below static friction.

    Parameters
    ----------
    q : float
        Step of the encoder [m].
    Kp, Kd : float
        What a step of position and of velocity gives at once [N/m, N.s/m], of all laws together.
    F : float
        Static friction [N].
    window : float
        Time over which the velocity is taken from positions [s]; infinity for a sensor of its own.
    """
    value = (abs(Kp) + abs(Kd) / window) * q
    return Condition(
        name="encoder",
        ok=below(value, F),
        value=value,
        bound=F,
        wrong=f"one count of the encoder, {q:.4g} m, changes the force by Kp q + Kd q/T = {value:.4g} N; static "
        f"friction is {F:.4g} N",
        why="the velocity from positions jumps by q/T with each count: slow motion goes by jolts, forward and back",
        change=f"use an encoder finer than {q * F / value if value > 0.0 else math.inf:.4g} m, take the velocity over "
        "a longer time (Differentiator: window, tau), or lower Kd",
        source="balance of forces, with the quotient of a quantised position; derived here",
    )


def cogging_slope(pitch: float, amplitude: Sequence[float], phase: Sequence[float]) -> float:
    """The largest slope dF/dx of a cogging force sum A_k sin(2 pi k x/pitch + phi_k) [N/m].

    Parameters
    ----------
    pitch : float
        Length of a period [m].
    amplitude, phase : sequence of float
        Of each harmonic [N, rad].
    """
    place = np.linspace(0.0, 2.0 * math.pi, 4097)
    slopes = sum(k * A * np.cos(k * place + phi) for k, (A, phi) in enumerate(zip(amplitude, phase, strict=True), 1))
    return float(np.max(2.0 * math.pi / pitch * slopes)) if len(amplitude) else 0.0


def cogging(Kp: float, slope: float) -> Condition:
    """A position loop holds every position against cogging: Kp, with a spring to the ground, is above max dF/dx.

    Parameters
    ----------
    Kp, slope : float
        Stiffness of the loop and `cogging_slope` [N/m].
    """
    return Condition(
        name="cogging",
        ok=above(Kp, slope),
        value=Kp,
        bound=slope,
        wrong=f"the stiffness of the loop, {Kp:.4g} N/m, is to be above the steepest rise of the cogging force, "
        f"{slope:.4g} N/m",
        why="between the magnets the loop has no stable rest: the axis jumps from pitch to pitch",
        change=f"raise Kp above {slope:.4g} N/m, or compensate the cogging (TustinFeedback, IterativeLearning)",
        source="stability of an equilibrium in a potential; derived here",
    )


def belt(damping: float, Fc: float, Fs: float, vs: float, delta: float, v: float) -> Condition:
    """A mass on a belt slides steadily at the speed v if d + s2 + g'(v) > 0.

    Parameters
    ----------
    damping : float
        Damper to the wall and viscous friction together [N.s/m].
    Fc, Fs, vs, delta : float
        Stribeck curve [N, N, m/s].
    v : float
        Speed of the belt [m/s].
    """
    speed = abs(v)
    if speed == 0.0 or at_most(Fs, Fc) or steepest_fall(Fc, Fs, vs, delta) == 0.0:
        fall = 0.0
    else:
        power = min(delta * math.log(speed / vs), 700.0)
        fall = (Fs - Fc) * delta / speed * math.exp(power - math.exp(min(power, 6.5)))
    return Condition(
        name="belt",
        ok=above(damping, fall),
        value=damping,
        bound=fall,
        wrong=f"at the speed of the belt, {speed:.4g} m/s, friction falls by {fall:.4g} N.s/m; the damping is "
        f"{damping:.4g} N.s/m",
        why="steady sliding is unstable at this speed: the mass sticks to the belt and slips (which may be what the "
        "experiment is to show)",
        change=f"raise the damping above {fall:.4g} N.s/m, or move the belt at another speed",
        source="Leine, van Campen, de Kraker, van den Steen, Nonlinear Dynamics 16, 1998; rigid contact, linearised",
    )


def fed_back_stiffness(fed_back: float, stiffness: float) -> Condition:
    """A law that feeds the contact's stiffness back leaves some: gain s0_hat is below s0 + Kp + k.

    Parameters
    ----------
    fed_back : float
        Stiffness of the model of the law, times its gain [N/m].
    stiffness : float
        Of the real contact, the position loop and a spring to the ground together [N/m].
    """
    return Condition(
        name="fed-back stiffness",
        ok=below(fed_back, stiffness),
        value=fed_back,
        bound=stiffness,
        wrong=f"the law feeds back the stiffness {fed_back:.4g} N/m; contact and loop have {stiffness:.4g} N/m",
        why="the sum is negative before the contact slides: the axis runs out of presliding by itself, to one side and "
        "back",
        change=f"correct sigma0 of the law, or multiply its gain by {0.9 * stiffness / fed_back:.2g}"
        if fed_back > 0.0
        else "leave it as it is",
        source="sum of stiffnesses at rest; derived here",
    )
