"""Conditions of friction compensation: observers, their sample time, and how much is compensated."""

from __future__ import annotations

import math

import numpy as np

from friction_fmus.conditions.condition import Condition, at_least, at_most, below
from friction_fmus.conditions.linear import Matrix, held_mass, is_stable, longest_sample, spectral_radius


def injection(m: float, Kp: float, Kd: float, Ki: float, s0: float, s1: float) -> Condition:
    """A LuGre observer may be corrected by the position error: s1 Kd >= s0 m and s0 Kp >= s1 Ki.

    Then G(s) = s (s1 s + s0)/(m s^3 + Kd s^2 + Kp s + Ki) is positive real, since the numerator of Re G(jw) is
    w^2 (s0 Kp - s1 Ki + w^2 (s1 Kd - s0 m)).

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
        Of Kd and s0 m/s1, or of Kp and s1 Ki/s0 where only that one is violated.
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
        wrong=f"{gain} = {value:.4g} {unit} is to be at least {rule} = {bound:.4g} {unit}, as the observer is "
        "corrected by the position error",
        why="the loop of the injection is not positive real: the error of the estimate need not die, and tracking "
        "gets worse the larger the injection is",
        change=f"set the injection k to 0, or make {gain} at least {bound:.4g} {unit}",
        source="Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995 (positive realness); in the "
        "parameters derived here",
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
    """Step matrix of a mass under PID with a disturbance observer of first order, held between samples.

    d = d + a (u - m_model (v_next - v)/Ts - d) with a = 1 - exp(-2 pi fq Ts), and u = PID + gain d.

    Parameters
    ----------
    m, Kp, Kd, Ki : float
        As in `injection`.
    fq, Ts : float
        Corner of the low-pass [Hz], sample time [s].
    damping, Kt : float
        Of the plant beside its mass [N.s/m, N/m]; in presliding those of the contact.
    m_model : float or None
        Mass in the observer [kg]; None: that of the plant.
    gain : float
        Share of the estimate that is compensated.

    Returns
    -------
    array, shape (4, 4), or (3, 3) for Ki = 0
        Of (x, v, d, integral).
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
    """Poles of the loop with a disturbance observer, see `disturbance_loop`; in presliding the plant has a stiffness.

    Parameters
    ----------
    m, Kp, Kd, Ki, fq, Ts, damping, Kt, m_model, gain : float
        As in `disturbance_loop`.
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
        why="the inverse model of the observer differs too much from the plant: |Q D| < 1 does not hold, the loop "
        "oscillates and grows",
        change=f"lower the corner frequency of the observer, correct its mass{faster}",
        source="Ohnishi, Shibata, Murakami, IEEE/ASME Trans. Mechatronics 1(1), 1996; with the contact derived here",
    )


def explicit_observer(Ts: float, s0: float, Fc: float, v: float) -> Condition:
    """An observer of bristles that is stepped explicitly needs Ts < 0.2 g/(s0 v); this library's step exactly.

    The bound is a fifth of the relaxation time of the bristles; the laws of this library need no such condition.

    Parameters
    ----------
    Ts : float
        Sample time [s].
    s0, Fc : float
        Bristle stiffness [N/m] and the level g of the Stribeck curve at that speed [N], Fc above the Stribeck velocity.
    v : float
        Largest speed [m/s].
    """
    bound = 0.2 * Fc / (s0 * abs(v)) if v else math.inf
    return Condition(
        name="explicit observer",
        ok=below(Ts, bound),
        value=Ts,
        bound=bound,
        wrong=f"Ts = {Ts:.4g} s is to be below 0.2 g/(s0 v) = {bound:.4g} s at {abs(v):.4g} m/s",
        why="the bristles relax within a few samples: an explicit step gives wrong forces long before it is unstable, "
        "at 2 g/(s0 v)",
        change="step the observer exactly (LuGreObserver does), sample faster, or move more slowly",
        source="stiffness of the bristles: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40(3), 1995; the "
        "factor 0.2 is a rule of this library",
    )


def overcompensation(share: float, measured: bool = True) -> Condition:
    """No more friction is compensated than there is: a gain of at most 1.

    Parameters
    ----------
    share : float
        Friction that is compensated over the friction of the axis, at the speed where it is largest.
    measured : bool
        Whether it is computed from the measured velocity; otherwise from the reference.
    """
    why = (
        "what is too much pushes in the direction of motion: a limit cycle that grows with the gain"
        if measured
        else "what is too much pushes in the direction of the reference: the axis overshoots at each reversal"
    )
    return Condition(
        name="over-compensation",
        ok=at_most(share, 1.0),
        value=share,
        bound=1.0,
        wrong=f"{share:.4g} times the friction of the axis is compensated",
        why=why,
        change=f"multiply the gain by {0.9 / share:.2g}, or correct the friction parameters of the law"
        if share > 0.0
        else "leave it as it is",
        source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; Papadopoulos, Chasparis, IROS 2002",
    )


def inertia(total: float, m: float, laws: int) -> Condition:
    """The inertia force is fed forward once; several laws together feed forward at most the mass of the axis.

    Parameters
    ----------
    total, m : float
        Mass in all inertia feedforwards together, and of the axis [kg].
    laws : int
        How many laws feed it forward; the mass of a single one is its own affair.
    """
    return Condition(
        name="inertia",
        ok=laws < 2 or at_most(total, m),
        value=total,
        bound=m,
        wrong=f"{laws} laws feed inertia forward, together for {total:.4g} kg; the axis has {m:.4g} kg",
        why="the inertia force is counted twice: the axis overshoots in every acceleration",
        change="set m of all but one of them to 0",
        source="docstrings of PID and StaticFeedforward",
    )
