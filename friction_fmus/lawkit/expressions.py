"""Expressions shared by laws."""

from __future__ import annotations

from casadi import SX, exp, if_else


def clip(value: SX, low: SX, high: SX) -> SX:
    """Return the value limited to low and high; NaN stays NaN (fmin and fmax would return a limit)."""
    return if_else(value < low, low, if_else(value > high, high, value))


def limits(value: SX, low: SX, high: SX) -> SX:
    """Return the active limit: -1 below low, +1 above high, else 0."""
    return if_else(value < low, -1.0, if_else(value > high, 1.0, 0.0))


def unless_winding_up(rate: SX, active: SX) -> SX:
    """Return the rate of an integral, or 0 while it would drive the output further into the active limit."""
    return if_else(rate * active > 0.0, 0.0, rate)


def elapsed(missed: SX, Ts: SX) -> SX:
    """Return the time since the last valid sample."""
    return (missed + 1.0) * Ts


def stribeck_level(speed: SX, Fc: SX, Fs: SX, vs: SX, delta: SX) -> SX:
    """Return the Stribeck curve g = Fc + (Fs - Fc) exp(-(speed/vs)^delta) for a speed that is not negative."""
    ratio = speed / vs
    power = if_else(delta == 2.0, ratio**2, ratio**delta)
    # beyond 87 the exponential is a denormal float: negligible, and several times slower
    excess = (Fs - Fc) * if_else(power > 87.0, 0.0, exp(-power))
    return Fc + excess
