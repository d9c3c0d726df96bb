"""Conditions on a position loop around a mass with friction: u = Kp e + Kd (rd - v) + Ki times the integral of e."""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.condition import Condition, Matrix, above, at_most, below, compared, held_mass

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
        "dither stroke",
        *compared(above, stroke, bound),
        wrong=f"the stroke of the dither, Ad/(m (2 pi f)^2) = {stroke:.4g} {{m}}, must be above the presliding range "
        f"F/s0 = {bound:.4g} {{m}}",
        why="the contact follows much of the dither elastically: dither reduces friction by about half or less",
        change=f"raise Ad above {bound * m * w**2:.4g} {{N}}, or lower the frequency below "
        f"{math.sqrt(Ad * s0 / (m * F)) / (2.0 * math.pi) if F > 0.0 else math.inf:.4g} Hz",
        source="mean friction under a sliding dither: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), "
        "1994; bound derived here",
    )


def routh(m: float, s2: float, Kp: float, Kd: float, Ki: float = 0.0) -> Condition:
    """Check that the linear loop is stable in continuous time: (Kd + s2) Kp > m Ki, no coefficient negative.

    This is the Hurwitz condition of m s^3 + (Kd + s2) s^2 + Kp s + Ki.

    Parameters
    ----------
    m, s2 : float
        Mass [kg] and viscous friction [N.s/m].
    Kp, Kd, Ki : float
        Gains [N/m, N.s/m, N/(m.s)].

    Returns
    -------
    Condition
        Its value is (Kd + s2) Kp, its bound m Ki [N2.s/m2].
    """
    value, bound = (Kd + s2) * Kp, m * Ki
    positive = above(Kd + s2, 0.0, abs(Kd) + abs(s2)) and above(Kp, 0.0)
    if not positive:
        change = "make Kp and Kd positive, and look for a connection with the wrong sign"
    elif Ki < 0.0:
        change = "make Ki positive or 0"
    else:
        change = f"lower Ki below {value / m:.4g} {{N_ms}}, or raise Kd above {bound / Kp - s2:.4g} {{Ns_m}}"
    return Condition(
        name="Routh",
        ok=positive and Ki >= 0.0 and above(value, bound),
        value=value,
        bound=bound,
        wrong=f"(Kd + s2) Kp = {value:.4g} must be above m Ki = {bound:.4g} {{N2s_m2}}, with all gains positive",
        why="the linear loop is unstable even without friction: it oscillates or diverges",
        change=change,
        source="Routh 1877; Astrom, Hagglund: Advanced PID Control, ISA 2006",
    )


def closed_loop(m: float, s2: float, Kp: float, Kd: float, Ki: float, Ts: float) -> Matrix:
    """Return the step matrix of (x, v, integral) under the sampled law, with the force held between samples and r = 0.

    Parameters
    ----------
    m, s2, Kp, Kd, Ki : float
        As in `routh`.
    Ts : float
        Sample time [s].

    Returns
    -------
    array, shape (3, 3), or (2, 2) for Ki = 0
        Step matrix. As in the law PID, the integral at a sample excludes the error of that sample.
    """
    A, b = held_mass(m, s2, Ts)
    moving = A - np.outer(b, [Kp, Kd])
    if Ki == 0.0:
        return moving
    loop = np.eye(3)
    loop[:2, :2] = moving
    loop[:2, 2] = Ki * b
    loop[2, 0] = -Ts
    return loop


def steepest_fall(Fc: float, Fs: float, vs: float, delta: float = 2.0) -> float:
    """Return the steepest fall of the Stribeck curve, max -g'(v), in closed form.

    g(v) = Fc + (Fs - Fc) exp(-(v/vs)^delta); its slope has the extremum at (v/vs)^delta = (delta - 1)/delta. For
    delta = 2 the result is sqrt(2/e) (Fs - Fc)/vs; for delta < 1 it is infinite, at v = 0.

    Parameters
    ----------
    Fc, Fs : float
        Coulomb and static friction [N].
    vs, delta : float
        Stribeck velocity [m/s] and exponent.

    Returns
    -------
    float
        Steepest fall [N.s/m]; 0 if Fs is not above Fc.
    """
    if at_most(Fs, Fc):
        return 0.0
    if delta < 1.0:
        return math.inf
    share = (delta - 1.0) / delta
    return (Fs - Fc) / vs * delta * math.pow(share, share) * math.exp(-share)


