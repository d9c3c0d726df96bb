"""Expressions shared by laws that compute friction from the reference."""

from __future__ import annotations

from collections.abc import Sequence

from casadi import SX, exp, expm1, if_else, logic_and, logic_not, logic_or

from friction_fmus.lawkit.law import clip, limits


def increment(r: SX, last: SX, started: SX, reset: SX) -> SX:
    """Return the displacement of the reference since the previous sample; 0 in the first sample and during reset."""
    # r - r instead of 0, so that NaN stays NaN
    return r - if_else(logic_and(started, logic_not(reset)), last, r)


def filled(now: SX, before: Sequence[SX], missed: SX) -> list[SX]:
    """Return the values of the previous samples, latest first; after missing samples they lie on a straight line."""
    slope = (now - before[0]) / (missed + 1.0)
    return [if_else(missed > 0.0, now - (j + 1.0) * slope, value) for j, value in enumerate(before)]


def at_most(value: SX, limit: SX | float) -> SX:
    """Return the smaller of both; NaN stays NaN."""
    return if_else(value > limit, limit, value)


def relax(value: SX, target: SX, decay: SX) -> SX:
    """Return the value after exact relaxation to a target over `decay` time constants, as in solver.h."""
    return value - (target - value) * expm1(-decay)


def fading(sigma1: SX, speed: SX, v_d: SX) -> SX:
    """Return the bristle damping, which decreases with speed if v_d > 0, as in presliding.h."""
    fades = v_d > 0.0
    ratio = speed / if_else(fades, v_d, 1.0)
    return if_else(fades, sigma1 * exp(-(ratio**2)), sigma1)


def feedforward(inertia: SX, friction: SX, gain: SX, enable: SX, u_min: SX, u_max: SX) -> dict[str, SX]:
    """Return u, F_hat and u_sat: inertia and a fraction of the friction within limits; all 0 unless enabled."""
    wanted = inertia + gain * friction
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "F_hat": if_else(enable, friction, 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
    }


def when(enable: SX, **values: SX | float) -> dict[str, SX]:
    """Return the values while enabled, else 0, the start value of the states of these laws."""
    return {name: if_else(enable, value, 0.0) for name, value in values.items()}


def reference_shift(force: SX, shift: SX, integral: SX, Kp: SX, Kd: SX, Ki: SX, Ts: SX) -> tuple[SX, SX, SX]:
    """Return the shift of the reference for which a PID controller generates a given force."""
    rate = (force - Kp * shift - Ki * integral) / Kd
    return rate, shift + Ts * rate, integral + Ts * shift


def settles_slowly(Kp: SX, Ki: SX, Ts: SX) -> SX:
    """Return whether the product of both poles of `reference_shift` is below 1; Ki = 0 leaves its integral unused."""
    return logic_or(Ts * Ki < Kp, Ki == 0.0)


def settles_fast(Kp: SX, Kd: SX, Ki: SX, Ts: SX) -> SX:
    """Return whether the characteristic polynomial of `reference_shift` is positive at -1."""
    return 2.0 * Ts * Kp < 4.0 * Kd + Ts**2 * Ki
