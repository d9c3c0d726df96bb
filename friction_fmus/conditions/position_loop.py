"""Conditions of a position loop around a mass with friction: u = Kp e + Kd (rd - v) + Ki times the integral of e."""

from __future__ import annotations

import math

import numpy as np

from friction_fmus.conditions.condition import Condition, above, at_least, at_most
from friction_fmus.conditions.linear import FASTEST, Matrix, held_mass, is_stable, longest_sample, spectral_radius


def routh(m: float, s2: float, Kp: float, Kd: float, Ki: float = 0.0, k: float = 0.0) -> Condition:
    """Stability of the linear loop in continuous time: (Kd + s2)(Kp + k) > m Ki, and no coefficient negative.

    Hurwitz condition of m s^3 + (Kd + s2) s^2 + (Kp + k) s + Ki.

    Parameters
    ----------
    m, s2, k : float
        Mass [kg], viscous friction [N.s/m], stiffness of a spring to the ground [N/m].
    Kp, Kd, Ki : float
        Gains [N/m, N.s/m, N/(m.s)].
    """
    damping, stiffness = Kd + s2, Kp + k
    value, bound = damping * stiffness, m * Ki
    positive = above(damping, 0.0, abs(Kd) + abs(s2)) and above(stiffness, 0.0, abs(Kp) + abs(k))
    if not positive:
        change = "give Kp and Kd positive values, and look for a wire with the wrong sign"
    elif Ki < 0.0:
        change = "make Ki positive or 0"
    else:
        change = f"lower Ki below {value / m:.4g} N/(m.s), or raise Kd above {bound / stiffness - s2:.4g} N.s/m"
    return Condition(
        name="Routh",
        ok=positive and Ki >= 0.0 and above(value, bound),
        value=value,
        bound=bound,
        wrong=f"(Kd + s2)(Kp + k) = {value:.4g} is to be above m Ki = {bound:.4g} N2.s/m2, all gains positive",
        why="the linear loop is unstable before any friction acts: it oscillates or runs away",
        change=change,
        source="Routh 1877; Astrom, Hagglund: Advanced PID Control, ISA 2006",
    )


def closed_loop(m: float, s2: float, Kp: float, Kd: float, Ki: float, Ts: float, k: float = 0.0) -> Matrix:
    """Step matrix of (x, v, integral) under the sampled law with the force held between samples; r = 0.

    Returns
    -------
    array, shape (3, 3), or (2, 2) for Ki = 0
        As in the law PID: the integral of a sample does not contain that sample's error.
    """
    A, b = held_mass(m, s2, k, Ts)
    moving = A - np.outer(b, [Kp, Kd])
    if Ki == 0.0:
        return moving
    loop = np.eye(3)
    loop[:2, :2] = moving
    loop[:2, 2] = Ki * b
    loop[2, 0] = -Ts
    return loop


def sampled(m: float, s2: float, Kp: float, Kd: float, Ki: float, Ts: float, k: float = 0.0) -> Condition:
    """Stability of the sampled loop: all eigenvalues of `closed_loop` within the unit circle.

    Parameters
    ----------
    m, s2, Kp, Kd, Ki, k : float
        As in `routh`.
    Ts : float
        Sample time [s].
    """

    def loop(time: float) -> Matrix:
        return closed_loop(m, s2, Kp, Kd, Ki, time, k)

    value, ok = spectral_radius(loop(Ts)), is_stable(loop(Ts))
    longest = 0.0 if ok else longest_sample(lambda time: is_stable(loop(time)), Ts)
    change = (
        f"sample faster than every {longest:.4g} s, or lower the gains"
        if longest
        else f"change the gains: no sample time of {1e6 * FASTEST:g} us or more helps, however fast the loop is sampled"
    )
    return Condition(
        name="sampled loop",
        ok=ok,
        value=value,
        bound=1.0,
        wrong=f"the largest eigenvalue of the loop sampled every {Ts:.4g} s has the magnitude {value:.4g}, not below 1",
        why="the force is held between the samples, a delay of half a sample time: the loop oscillates and grows",
        change=change,
        source="Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997",
    )


