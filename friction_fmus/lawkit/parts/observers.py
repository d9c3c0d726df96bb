"""What friction observers, adaptive laws and sliding modes share."""

from __future__ import annotations

from casadi import SX, expm1, fabs, if_else

from friction_fmus.lawkit.expressions import clip, limits


def limited(rest: SX, F_hat: SX, gain: SX, enable: SX, u_min: SX, u_max: SX) -> dict[str, SX]:
    """The outputs u, F_hat and u_sat, u from a share of the friction and the rest; all 0 while enable is false."""
    wanted = rest + gain * F_hat
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "F_hat": if_else(enable, F_hat, 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
    }


def acting(rate: SX, Ts: SX) -> SX:
    """How long the slope of z' = drive - rate z at the beginning of Ts would have to last: (1 - exp(-rate Ts)) / rate.

    Drive and rate >= 0 are constant; the series where the quotient would lose digits.
    """
    q = rate * Ts
    # fabs and not a minus: it is known not to be -0.0, which spares an operation in the emitted C
    return if_else(q < 1e-5, Ts * (1.0 - q / 2.0), fabs(expm1(-q) / rate))


def relaxed(z: SX, drive: SX, rate: SX, Ts: SX) -> SX:
    """The solution of z' = drive - rate z after Ts, exact for a constant drive and rate >= 0, as stiff as it may be."""
    return z + acting(rate, Ts) * (drive - rate * z)


def adapted(value: SX, rate: SX, push: SX, active: SX, low: SX, high: SX, Ts: SX) -> SX:
    """A parameter after one step of its adaptation, kept within low and high.

    Parameters
    ----------
    value, rate : SX
        The parameter and its rate of change.
    push : SX
        In whose direction the adaptation moves the output: it stops while that is into the active limit.
    active : SX
        What `limits` gives for the output.
    """
    return clip(value + Ts * if_else(push * active > 0.0, 0.0, rate), low, high)


def periodic_table(place: SX, table: SX) -> SX:
    """Straight lines between the n elements of a table that repeats; place is 0 at the first one, and at most n."""
    n = table.numel()
    total = SX(0.0)
    for i in range(n):
        # without decisions, so that NaN in the place is not lost
        apart = n / 2.0 - fabs(fabs(place - i) - n / 2.0)
        total += (fabs(apart + 1.0) + fabs(apart - 1.0) - 2.0 * apart) / 2.0 * table[i]
    return total
