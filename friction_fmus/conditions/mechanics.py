"""Conditions on encoders, cogging, belts, a mass pulled by a spring, and stiffness fed back by a law."""

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from friction_fmus.conditions.condition import Condition, above, at_most, below, compared
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
        "encoder",
        *compared(below, value, F),
        wrong=f"one count of the encoder, {q:.4g} {{m}}, changes the {{force}} by Kp q + Kd q/T = {value:.4g} {{N}}; "
        f"static friction is {F:.4g} {{N}}",
        why="the velocity computed from positions jumps by q/T with each count: slow motion is jerky, back and forth",
        change=f"use an encoder finer than {q * F / value if value > 0.0 else math.inf:.4g} {{m}}, compute the "
        "velocity over a longer time (Differentiator: window, tau), or lower Kd",
        source="balance of {force}s, with the difference quotient of a quantised position; derived here",
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
        "cogging",
        *compared(above, Kp, slope),
        wrong=f"the stiffness of the loop, {Kp:.4g} {{N_m}}, must be above the steepest rise of the cogging {{force}}, "
        f"{slope:.4g} {{N_m}}",
        why="between the magnets the loop has no stable equilibrium: the axis jumps from pitch to pitch",
        change=f"raise Kp above {slope:.4g} {{N_m}}, or compensate the cogging (TustinFeedback, IterativeLearning)",
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
        "belt",
        *compared(above, damping, fall),
        wrong=f"at the belt speed, {speed:.4g} {{m_s}}, friction falls with speed by {fall:.4g} {{Ns_m}}; the damping "
        f"is only {damping:.4g} {{Ns_m}}",
        why="steady sliding is unstable at this speed: the {mass} sticks to the belt and slips",
        change=f"raise the damping above {fall:.4g} {{Ns_m}}, or change the belt speed",
        source="Leine, van Campen, de Kraker, van den Steen, Nonlinear Dynamics 16, 1998; rigid contact, linearised",
        note=True,
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
        "fed-back stiffness",
        *compared(below, fed_back, stiffness),
        wrong=f"the law feeds back a stiffness of {fed_back:.4g} {{N_m}}; contact and loop have only {stiffness:.4g} "
        f"{{N_m}}",
        why="the resulting stiffness in presliding is negative: the axis leaves presliding by itself, to one side and "
        "back",
        change=f"correct sigma0 of the law, or multiply its gain by {0.9 * stiffness / fed_back:.2g}"
        if fed_back > 0.0
        else "no change is needed",
        source="sum of stiffnesses at rest; derived here",
    )


PRECISION = 1e-4  # relative precision of critical speeds, stiffnesses and damping coefficients
MUCH_STIFFER = 100.0  # ratio to the present stiffness above which a stiffer spring is no remedy
LARGEST_RATIO = 1e9  # largest ratio of a critical value to the present one that is searched


def sticks_again(
    m: float, k: float, damping: float, Fc: float, Fs: float, vs: float | None, delta: float, v: float
) -> bool:
    """Return whether a pulled mass that broke away comes to rest again."""
    # With w = V - v, the spring force q less its value in steady sliding at Coulomb friction, and the damping c, m w' =
    # -q - c w + g(V - w) - Fc and q' = k w. The mass breaks away with w = V; it comes to rest again if w reaches V once
    # more.
    if at_most(Fs, Fc) or damping >= 2.0 * math.sqrt(k * m):
        return False
    if vs is None:
        return _sticks_after_a_jump(m, k, damping, Fs - Fc, v)
    from scipy.integrate import solve_ivp  # imported here, as few systems need it

    # in units of Fs - Fc, of the period / 2 pi and of the speed that they give
    time = math.sqrt(m / k)
    scale = (Fs - Fc) * time / m
    speed, fall_speed, c = v / scale, vs / scale, damping * time / m

    def force(w: float) -> float:
        return math.exp(-(min((abs(speed - w) / fall_speed), 1e3) ** delta)) if speed != w else 1.0

    def rates(_: float, y: np.ndarray) -> list[float]:
        w, q = y
        return [-q - c * w + force(w), w]

    def rests(_: float, y: np.ndarray) -> float:
        return float(speed - y[0])

    def turns(_: float, y: np.ndarray) -> float:
        return rates(0.0, y)[0]

    for event in (rests, turns):
        event.terminal = True  # type: ignore[attr-defined]
        event.direction = -1.0  # type: ignore[attr-defined]
    start = [speed, 1.0 - c * speed + max(1e-3 * min(1e-3, c * speed), 1e-12)]
    found = solve_ivp(rates, (0.0, 1e3), start, events=(rests, turns), rtol=1e-7, atol=1e-10)
    rested, turned = (y.size for y in found.y_events or ())
    # a maximum that just exceeds the speed may lie between two steps
    return bool(rested) or (bool(turned) and float(found.y[0, -1]) >= speed)


