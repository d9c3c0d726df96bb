"""Conditions on friction compensation: observers, their sample time, and the amount of compensation."""

import math
from typing import Final

import numpy as np

from friction_fmus.conditions.condition import (
    Condition,
    above,
    at_least,
    at_most,
    below,
    compared,
)

MOST_PREVIEW: Final = 1024  # longest preview that is recommended, in samples: the limit of DiscreteInverse


def break_away(most: float, Fs: float, direction: str = "forward") -> Condition:
    """Check that the drive can break the axis away: the largest force behind all limits is above static friction.

    Parameters
    ----------
    most : float
        Largest force of the drive in this direction [N].
    Fs : float
        Static friction [N].
    direction : str
        ``forward`` or ``backward``, for the text.

    Returns
    -------
    Condition
        Its value is the largest force, its bound static friction [N].
    """
    return Condition(
        "break-away",
        *compared(above, most, Fs),
        wrong=f"the largest {{force}} {direction}, behind all limits, is {most:.4g} {{N}}; static friction is "
        f"{Fs:.4g} {{N}}",
        why="the drive cannot start a slow motion in that direction: the axis sticks",
        change=f"raise the limits of the law and of the actuator above {Fs:.4g} {{N}}",
        source="balance of {force}s at rest",
    )


def sliding_gain(K: float, F: float) -> Condition:
    """Check that a set-valued sliding mode reaches s = 0: its gain covers the remaining friction, K >= F.

    Parameters
    ----------
    K : float
        Gain of the sign function [N].
    F : float
        Largest friction that no other law compensates [N].

    Returns
    -------
    Condition
        Its value is K, its bound F [N].
    """
    return Condition(
        "sliding gain",
        *compared(at_least, K, F),
        wrong=f"the gain of the sliding mode, K = {K:.4g} {{N}}, must be at least the remaining friction, {F:.4g} "
        f"{{N}}",
        why="the axis does not reach the sliding surface: it sticks away from its target, and a larger s does not "
        "increase the {force}",
        change=f"raise K to at least {F:.4g} {{N}}; a larger K does no harm in this law",
        source="Acary, Brogliato, Systems and Control Letters 59(5), 2010: |F| <= K",
    )


def super_twisting(c1: float, c2: float) -> Condition:
    """Check that super-twisting converges in finite time for friction with rate L: c2 > 1 and c1 > sqrt(1 + c2).

    Parameters
    ----------
    c1, c2 : float
        Gains of sqrt(m L |s|) and of L in the normalised form.

    Returns
    -------
    Condition
        It compares c2 with 1, or c1 with sqrt(1 + c2) if c2 is above 1.
    """
    least = math.sqrt(1.0 + max(c2, 1.0))
    by_rate = at_most(c2, 1.0)
    value, bound = (c2, 1.0) if by_rate else (c1, least)
    text = f"c2 = {c2:.4g} must be above 1" if by_rate else f"c1 = {c1:.4g} must be above sqrt(1 + c2) = {least:.4g}"
    return Condition(
        "super-twisting",
        *compared(above, value, bound),
        wrong=text,
        why="the integral part changes more slowly than friction with rate L and lags behind it"
        if by_rate
        else "the law may oscillate about the sliding surface without reaching it",
        change="use c1 = 1.5 and c2 = 1.1 (Levant)",
        source="Levant, Automatica 34(3), 1998; the bound of c1: Seeber, Horn, Automatica 84, 2017",
    )


def adaptation(rate: float, Ks: float, m: float, Ts: float) -> Condition:
    """Check that a sampled gradient adaptation is stable: rate Ts < Ks and 2 Ks Ts/m < 4 + rate Ts^2/m.

    These are Jury's conditions for m (s_next - s) = -Ts (Ks s + a), a_next = a + Ts rate s.

    Parameters
    ----------
    rate : float
        Sum of Gamma_i f_i^2 over all terms [N/m], with their regressors f_i at the largest friction.
    Ks : float
        Gain of s [N.s/m].
    m, Ts : float
        Mass [kg] and sample time [s].

    Returns
    -------
    Condition
        It compares 2 Ks Ts/m with 4 + rate Ts^2/m if that inequality is violated, otherwise rate Ts with Ks.
    """
    slow = below(2.0 * Ks * Ts / m, 4.0 + rate * Ts**2 / m)
    value, bound = (rate * Ts, Ks) if slow else (2.0 * Ks * Ts / m, 4.0 + rate * Ts**2 / m)
    return Condition(
        "adaptation",
        *compared(below, value, bound),
        wrong=f"the adaptation rate times Ts, {value:.4g} {{Ns_m}}, must be below Ks = {bound:.4g} {{Ns_m}}"
        if slow
        else f"2 Ks Ts/m = {value:.4g} must be below 4 + Gamma F^2 Ts^2/m = {bound:.4g}",
        why="each correction of the estimate is larger than the error: the estimate oscillates between its limits",
        change=f"divide the adaptation rates by more than {value / bound:.3g}, or raise Ks"
        if slow
        else "lower Ks or the sample time",
        source="Jury's conditions for the sampled law, derived here",
    )