def stick_slip_free(
    Kd: float, s2: float, Fc: float, Fs: float, vs: float, delta: float = 2.0, integral: float = 0.0
) -> Condition:
    """Check that motion is steady at every speed: Kd + s2 is above the steepest fall of the Stribeck curve.

    Parameters
    ----------
    Kd, s2 : float
        Derivative gain and viscous friction [N.s/m].
    Fc, Fs, vs, delta : float
        Stribeck curve, see `steepest_fall` [N, N, m/s].
    integral : float
        Damping lost to the integral action, m Ki/Kp by Routh's condition [N.s/m]; 0 without integral action.

    Returns
    -------
    Condition
        Its value is Kd + s2, its bound the steepest fall plus `integral` [N.s/m].
    """
    fall = steepest_fall(Fc, Fs, vs, delta)
    value, bound = Kd + s2, fall + integral
    taken = f", {fall:.4g}, plus m Ki/Kp, {integral:.4g}, in total" if integral else ","
    change = (
        f"raise Kd above {bound - s2:.4g} {{Ns_m}}, or compensate the friction"
        if math.isfinite(bound)
        else "compensate the friction: with delta below 1 the curve is infinitely steep at v = 0 and no Kd suffices"
    )
    return Condition(
        name="stick-slip",
        ok=above(value, bound, abs(Kd) + abs(s2)),
        value=value,
        bound=bound,
        wrong=f"Kd + s2 = {value:.4g} {{Ns_m}} must be above the steepest fall of the Stribeck curve{taken} "
        f"{bound:.4g} {{Ns_m}}",
        why="friction falls with speed faster than the loop's damping can make up for: slow motion is unstable "
        "(stick-slip)",
        change=change,
        source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; rigid contact, derived here",
    )


def hunting(
    Ki: float,
    Fc: float,
    Fs: float,
    slip: float = math.inf,
    deflection: float = 0.0,
) -> Condition:
    """Check that no limit cycle occurs at rest: no integral action, or static friction not above Coulomb friction.

    An integral that moves the axis within the deflection of its contact only lets it creep to the reference.

    Parameters
    ----------
    Ki : float
        Integral gain [N/(m.s)].
    Fc, Fs : float
        Coulomb and static friction [N].
    slip, deflection : float
        Length of a slip, see `expected_slip`, and deflection of the contact at break-away [m].

    Returns
    -------
    Condition
        Its value is static, its bound Coulomb friction [N]; it holds for Ki = 0. It also holds if a slip is not longer
        than the deflection, which are then value and bound [m].
    """
    rests = Ki > 0.0 and slip <= deflection
    return Condition(
        name="hunting",
        ok=not (Ki > 0.0 and above(Fs, Fc)) or rests,
        value=slip if rests else Fs,
        bound=deflection if rests else Fc,
        wrong=f"the position loop has integral action, Ki = {Ki:.4g} {{N_ms}}, and static friction, {Fs:.4g} {{N}}, is "
        f"above Coulomb friction, {Fc:.4g} {{N}}",
        why="at a constant reference the integral winds up to Fs, the axis slips too far, and the cycle repeats: the "
        "axis can hunt with any stable set of gains",
        change="stop the integrator while the error is smaller than half a slip (dead band), or use Ki = 0 with "
        "friction compensation",
        source="Armstrong, Amin, Automatica 32(5), 1996",
    )


def expected_slip(m: float, s2: float, Kp: float, Kd: float, Fc: float, Fs: float) -> float:
    """Return how far a rigid mass slips after break-away, in closed form.

    Friction falls from Fs to Fc at once and the integral stays constant: the mass moves as m x'' + (Kd + s2) x' + Kp x
    = Fs - Fc from rest until it stops. A real contact, whose friction falls less abruptly, slips less.

    Parameters
    ----------
    m, s2, Kp, Kd, Fc, Fs : float
        As in `routh` and `hunting`; Kp must be positive.

    Returns
    -------
    float
        Length of the slip [m]; infinite for a damping ratio up to -1.
    """
    damping = (Kd + s2) / (2.0 * math.sqrt(Kp * m))
    if damping <= -1.0:
        return math.inf
    overshoot = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)) if damping < 1.0 else 0.0
    return max(Fs - Fc, 0.0) / Kp * (1.0 + overshoot)


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
        "encoder",
        *compared(below, value, F),
        wrong=f"one count of the encoder, {q:.4g} {{m}}, changes the {{force}} by Kp q + Kd q/T = {value:.4g} {{N}}; "
        f"static friction is {F:.4g} {{N}}",
        why="the velocity computed from positions jumps by q/T with each count: slow motion is jerky, back and forth",
        change=f"use an encoder finer than {q * F / value if value > 0.0 else math.inf:.4g} {{m}}, compute the "
        "velocity over a longer time (Differentiator: window, tau), or lower Kd",
        source="balance of {force}s, with the difference quotient of a quantised position; derived here",
    )