def _sticks_after_a_jump(m: float, k: float, damping: float, drop: float, v: float) -> bool:
    """Return whether the mass comes to rest again if friction drops at once; closed form."""
    # m w'' + c w' + k w = 0 with w = V, w' = -(Fs - Fc)/m: the first maximum of w, at which w' = 0, is at least V.
    a = damping / (2.0 * m)
    b = math.sqrt(k / m - a * a)
    s = (-drop / m + a * v) / b  # w = exp(-a t) (V cos(b t) + s sin(b t))
    at = math.atan2(b * s - a * v, a * s + b * v) % math.pi  # w' = 0
    if v * math.cos(at) + s * math.sin(at) < 0.0:  # the minimum before
        at += math.pi
    return math.exp(-a * at / b) * (v * math.cos(at) + s * math.sin(at)) >= v


@cache
def critical_speed(m: float, k: float, damping: float, Fc: float, Fs: float, vs: float | None, delta: float) -> float:
    """Return the speed of pulling above which a mass that broke away does not stick again.

    For small damping and a sudden drop it is (Fs - Fc) / sqrt(2 pi c sqrt(k m)).

    Parameters
    ----------
    m, k, damping, Fc, Fs, vs, delta : float
        As in `sticks_again`.

    Returns
    -------
    float
        Critical speed [m/s]; 0 if the mass never sticks again, infinity if it does at every speed.
    """
    if at_most(Fs, Fc) or damping >= 2.0 * math.sqrt(k * m):
        return 0.0
    if damping <= 0.0:
        return math.inf
    guess = (Fs - Fc) / math.sqrt(2.0 * math.pi * damping * math.sqrt(k * m))
    return _last(lambda v: sticks_again(m, k, damping, Fc, Fs, vs, delta, v), guess)


def pulled_mass(
    m: float, k: float, damping: float, Fc: float, Fs: float, vs: float | None, delta: float, v: float
) -> Condition:
    """Check that a mass that is pulled by a spring ends in steady sliding.

    Parameters
    ----------
    m, k, damping, Fc, Fs, vs, delta, v : float
        As in `sticks_again`; the sign of `v` has no influence.

    Returns
    -------
    Condition
        Its value is the speed, its bound the critical speed [m/s]. The contact counts as rigid; bristles lower the
        critical speed.
    """
    speed = abs(v)
    critical = critical_speed(m, k, damping, Fc, Fs, vs, delta)

    def sticks(stiffness: float = k, coefficient: float = damping, static: float = Fs) -> bool:
        unstable = vs is not None and above(fall_at(Fc, static, vs, delta, speed), coefficient)
        return unstable or sticks_again(m, stiffness, coefficient, Fc, static, vs, delta, speed)

    ok = not sticks()
    if ok and speed < critical:
        critical = 0.0  # the mass creeps steadily below the Stribeck velocity
    remedies = []
    if not ok:
        if math.isfinite(critical):
            remedies.append(f"pull faster than {critical:.4g} {{m_s}}")
        if (stiffest := _last(lambda stiffness: sticks(stiffness), k)) < MUCH_STIFFER * k:
            remedies.append(f"use a spring stiffer than {stiffest:.4g} {{N_m}}")
        most = _last(lambda coefficient: sticks(coefficient=coefficient), max(damping, 1e-3 * math.sqrt(k * m)))
        remedies.append(f"raise the damping above {most:.4g} {{Ns_m}}")
        drop = 1.0 / _last(lambda inverse: sticks(static=Fc + 1.0 / inverse), 1.0 / (Fs - Fc))
        remedies.append(f"reduce Fs - Fc from {Fs - Fc:.4g} {{N}} to below {drop:.4g} {{N}}")
    return Condition(
        name="stick-slip cycle",
        ok=ok,
        value=speed,
        bound=critical,
        wrong=f"the spring of {k:.4g} {{N_m}} pulls the {{mass}} at {speed:.4g} {{m_s}}, which is not above the "
        f"critical speed, {critical:.4g} {{m_s}}",
        why=f"after break-away at Fs = {Fs:.4g} {{N}} friction falls to Fc = {Fc:.4g} {{N}}; the {{mass}} overtakes "
        "the pulled end, comes to rest, and the cycle repeats: it sticks and slips",
        change=f"{', '.join(remedies[:-1])}, or {remedies[-1]}" if remedies else "no change is needed",
        source="Bo, Pavelescu, Wear 82, 1982 (critical velocity); rigid contact, computed here",
        note=True,
    )


def _last(sticks: Callable[[float], bool], guess: float) -> float:
    """Return the border above which something does not stick; infinity if there is none, 0 if it never sticks."""
    low, high = guess, guess
    while not sticks(low):
        low /= 2.0
        if low < guess / LARGEST_RATIO:
            return 0.0
    while sticks(high):
        high *= 2.0
        if high > guess * LARGEST_RATIO:
            return math.inf
    while high > (1.0 + PRECISION) * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if sticks(middle) else (low, middle)
    return high