def prefilter(Kp: float, Kd: float, Ki: float, Ts: float) -> Condition:
    """Check that the recursion of the prefilter is stable: Ts Ki < Kp and 2 Ts Kp < 4 Kd + Ts^2 Ki.

    Parameters
    ----------
    Kp, Kd, Ki, Ts : float
        Gains [N/m, N.s/m, N/(m.s)] and sample time [s] of the prefilter.

    Returns
    -------
    Condition
        It compares 2 Ts Kp with 4 Kd + Ts^2 Ki if that inequality is violated, otherwise Ts Ki with Kp.
    """
    slow = below(2.0 * Ts * Kp, 4.0 * Kd + Ts**2 * Ki)
    value, bound = (Ts * Ki, Kp) if slow else (2.0 * Ts * Kp, 4.0 * Kd + Ts**2 * Ki)
    return Condition(
        "prefilter",
        *compared(below, value, bound),
        wrong=f"Ts Ki = {value:.4g} {{N_m}} must be below Kp = {bound:.4g} {{N_m}}"
        if slow
        else f"2 Ts Kp = {value:.4g} {{Ns_m}} must be below 4 Kd + Ts^2 Ki = {bound:.4g} {{Ns_m}}",
        why="the inverse of the controller is unstable at this sample time: the filtered reference diverges",
        change="lower Ki" if slow else f"sample faster than every {2.0 * Kd / Kp:.4g} s, or raise Kd",
        source="Jury's conditions for 1/C, derived here",
    )


def prefilter_match(own: tuple[float, ...], controller: tuple[float, ...]) -> Condition:
    """Check that a prefilter R = 1 + F/C uses the gains of the controller C that follows it.

    Parameters
    ----------
    own, controller : tuple of float
        Kp, Kd, Ki and Ts of the prefilter and of the controller, compared with a relative tolerance of 1e-6.

    Returns
    -------
    Condition
        It compares the gain that differs most; its value is the gain of the prefilter.
    """
    apart = [abs(a - b) / max(abs(a), abs(b)) if a != b else 0.0 for a, b in zip(own, controller, strict=True)]
    worst = int(np.argmax(apart))
    name = ("Kp", "Kd", "Ki", "Ts")[worst]
    return Condition(
        name="prefilter gains",
        ok=max(apart) <= 1e-6,
        value=own[worst],
        bound=controller[worst],
        wrong=f"{name} is {own[worst]:.6g} in the prefilter and {controller[worst]:.6g} in the controller",
        why="the output of the controller is then not its response to r plus the feedforward: the plant receives a "
        "wrong {force}",
        change=f"set {name} of the prefilter to {controller[worst]:.6g}",
        source="the identity R = 1 + F/C",
    )


def preview(zero: float, N: float) -> Condition:
    """Check that the preview of a non-causal inverse is long enough: its truncation error |zero|^-N is at most 0.001.

    Parameters
    ----------
    zero : float
        Zero outside the unit circle; 0 if there is none.
    N : float
        Samples of preview.

    Returns
    -------
    Condition
        Its value is |zero|^-N, its bound 0.001.
    """
    value = 0.0 if zero == 0.0 else abs(zero) ** -N if above(abs(zero), 1.0) else math.inf
    outside = value < math.inf
    least = math.ceil(math.log(1e3) / math.log(abs(zero))) if outside and zero else 0
    return Condition(
        "preview",
        *compared(at_most, value, 1e-3),
        wrong=f"the truncated series of the inverse has the relative error |zero|^-N = {value:.4g} with N = {N:.4g}"
        if outside
        else f"the zero {zero:.4g} is not outside the unit circle",
        why="the tracking error is this factor times the reference N samples ahead"
        if outside
        else "the series in powers of the zero does not converge",
        change="put a zero inside the unit circle into inner"
        if not least
        else f"use a preview of at least {least} samples, or zero_phase"
        if least <= MOST_PREVIEW
        else f"use zero_phase: the zero is so near the circle that a preview of {MOST_PREVIEW} samples is too short",
        source="Gross, Tomizuka, Messner, ASME JDSMC 116(1), 1994; the bound 0.001 is a rule of this library",
    )


