"""Start of a simulated motion: a run-up from rest to a reference that begins in motion."""

from __future__ import annotations

from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

FITTED: Final = 12
"""Number of samples at the start from which velocity and acceleration are estimated."""

SLOW: Final = 1e-3
"""Initial velocity over the largest one up to which a reference begins at rest."""

REST: Final = 10
"""Number of samples at rest before the run-up."""

SHORTEST: Final = 20
"""Smallest number of samples of a run-up."""


def from_rest(r: NDArray[np.float64], Ts: float) -> NDArray[np.float64]:
    """Return a reference that begins at rest.

    A record may begin in motion. The states that compensators, servo and friction have then are unknown, and laws whose
    states start at zero would disturb the axis, by 74 µm on the EMPS axis. An axis at rest on its reference needs only
    the start values that the blocks have.
    """
    rd = np.gradient(r, Ts)
    fastest = float(np.max(np.abs(rd)))
    t = Ts * np.arange(float(FITTED))
    curve, v0, _ = np.polyfit(t, r[:FITTED], 2)
    if abs(v0) <= SLOW * fastest:
        return r
    a0 = 2.0 * curve
    strongest = float(np.quantile(np.abs(np.gradient(rd, Ts)), 0.99))
    samples = max(SHORTEST, ceil(1.5 * abs(v0) / (strongest * Ts))) if strongest > 0.0 else SHORTEST
    samples = min(samples, len(r))
    duration = samples * Ts
    s = np.arange(samples + 1.0) / samples

    # integral of the velocity v0 (3 s^2 - 2 s^3) + a0 T (s^3 - s^2)
    path = duration * (v0 * (s**3 - s**4 / 2.0) + a0 * duration * (s**4 / 4.0 - s**3 / 3.0))
    run_up = r[0] + path[:-1] - path[-1]
    return np.concatenate([np.full(REST, run_up[0]), run_up, r])
