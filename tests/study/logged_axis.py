"""A mass with Coulomb friction and exact sticking, under a servo law that is a formula."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np

from friction_fmus.identification import Record

M, FC = 2.0, 6.0
TS, FINER, N = 1e-3, 10, 6000
T = TS * np.arange(N)
R = 0.05 * np.sin(2.0 * pi * 0.7 * T) + 0.01 * np.sin(2.0 * pi * 1.9 * T)
RD, RDD = np.gradient(R, TS), np.gradient(np.gradient(R, TS), TS)


def logged(
    law: Callable[[int, float, float, float], float],
    window: int,
    delay: int = 0,
    limit: float = 1e9,
    Fc: float = FC,
) -> Record:
    """A record of the law u(k, error, velocity, integral of the error); the force column has the force that acts."""
    q, force, sent = np.zeros(N), np.zeros(N), np.zeros(N)
    x = v = total = 0.0
    for k in range(N):
        q[k] = x
        measured = (x - q[max(k - window, 0)]) / (window * TS)
        sent[k] = min(max(law(k, R[k] - x, measured, total), -limit), limit)
        total += TS * (R[k] - x)
        force[k] = sent[max(k - delay, 0)]
        for _ in range(FINER):
            h = TS / FINER
            free = v + h * force[k] / M
            v = float(np.sign(free)) * max(abs(free) - h * Fc / M, 0.0)
            x += h * v
    return Record("axis", T, q=q, reference=R, force=force)