def steepest_fall(Fc: float, Fs: float, vs: float, delta: float = 2.0) -> float:
    """The steepest fall of the Stribeck curve, max -g'(v) [N.s/m], in closed form.

    g(v) = Fc + (Fs - Fc) exp(-(v/vs)^delta); the slope has its extremum where (v/vs)^delta = (delta - 1)/delta. For
    delta = 2 it is sqrt(2/e) (Fs - Fc)/vs, for delta < 1 there is none: infinite at v = 0.

    Parameters
    ----------
    Fc, Fs : float
        Coulomb and static friction [N]; 0 is returned where the curve does not fall.
    vs, delta : float
        Stribeck velocity [m/s] and exponent.
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
    """Steady motion at every speed: Kd + s2 above the steepest fall of the Stribeck curve.

    Parameters
    ----------
    Kd, s2 : float
        Derivative gain and viscous friction [N.s/m].
    Fc, Fs, vs, delta : float
        Stribeck curve [N, N, m/s], see `steepest_fall`.
    integral : float
        m Ki/Kp [N.s/m], which the integral takes from the damping (Routh); 0 without one.
    """
    fall = steepest_fall(Fc, Fs, vs, delta)
    value, bound = Kd + s2, fall + integral
    taken = f", {fall:.4g}, and m Ki/Kp, {integral:.4g}, together" if integral else ","
    change = (
        f"raise Kd above {bound - s2:.4g} N.s/m, or compensate the friction"
        if math.isfinite(bound)
        else "compensate the friction: with delta below 1 the curve is infinitely steep at rest and no Kd suffices"
    )
    return Condition(
        name="stick-slip",
        ok=above(value, bound, abs(Kd) + abs(s2)),
        value=value,
        bound=bound,
        wrong=f"Kd + s2 = {value:.4g} N.s/m is to be above the steepest fall of the Stribeck curve{taken} "
        f"{bound:.4g} N.s/m",
        why="where friction falls faster with speed than the loop damps, slow steady motion is unstable: it sticks "
        "and slips",
        change=change,
        source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; rigid contact, derived here",
    )


def hunting(Ki: float, Fc: float, Fs: float) -> Condition:
    """No limit cycle at rest: an integral and static friction above Coulomb friction do not go together.

    Parameters
    ----------
    Ki : float
        Integral gain [N/(m.s)].
    Fc, Fs : float
        Coulomb and static friction [N].
    """
    return Condition(
        name="hunting",
        ok=not (Ki > 0.0 and above(Fs, Fc)),
        value=Fs,
        bound=Fc,
        wrong=f"the position loop has an integral, Ki = {Ki:.4g} N/(m.s), and static friction, {Fs:.4g} N, is above "
        f"Coulomb friction, {Fc:.4g} N",
        why="around a constant reference the integral winds up to Fs, the axis slips too far, and so on: it hunts, "
        "with every set of gains that is stable",
        change="use a dead-band in the integral, to each side at least half as wide as a slip, or Ki = 0 with friction "
        "compensation",
        source="Armstrong, Amin, Automatica 32(5), 1996",
    )


def expected_slip(m: float, s2: float, Kp: float, Kd: float, Fc: float, Fs: float) -> float:
    """How far a rigid mass slips once static friction lets it go, in closed form [m].

    Friction falls from Fs to Fc at once and the integral stands still: the mass moves as m x'' + (Kd + s2) x' + Kp x =
    Fs - Fc from rest until it stops. A real contact, whose friction falls less abruptly, slips less.

    Parameters
    ----------
    m, s2, Kp, Kd, Fc, Fs : float
        As in `routh` and `hunting`; Kp must be positive.
    """
    damping = (Kd + s2) / (2.0 * math.sqrt(Kp * m))
    overshoot = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)) if damping < 1.0 else 0.0
    return max(Fs - Fc, 0.0) / Kp * (1.0 + overshoot)


def dead_band(db: float, slip: float) -> Condition:
    """A dead-band ends hunting if a slip from its one edge does not leave it at the other: 2 db >= slip.

    Parameters
    ----------
    db : float
        Error up to which the integral is held [m].
    slip : float
        Expected slip [m], see `expected_slip`.
    """
    return Condition(
        name="dead-band",
        ok=at_least(2.0 * db, slip),
        value=2.0 * db,
        bound=slip,
        wrong=f"the dead-band of {-db:.4g} m to {db:.4g} m is narrower than a slip, {slip:.4g} m",
        why="a slip that begins at one edge ends beyond the other: the integral turns round and the axis hunts, maybe "
        "in wider movements than without the dead-band",
        change=f"make db at least {slip / 2.0:.4g} m, or raise Kp and Kd until slips are shorter",
        source="derived here for a rigid contact, from Armstrong, Amin, Automatica 32(5), 1996",
    )
