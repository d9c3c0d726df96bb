"""Conditions on a position loop around a mass with friction: u = Kp e + Kd (rd - v) + Ki times the integral of e."""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.condition import (
    FASTEST,
    Condition,
    Matrix,
    above,
    at_least,
    at_most,
    below,
    compared,
    first_largest,
    held_mass,
    is_stable,
    longest_sample,
    spectral_radius,
)

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
        "dither frequency",
        *compared(below, f, bound),
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
        wrong=f"a pulse of {F:.4g} {{N}} for {tp:.4g} s slides d = {value * e:.4g} {{m}} at an error e = {e:.4g} "
        f"{{m}}; d/e = {value:.4g} must be between 0 and 2",
        why="the pulse does not break the axis away: the error remains"
        if stuck
        else "each slide overshoots by more than the original error: the pulses alternate in direction and do not end",
        change=f"use pulses of at least the static friction, {Fs:.4g} {{N}}"
        if stuck
        else "make the pulses shorter (n_pulse), the tolerance larger, or correct m, Fc and Fs of the law",
        source="Newton's law for a rigid {mass} with Coulomb friction; Armstrong-Helouvry, Dupont, Canudas de Wit, "
        "Automatica 30(7), 1994",
    )


def routh(m: float, s2: float, Kp: float, Kd: float, Ki: float = 0.0, k: float = 0.0) -> Condition:
    """Check that the linear loop is stable in continuous time: (Kd + s2)(Kp + k) > m Ki, no coefficient negative.

    This is the Hurwitz condition of m s^3 + (Kd + s2) s^2 + (Kp + k) s + Ki.

    Parameters
    ----------
    m, s2 : float
        Mass [kg] and viscous friction [N.s/m].
    Kp, Kd, Ki : float
        Gains [N/m, N.s/m, N/(m.s)].
    k : float
        Stiffness of a spring to ground [N/m].

    Returns
    -------
    Condition
        Its value is (Kd + s2)(Kp + k), its bound m Ki [N2.s/m2].
    """
    damping, stiffness = Kd + s2, Kp + k
    value, bound = damping * stiffness, m * Ki
    positive = above(damping, 0.0, abs(Kd) + abs(s2)) and above(stiffness, 0.0, abs(Kp) + abs(k))
    if not positive:
        change = "make Kp and Kd positive, and look for a connection with the wrong sign"
    elif Ki < 0.0:
        change = "make Ki positive or 0"
    else:
        change = f"lower Ki below {value / m:.4g} {{N_ms}}, or raise Kd above {bound / stiffness - s2:.4g} {{Ns_m}}"
    return Condition(
        name="Routh",
        ok=positive and Ki >= 0.0 and above(value, bound),
        value=value,
        bound=bound,
        wrong=f"(Kd + s2)(Kp + k) = {value:.4g} must be above m Ki = {bound:.4g} {{N2s_m2}}, with all gains positive",
        why="the linear loop is unstable even without friction: it oscillates or diverges",
        change=change,
        source="Routh 1877; Astrom, Hagglund: Advanced PID Control, ISA 2006",
    )


