"""Expressions shared by friction observers, adaptive laws and sliding-mode laws."""

from __future__ import annotations

from casadi import SX, expm1, fabs, if_else

from friction_fmus.lawkit.law import clip, limits
from friction_fmus.lawkit.parts.tracking import tracked


def limited(
    rest: SX,
    F_hat: SX,
    gain: SX,
    enable: SX,
    u_min: SX,
    u_max: SX,
    track: SX | None = None,
    u_track: SX | None = None,
) -> dict[str, SX]:
    """Return u, F_hat and u_sat, with u from a fraction of the friction and other terms; all 0 unless enabled."""
    wanted = rest + gain * F_hat
    if track is not None and u_track is not None:
        wanted = tracked(track, u_track, gain, wanted)
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "F_hat": if_else(enable, F_hat, 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
    }


def acting(rate: SX, Ts: SX) -> SX:
    """Return (1 - exp(-rate Ts)) / rate, the effective duration of the initial slope of z' = drive - rate z in Ts.

    Drive and rate >= 0 are constant. A series replaces the quotient where it would lose accuracy.
    """
    q = rate * Ts
    # fabs instead of a minus, as it is known not to return -0.0, which saves an operation in the generated C
    return if_else(q < 1e-5, Ts * (1.0 - q / 2.0), fabs(expm1(-q) / rate))


def relaxed(z: SX, drive: SX, rate: SX, Ts: SX) -> SX:
    """Return the exact solution of z' = drive - rate z after Ts for constant drive and rate >= 0, however stiff."""
    return z + acting(rate, Ts) * (drive - rate * z)


def adapted(value: SX, rate: SX, push: SX, active: SX, low: SX, high: SX, Ts: SX) -> SX:
    """Return a parameter after one step of its adaptation, limited to low and high."""
    return clip(value + Ts * if_else(push * active > 0.0, 0.0, rate), low, high)


def periodic_table(place: SX, table: SX) -> SX:
    """Interpolate linearly in a periodic table with n elements; place is 0 at the first element and at most n."""
    n = table.numel()
    total = SX(0.0)
    for i in range(n):
        # without decisions, so that NaN in the place stays NaN
        apart = n / 2.0 - fabs(fabs(place - i) - n / 2.0)
        weight = (fabs(apart + 1.0) + fabs(apart - 1.0) - 2.0 * apart) / 2.0
        total += weight * table[i]
    return total
