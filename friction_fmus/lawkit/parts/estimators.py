"""Expressions shared by friction estimators without a friction model."""

from __future__ import annotations

from collections.abc import Sequence

from casadi import SX, if_else, logic_not, logic_or

from friction_fmus.lawkit.law import clip, limits
from friction_fmus.lawkit.parts.tracking import tracked


def starts_now(reset: SX, running: SX) -> SX:
    """Return whether this sample only adopts the measured values: the first sample, or one with reset true."""
    return logic_or(reset, logic_not(running))


def compensation(estimate: SX, gain: SX, u_min: SX, u_max: SX, enable: SX, track: SX, u_track: SX) -> dict[str, SX]:
    """Return the outputs u, F_hat and u_sat that compensate a fraction of an estimated friction force."""
    wanted = tracked(track, u_track, gain, gain * estimate)
    return {
        "u": if_else(enable, clip(wanted, u_min, u_max), 0.0),
        "F_hat": if_else(enable, estimate, 0.0),
        "u_sat": if_else(enable, limits(wanted, u_min, u_max), 0.0),
    }


def mean_friction(force: SX, m: SX, dv: SX, Ts: SX) -> SX:
    """Return the mean friction over the last sampling interval, in which the velocity of a mass changed by dv."""
    return force - m * dv / Ts


def corrected(
    mean: Sequence[SX], P: Sequence[Sequence[SX]], units: Sequence[SX], i: int, measured: SX, variance: SX
) -> tuple[list[SX], list[list[SX]]]:
    """Return the state of a Kalman filter after a measurement of its element i."""
    n = len(mean)
    column = [P[min(i, j)][abs(i - j)] for j in range(n)]
    total = column[i] + variance
    residual = (measured - mean[i]) / units[i]
    found = [value + unit * c / total * residual for value, unit, c in zip(mean, units, column, strict=True)]
    share = variance / total
    triangle = [
        [P[j][k - j] * share if i in (j, k) else P[j][k - j] - column[j] / total * column[k] for k in range(j, n)]
        for j in range(n)
    ]
    return found, triangle
