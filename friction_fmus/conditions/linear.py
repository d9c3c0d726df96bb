"""Sampled linear loops around a mass: step matrices, stability, and the longest stable sample time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Matrix: TypeAlias = NDArray[np.float64]

FASTEST: Final = 1e-6
"""Shortest sample time that is recommended [s]; drives sample every 10 us at best."""

MARGIN: Final = 1e-12
"""Relative change of its matrix elements under which a loop must stay stable to count as stable.

This is about a thousand times the rounding error of a matrix exponential and a few products. At 1 kHz, a loop whose
slowest pole has a time constant of a hundred years fails the test.
"""


def held(A: Matrix, b: Matrix, time: float) -> tuple[Matrix, Matrix]:
    """Return P and q of state(time) = P state(0) + q u for state' = A state + b u and a held force u."""
    n = len(b)
    exponent = np.zeros((n + 1, n + 1))
    exponent[:n, :n], exponent[:n, n] = A, b
    # scipy.signal.cont2discrete does the same, but takes 0.5 s to import
    found = np.asarray(expm(time * exponent), dtype=np.float64)
    return found[:n, :n], found[:n, n]


def held_mass(m: float, damping: float, stiffness: float, Ts: float) -> tuple[Matrix, Matrix]:
    """Return A and b of a mass with damper and spring: (x, v) after Ts is A (x, v) + b u for a held force u."""
    return held(np.array([[0.0, 1.0], [-stiffness / m, -damping / m]]), np.array([0.0, 1.0 / m]), Ts)


def spectral_radius(matrix: Matrix) -> float:
    """Return the largest magnitude of the eigenvalues; infinity if the matrix has overflowed."""
    if not np.isfinite(matrix).all():
        return math.inf
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def is_stable(matrix: Matrix) -> bool:
    """Return whether all eigenvalues of the matrix, and of every matrix within `MARGIN`, are within the unit circle.

    The computed eigenvalues alone are not sufficient. A multiple eigenvalue, such as the double one of a free mass at
    1, has an error of the order of a root of the machine precision and may be computed on either side of the circle. No
    matrix A + E with |E| <= e |A| has the eigenvalue z if e times the spectral radius of |(z - A)^-1| |A| is below 1
    (Rump, SIAM Review 41(1), 1999); this test does not depend on the units of the states. It is evaluated at the points
    of the circle in the directions of the eigenvalues near it.
    """
    if spectral_radius(matrix) >= 1.0:
        return False
    eigenvalues = np.linalg.eigvals(matrix)
    sizes = np.abs(eigenvalues)
    near = eigenvalues[sizes > 0.9]
    try:
        inverses = np.linalg.inv((near / np.abs(near))[:, None, None] * np.eye(len(matrix)) - matrix)
    except np.linalg.LinAlgError:  # an eigenvalue is on the circle
        return False
    return all(MARGIN * spectral_radius(inverse @ np.abs(matrix)) < 1.0 for inverse in np.abs(inverses))


def longest_sample(stable: Callable[[float], bool], Ts: float, halvings: int = 60, closeness: float = 1e-6) -> float:
    """Return the sample time below Ts at which the loop becomes stable; 0 if it is unstable down to `FASTEST`."""
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
