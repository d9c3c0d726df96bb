"""Conditions of single laws: limits, sliding modes, adaptation, and what shapes the reference."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from friction_fmus.conditions.condition import Condition, above, at_least, at_most, below

MOST_PREVIEW: Final = 1024
"""Longest preview that is advised, in samples: that of DiscreteInverse."""


def break_away(most: float, Fs: float, direction: str = "forward") -> Condition:
    """The drive can break the axis away: the largest force behind all limits is above static friction.

    Parameters
    ----------
    most : float
        Largest force of the drive in this direction [N].
    Fs : float
        Static friction [N].
    direction : str
        ``forward`` or ``backward``, for the text.
    """
    return Condition(
        name="break-away",
        ok=above(most, Fs),
        value=most,
        bound=Fs,
        wrong=f"the largest force {direction}, behind all limits, is {most:.4g} N; static friction is {Fs:.4g} N",
        why="no force that rises slowly leaves a standstill in that direction: slow motion sticks",
        change=f"raise the limits of the law and of the actuator above {Fs:.4g} N",
        source="balance of forces at rest",
    )


def sliding_gain(K: float, F: float) -> Condition:
    """The set-valued sliding mode reaches s = 0 if its gain covers the friction that is left: K >= F.

    Parameters
    ----------
    K : float
        Gain of the sign [N].
    F : float
        Largest friction that no other law compensates [N].
    """
    return Condition(
        name="sliding gain",
        ok=at_least(K, F),
        value=K,
        bound=F,
        wrong=f"the gain of the sliding mode, K = {K:.4g} N, is to be at least the friction that is left, {F:.4g} N",
        why="the axis does not come to the sliding surface: at rest it sticks off its target, and no s pulls harder",
        change=f"raise K to at least {F:.4g} N; in this law too much does no harm",
        source="Acary, Brogliato, Systems and Control Letters 59(5), 2010: |F| <= K",
    )


def super_twisting(c1: float, c2: float) -> Condition:
    """The super-twisting algorithm follows a friction of the rate L in finite time if c2 > 1 and c1 > sqrt(1 + c2).

    Parameters
    ----------
    c1, c2 : float
        Gains in the normalised form, of sqrt(m L |s|) and of L.
    """
    least = math.sqrt(1.0 + max(c2, 1.0))
    by_rate = at_most(c2, 1.0)
    value, bound = (c2, 1.0) if by_rate else (c1, least)
    text = f"c2 = {c2:.4g} is to be above 1" if by_rate else f"c1 = {c1:.4g} is to be above sqrt(1 + c2) = {least:.4g}"
    return Condition(
        name="super-twisting",
        ok=above(value, bound),
        value=value,
        bound=bound,
        wrong=text,
        why="its integral part changes more slowly than friction of the rate L: it is left behind"
        if by_rate
        else "the two parts may swing about the sliding surface without coming to it",
        change="use c1 = 1.5 and c2 = 1.1 (Levant)",
        source="Levant, Automatica 34(3), 1998; the bound of c1: Seeber, Horn, Automatica 84, 2017 (from memory)",
    )


def super_twisting_rate(c2: float, L: float, rate: float) -> Condition:
    """The bound L covers how fast friction changes: c2 L >= max |dF/dt|.

    Parameters
    ----------
    c2, L : float
        Gain and bound [N/s] of the law.
    rate : float
        Fastest change of friction [N/s]; s0 |v| while the contact is elastic, s0 stiffness and v speed at a reversal.
    """
    return Condition(
        name="super-twisting rate",
        ok=at_least(c2 * L, rate),
        value=c2 * L,
        bound=rate,
        wrong=f"c2 L = {c2 * L:.4g} N/s is to be at least the fastest change of friction, {rate:.4g} N/s",
        why="the estimate falls behind where friction turns round: an error that s has to bring back",
        change=f"raise L above {rate / c2 if c2 > 0.0 else math.inf:.4g} N/s",
        source="Levant, Automatica 34(3), 1998",
    )


def adaptation(rate: float, Ks: float, m: float, Ts: float) -> Condition:
    """A sampled gradient adaptation is stable for rate Ts < Ks and 2 Ks Ts/m < 4 + rate Ts^2/m.

    m (s_next - s) = -Ts (Ks s + a), a_next = a + Ts rate s: Jury's conditions of its two eigenvalues.

    Parameters
    ----------
    rate : float
        Sum of Gamma_i f_i^2 of all terms [N/m], f_i their regressors at the largest friction.
    Ks : float
        Gain of s [N.s/m].
    m, Ts : float
        Mass [kg] and sample time [s].
    """
    slow = below(2.0 * Ks * Ts / m, 4.0 + rate * Ts**2 / m)
    value, bound = (rate * Ts, Ks) if slow else (2.0 * Ks * Ts / m, 4.0 + rate * Ts**2 / m)
    return Condition(
        name="adaptation",
        ok=below(value, bound),
        value=value,
        bound=bound,
        wrong=f"the adaptation times Ts, {value:.4g} N.s/m, is to be below Ks = {bound:.4g} N.s/m"
        if slow
        else f"2 Ks Ts/m = {value:.4g} is to be below 4 + Gamma F^2 Ts^2/m = {bound:.4g}",
        why="the sampled estimate overshoots by more than it corrects: it swings between its limits",
        change=f"divide the speeds of adaptation by more than {value / bound:.3g}, or raise Ks"
        if slow
        else "lower Ks or the sample time",
        source="Jury's conditions of the sampled law, derived here",
    )


def prefilter(Kp: float, Kd: float, Ki: float, Ts: float) -> Condition:
    """The recursion of the prefilter is stable: Ts Ki < Kp and 2 Ts Kp < 4 Kd + Ts^2 Ki.

    Parameters
    ----------
    Kp, Kd, Ki, Ts : float
        Gains [N/m, N.s/m, N/(m.s)] and sample time [s] of the prefilter.
    """
    slow = below(2.0 * Ts * Kp, 4.0 * Kd + Ts**2 * Ki)
    value, bound = (Ts * Ki, Kp) if slow else (2.0 * Ts * Kp, 4.0 * Kd + Ts**2 * Ki)
    return Condition(
        name="prefilter",
        ok=below(value, bound),
        value=value,
        bound=bound,
        wrong=f"Ts Ki = {value:.4g} N/m is to be below Kp = {bound:.4g} N/m"
        if slow
        else f"2 Ts Kp = {value:.4g} N.s/m is to be below 4 Kd + Ts^2 Ki = {bound:.4g} N.s/m",
        why="the inverse of the controller is unstable at this sample time: the reference that it makes grows",
        change="lower Ki" if slow else f"sample faster than every {2.0 * Kd / Kp:.4g} s, or raise Kd",
        source="Jury's conditions of 1/C, derived here",
    )


def prefilter_match(own: tuple[float, ...], controller: tuple[float, ...]) -> Condition:
    """A prefilter R = 1 + F/C contains the gains of the controller C that follows it.

    Parameters
    ----------
    own, controller : tuple of float
        Kp, Kd, Ki and Ts of the prefilter and of the controller; compared to 1e-6.
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
        why="C (r + d) is then not C r plus the feedforward: the plant gets another force than was meant",
        change=f"set {name} of the prefilter to {controller[worst]:.6g}",
        source="the identity R = 1 + F/C",
    )