OVERCOMPENSATION = "over-compensation"  # name of the condition `overcompensation`


def injection(m: float, Kp: float, Kd: float, Ki: float, s0: float, s1: float) -> Condition:
    """Check that a LuGre observer may be corrected by the position error: s1 Kd >= s0 m and s0 Kp >= s1 Ki.

    Then G(s) = s (s1 s + s0)/(m s^3 + Kd s^2 + Kp s + Ki) is positive real, since the numerator of Re G(jw) is
    w^2 (s0 Kp - s1 Ki + w^2 (s1 Kd - s0 m)) (Canudas de Wit, Olsson, Astrom, Lischinsky 1995).

    Parameters
    ----------
    m : float
        Mass [kg].
    Kp, Kd, Ki : float
        Gains [N/m, N.s/m, N/(m.s)].
    s0, s1 : float
        Stiffness [N/m] and damping [N.s/m] of the bristles.

    Returns
    -------
    Condition
        It compares Kd with s0 m/s1, or Kp with s1 Ki/s0 if only that inequality is violated.
    """
    least = s0 * m / s1 if s1 > 0.0 else math.inf
    by_integral = s1 * Ki / s0
    if at_least(Kd, least) and below(Kp, by_integral):
        value, bound, gain, unit, rule = Kp, by_integral, "Kp", "{N_m}", "s1 Ki/s0"
    else:
        value, bound, gain, unit, rule = Kd, least, "Kd", "{Ns_m}", "s0 m/s1"
    return Condition(
        "observer injection",
        *compared(at_least, value, bound),
        wrong=f"{gain} = {value:.4g} {unit} must be at least {rule} = {bound:.4g} {unit}, because the observer is "
        "corrected by the position error",
        why="the transfer function from injection to error is not positive real: the estimation error may not decay, "
        "and tracking gets worse with a larger injection",
        change=f"set the injection k to 0, or make {gain} at least {bound:.4g} {unit}",
        source="Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (positive realness); expressed in the "
        "parameters here",
    )


def overcompensation(share: float, measured: bool = True) -> Condition:
    """Check that the compensation does not exceed the friction of the axis: a ratio of at most 1.

    Parameters
    ----------
    share : float
        Ratio of compensated friction to the friction of the axis, at the speed where it is largest.
    measured : bool
        Whether the compensation is computed from the measured velocity; otherwise from the reference.

    Returns
    -------
    Condition
        Its value is the ratio, its bound 1.
    """
    why = (
        "the excess {force} pushes in the direction of motion: a limit cycle that grows with the gain"
        if measured
        else "the excess {force} pushes in the direction of the reference: the axis overshoots at each reversal"
    )
    return Condition(
        OVERCOMPENSATION,
        *compared(at_most, share, 1.0),
        wrong=f"the compensation is {share:.4g} times the friction of the axis",
        why=why,
        change=f"multiply the gain by {0.9 / share:.2g}, or correct the friction parameters of the law"
        if share > 0.0
        else "no change is needed",
        source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; Papadopoulos, Chasparis, IROS 2002",
    )


def inertia(total: float, m: float, laws: int) -> Condition:
    """Check that the inertia force is fed forward once: several laws together use at most the mass of the axis.

    Parameters
    ----------
    total, m : float
        Total mass in all inertia feedforwards, and mass of the axis [kg].
    laws : int
        Number of laws with an inertia feedforward; with a single one the condition always holds.

    Returns
    -------
    Condition
        Its value is the total mass, its bound the mass of the axis [kg].
    """
    return Condition(
        name="inertia",
        ok=laws < 2 or at_most(total, m),
        value=total,
        bound=m,
        wrong=f"{laws} laws have an inertia feedforward, for {total:.4g} {{kg}} in total; the {{mass}} of the axis is "
        f"{m:.4g} {{kg}}",
        why="the inertia {force} is counted twice: the axis overshoots in every acceleration",
        change="set m to 0 in all but one of them",
        source="docstrings of PID and StaticFeedforward",
    )