def closed_loop(m: float, s2: float, Kp: float, Kd: float, Ki: float, Ts: float, k: float = 0.0) -> Matrix:
    """Return the step matrix of (x, v, integral) under the sampled law, with the force held between samples and r = 0.

    Parameters
    ----------
    m, s2, Kp, Kd, Ki : float
        As in `routh`.
    Ts : float
        Sample time [s].
    k : float
        Stiffness of a spring to ground [N/m].

    Returns
    -------
    array, shape (3, 3), or (2, 2) for Ki = 0
        Step matrix. As in the law PID, the integral at a sample excludes the error of that sample.
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
    """Check that the sampled loop is stable: all eigenvalues of `closed_loop` are within the unit circle.

    Parameters
    ----------
    m, s2, Kp, Kd, Ki : float
        As in `routh`.
    Ts : float
        Sample time [s].
    k : float
        Stiffness of a spring to ground [N/m].

    Returns
    -------
    Condition
        Its value is the largest magnitude of the eigenvalues, its bound 1.
    """

    def loop(time: float) -> Matrix:
        return closed_loop(m, s2, Kp, Kd, Ki, time, k)

    value, ok = spectral_radius(loop(Ts)), is_stable(loop(Ts))
    longest = 0.0 if ok else longest_sample(lambda time: is_stable(loop(time)), Ts)
    change = (
        f"sample faster than every {longest:.4g} s, or lower the gains"
        if longest
        else f"change the gains: no sample time of {1e6 * FASTEST:g} us or more makes the loop stable"
    )
    return Condition(
        name="sampled loop",
        ok=ok,
        value=value,
        bound=1.0,
        wrong=f"the largest eigenvalue of the loop sampled every {Ts:.4g} s has the magnitude {value:.4g}, not below 1",
        why="holding the {force} between samples delays it by half a sample time: the loop oscillates and grows",
        change=change,
        source="Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997",
    )


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
    turned: bool = False,
    elastic: bool = True,
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
    turned : bool
        Whether the integral, or friction in it, changes its sign at reversals. The cycle is then usually much smaller,
        but no closed form says by how much, and it does not end.
    elastic : bool
        Whether the contact springs back after a slip, which a turned integral needs.
    slip, deflection : float
        Length of a slip, see `expected_slip`, and deflection of the contact at break-away [m].

    Returns
    -------
    Condition
        Its value is static, its bound Coulomb friction [N]; it holds for Ki = 0. It also holds if a slip is not longer
        than the deflection, which are then value and bound [m].
    """
    why = (
        "at a constant reference the integral winds up to Fs, the axis slips too far, and the cycle repeats: the axis "
        "can hunt with any stable set of gains"
    )
    change = (
        "stop the integrator while the error is smaller than half a slip (dead band), or use Ki = 0 with friction "
        "compensation"
    )
    if turned and elastic:
        why += (
            "; as the integral is turned at reversals, the swing is usually far smaller, but only if the contact "
            "springs back after a slip faster than v_zc; otherwise it is larger"
        )
        change = f"keep v_zc between velocity noise and spring-back if a small swing is allowed, or {change}"
    elif turned:
        why += "; a rigid contact does not spring back, so the integral is turned after the next break-away only"
    rests = Ki > 0.0 and slip <= deflection
    return Condition(
        name="hunting",
        ok=not (Ki > 0.0 and above(Fs, Fc)) or rests,
        value=slip if rests else Fs,
        bound=deflection if rests else Fc,
        wrong=f"the position loop has integral action, Ki = {Ki:.4g} {{N_ms}}, and static friction, {Fs:.4g} {{N}}, is "
        f"above Coulomb friction, {Fc:.4g} {{N}}",
        why=why,
        change=change,
        source="Armstrong, Amin, Automatica 32(5), 1996" + ("; turned integral: simulations here" if turned else ""),
    )


def turned_friction(Fc_turned: float, Fc: float) -> Condition:
    """Check that an integral which is turned at reversals does not drive the axis: Fc_turned <= Fc.

    At a reversal the force changes by 2 Fc_turned, and friction by 2 Fc.

    Parameters
    ----------
    Fc_turned : float
        Coulomb friction that is turned in the integral [N].
    Fc : float
        Coulomb friction [N].

    Returns
    -------
    Condition
        Its value is Fc_turned, its bound Fc [N].
    """
    return Condition(
        "turned friction",
        *compared(at_most, Fc_turned, Fc),
        wrong=f"Fc_turned = {Fc_turned:.4g} {{N}} is above Coulomb friction, {Fc:.4g} {{N}}",
        why=f"at a reversal the integral pushes with up to {2.0 * max(Fc_turned - Fc, 0.0):.4g} {{N}} more than "
        "friction resists and drives the axis",
        change=f"lower Fc_turned to at most {Fc:.4g} {{N}}",
        source="balance of {force}s, derived here",
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


def dead_band(db: float, slip: float) -> Condition:
    """Check that a dead-band ends hunting: it is at least as wide as a slip, 2 db >= slip.

    Parameters
    ----------
    db : float
        Error up to which the integral is held [m].
    slip : float
        Length of the slip, see `expected_slip` [m].

    Returns
    -------
    Condition
        Its value is 2 db, its bound the slip [m].
    """
    return Condition(
        "dead-band",
        *compared(at_least, 2.0 * db, slip),
        wrong=f"the dead-band from {-db:.4g} {{m}} to {db:.4g} {{m}} is narrower than a slip of {slip:.4g} {{m}}",
        why="a slip that starts at one edge ends beyond the other: the integral changes direction and the axis hunts, "
        "possibly with a larger amplitude than without the dead-band",
        change=f"make db at least {slip / 2.0:.4g} {{m}}, or raise Kp and Kd to shorten the slip",
        source="derived here for a rigid contact, from Armstrong, Amin, Automatica 32(5), 1996",
    )