def preview(zero: float, N: float) -> Condition:
    """The preview of a non-causal inverse is long enough: it leaves |zero|^-N of the reference, at most 0.001.

    Parameters
    ----------
    zero : float
        Zero outside the unit circle; 0 for none.
    N : float
        Samples of preview.
    """
    value = 0.0 if zero == 0.0 else abs(zero) ** -N if above(abs(zero), 1.0) else math.inf
    outside = value < math.inf
    least = math.ceil(math.log(1e3) / math.log(abs(zero))) if outside and zero else 0
    return Condition(
        name="preview",
        ok=at_most(value, 1e-3),
        value=value,
        bound=1e-3,
        wrong=f"the series of the inverse leaves |zero|^-N = {value:.4g} of the reference, N = {N:.4g}"
        if outside
        else f"the zero {zero:.4g} is not outside the unit circle",
        why="the tracking error is the reference N samples ahead, times that share"
        if outside
        else "the series in its powers does not converge",
        change="put a zero inside the circle into inner"
        if not least
        else f"use a preview of at least {least} samples, or zero_phase"
        if least <= MOST_PREVIEW
        else f"use zero_phase: the zero is so near the circle that a preview of {MOST_PREVIEW} samples is too short",
        source="Gross, Tomizuka, Messner, ASME JDSMC 116(1), 1994; the bound 0.001 is a rule of this library",
    )
