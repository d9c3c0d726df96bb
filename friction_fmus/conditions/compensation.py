"""Conditions on friction compensation: observers, their sample time, and the amount of compensation."""

from __future__ import annotations

import math

import numpy as np

from friction_fmus.conditions.condition import Condition, at_least, at_most, below
from friction_fmus.conditions.linear import Matrix, held_mass, is_stable, longest_sample, spectral_radius

OVERCOMPENSATION = "over-compensation"
"""Name of the condition `overcompensation`."""


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
        value, bound, gain, unit, rule = Kp, by_integral, "Kp", "N/m", "s1 Ki/s0"
    else:
        value, bound, gain, unit, rule = Kd, least, "Kd", "N.s/m", "s0 m/s1"
    return Condition(
        name="observer injection",
        ok=at_least(value, bound),
        value=value,
        bound=bound,
        wrong=f"{gain} = {value:.4g} {unit} must be at least {rule} = {bound:.4g} {unit}, because the observer is "
        "corrected by the position error",
        why="the transfer function from injection to error is not positive real: the estimation error may not decay, "
        "and tracking gets worse with a larger injection",
        change=f"set the injection k to 0, or make {gain} at least {bound:.4g} {unit}",
        source="Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (positive realness); expressed in the "
        "parameters here",
    )


def disturbance_loop(
    m: float,
    Kp: float,
    Kd: float,
    Ki: float,
    fq: float,
    Ts: float,
    damping: float = 0.0,
    Kt: float = 0.0,
    m_model: float | None = None,
    gain: float = 1.0,
) -> Matrix:
    """Return the step matrix of a mass under PID with a first-order disturbance observer, held between samples.

    d = d + a (u - m_model (v_next - v)/Ts - d) with a = 1 - exp(-2 pi fq Ts), and u = PID + gain d.

    Parameters
    ----------
    m, Kp, Kd, Ki : float
        As in `injection`.
    fq, Ts : float
        Corner frequency of the low-pass filter [Hz], sample time [s].
    damping, Kt : float
        Damping [N.s/m] and stiffness [N/m] of the plant; in presliding those of the contact.
    m_model : float or None
        Mass in the observer [kg]; None: the mass of the plant.
    gain : float
        Fraction of the estimate that is compensated.

    Returns
    -------
    array, shape (4, 4), or (3, 3) for Ki = 0
        Step matrix of (x, v, d, integral).
    """
    model = m if m_model is None else m_model
    A, b = held_mass(m, damping, Kt, Ts)
    a = -math.expm1(-2.0 * math.pi * fq * Ts)
    force = np.array([-Kp, -Kd, gain, Ki])
    now, after = np.eye(4), np.zeros((4, 4))
    after[:2, :2] = A
    after[:2] += np.outer(b, force)
    after[2] = (1.0 - a) * now[2] + a * (force - model / Ts * (after[1] - now[1]))
    after[3] = now[3] - Ts * now[0]
    return after[:3, :3] if Ki == 0.0 else after


def disturbance_observer(
    m: float,
    Kp: float,
    Kd: float,
    Ki: float,
    fq: float,
    Ts: float,
    damping: float = 0.0,
    Kt: float = 0.0,
    m_model: float | None = None,
    gain: float = 1.0,
) -> Condition:
    """Check that the loop with a disturbance observer is stable: all eigenvalues are within the unit circle.

    See `disturbance_loop` for the loop; in presliding the plant has a stiffness.

    Parameters
    ----------
    m, Kp, Kd, Ki, fq, Ts, damping, Kt, m_model, gain : float
        As in `disturbance_loop`.

    Returns
    -------
    Condition
        Its value is the largest magnitude of the eigenvalues, its bound 1.
    """

    def loop(time: float) -> Matrix:
        return disturbance_loop(m, Kp, Kd, Ki, fq, time, damping, Kt, m_model, gain)

    value, ok = spectral_radius(loop(Ts)), is_stable(loop(Ts))
    longest = 0.0 if ok else longest_sample(lambda time: is_stable(loop(time)), Ts)
    where = f"in presliding (stiffness {Kt:.4g} N/m)" if Kt else "in sliding"
    faster = f", or sample faster than every {longest:.4g} s" if longest else ""
    return Condition(
        name="disturbance observer",
        ok=ok,
        value=value,
        bound=1.0,
        wrong=f"with the observer {where} the largest eigenvalue has the magnitude {value:.4g}, not below 1",
        why="the inverse model of the observer differs too much from the plant: |Q D| < 1 is violated and "
        "oscillations grow",
        change=f"lower the corner frequency of the observer, correct its mass{faster}",
        source="Ohnishi, Shibata, Murakami, IEEE/ASME Trans. Mechatronics 1(1), 1996; extension to the contact "
        "derived here",
    )


def explicit_observer(Ts: float, s0: float, Fc: float, v: float) -> Condition:
    """Check that an explicitly stepped bristle observer has Ts < 0.2 g/(s0 v); this library's laws step exactly.

    The bound is a fifth of the relaxation time of the bristles. Laws that step exactly do not need this condition.

    Parameters
    ----------
    Ts : float
        Sample time [s].
    s0, Fc : float
        Bristle stiffness [N/m] and level g of the Stribeck curve at that speed [N], usually Fc.
    v : float
        Largest speed [m/s].

    Returns
    -------
    Condition
        Its value is Ts, its bound 0.2 g/(s0 v) [s].
    """
    bound = 0.2 * Fc / (s0 * abs(v)) if v else math.inf
    return Condition(
        name="explicit observer",
        ok=below(Ts, bound),
        value=Ts,
        bound=bound,
        wrong=f"Ts = {Ts:.4g} s must be below 0.2 g/(s0 v) = {bound:.4g} s at {abs(v):.4g} m/s",
        why="the bristles relax within a few samples: an explicit step gives wrong forces long before it becomes "
        "unstable at 2 g/(s0 v)",
        change="use an observer with an exact step (LuGreObserver), sample faster, or move more slowly",
        source="stiffness of the bristles: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995; the "
        "factor 0.2 is a rule of this library",
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
        "the excess force pushes in the direction of motion: a limit cycle that grows with the gain"
        if measured
        else "the excess force pushes in the direction of the reference: the axis overshoots at each reversal"
    )
    return Condition(
        name=OVERCOMPENSATION,
        ok=at_most(share, 1.0),
        value=share,
        bound=1.0,
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
        wrong=f"{laws} laws have an inertia feedforward, for {total:.4g} kg in total; the mass of the axis is "
        f"{m:.4g} kg",
        why="the inertia force is counted twice: the axis overshoots in every acceleration",
        change="set m to 0 in all but one of them",
        source="docstrings of PID and StaticFeedforward",
    )
