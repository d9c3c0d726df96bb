"""Sampled linear loops around a mass: matrices, and how fast one must sample."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Matrix: TypeAlias = NDArray[np.float64]

FASTEST: Final = 1e-6
"""Shortest sample time that is advised [s]; drives sample every 10 us at best."""

MARGIN: Final = 1e-12
"""Relative change of every element of its matrix that a loop must stand to count as stable.

A thousand times the rounding errors of a matrix exponential and a few products; a loop at 1 kHz whose slowest pole has
a time constant of a hundred years does not stand it.
"""


def held_mass(m: float, damping: float, stiffness: float, Ts: float) -> tuple[Matrix, Matrix]:
    """A mass with damper and spring under a force that is held for Ts.

    Returns
    -------
    tuple of arrays, shapes (2, 2) and (2,)
        (x, v) after Ts is A (x, v) + b u.
    """
    exponent = np.zeros((3, 3))
    exponent[0, 1] = 1.0
    exponent[1] = -stiffness / m, -damping / m, 1.0 / m
    step = np.asarray(expm(Ts * exponent), dtype=np.float64)
    return step[:2, :2], step[:2, 2]


def spectral_radius(matrix: Matrix) -> float:
    """The largest magnitude of the eigenvalues; infinity if the matrix has overflowed."""
    if not np.isfinite(matrix).all():
        return math.inf
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def is_stable(matrix: Matrix) -> bool:
    """Return whether all eigenvalues, also of every matrix within rounding errors, are within the unit circle.

    The computed eigenvalues alone do not say so: where several meet, as the two of a free mass at 1, they carry errors
    of a root of the machine precision and may lie on either side. No matrix A + E with |E| <= e |A| has the eigenvalue
    z if e times the spectral radius of |(z - A)^-1| |A| is below 1 (Rump, SIAM Review 41(1), 1999), which does not
    depend on the units of the states; z is taken at the directions of the eigenvalues near the circle.
    """
    if spectral_radius(matrix) >= 1.0:
        return False
    eigenvalues = np.linalg.eigvals(matrix)
    sizes = np.abs(eigenvalues)
    near = eigenvalues[sizes > 0.9]
    try:
        inverses = np.linalg.inv((near / np.abs(near))[:, None, None] * np.eye(len(matrix)) - matrix)
    except np.linalg.LinAlgError:  # one of them is on the circle
        return False
    return all(MARGIN * spectral_radius(inverse @ np.abs(matrix)) < 1.0 for inverse in np.abs(inverses))


def longest_sample(stable: Callable[[float], bool], Ts: float, halvings: int = 60, closeness: float = 1e-6) -> float:
    """Return the sample time next below Ts at which the loop becomes stable; 0 if none from `FASTEST` on does.

    Parameters
    ----------
    stable : callable
        Whether the loop is stable, from the sample time.
    Ts : float
        A sample time at which the loop is unstable [s].
    halvings, closeness : int, float
        How often it is halved in search of a stable one, and how close to the edge the result is.
    """
    slow, fast = Ts, Ts
    for _ in range(halvings):
        slow, fast = fast, max(fast / 2.0, FASTEST)
        if fast >= slow:
            return 0.0
        if stable(fast):
            break
    else:
        return 0.0
    while slow > fast * (1.0 + closeness):
        middle = math.sqrt(fast * slow)
        fast, slow = (middle, slow) if stable(middle) else (fast, middle)
    return fast
