"""Expressions that laws share."""

from __future__ import annotations

from casadi import SX, exp, if_else


def clip(value: SX, low: SX, high: SX) -> SX:
    """The value, at least low and at most high; NaN stays NaN (fmin and fmax would make a limit of it)."""
    return if_else(value < low, low, if_else(value > high, high, value))


def limits(value: SX, low: SX, high: SX) -> SX:
    """Which limit is active: -1 below low, +1 above high, else 0."""
    return if_else(value < low, -1.0, if_else(value > high, 1.0, 0.0))


def unless_winding_up(rate: SX, active: SX) -> SX:
    """The rate of an integral, 0 while it would push further into the active limit.

    Parameters
    ----------
    rate : SX
        Of an integral that acts on the output with a positive gain.
    active : SX
        What `limits` gives.
    """
    return if_else(rate * active > 0.0, 0.0, rate)


def stribeck_level(speed: SX, Fc: SX, Fs: SX, vs: SX, delta: SX) -> SX:
    """Stribeck curve g = Fc + (Fs - Fc) exp(-(speed/vs)^delta) of a speed that is not negative."""
    ratio = speed / vs
    power = if_else(delta == 2.0, ratio**2, ratio**delta)
    # beyond 87 the exponential is below the normal floats: it counts for nothing, and takes several times as long
    return Fc + (Fs - Fc) * if_else(power > 87.0, 0.0, exp(-power))
