"""Sampled linear loops around a mass: matrices, and how fast one must sample."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Matrix: TypeAlias = NDArray[np.float64]


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
    """The largest magnitude of the eigenvalues."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def longest_sample(radius: Callable[[float], float], Ts: float, halvings: int = 60, closeness: float = 1e-6) -> float:
    """The sample time next below Ts at which the spectral radius comes down to 1; 0 if it does not.

    Parameters
    ----------
    radius : callable
        From the sample time.
    Ts : float
        A sample time at which the loop is unstable [s].
    halvings, closeness : int, float
        How often it is halved in search of a stable one, and how close to the edge the result is.
    """
    unstable = Ts
    for _ in range(halvings):
        stable = unstable / 2.0
        if radius(stable) < 1.0:
            break
        unstable = stable
    else:
        return 0.0
    while unstable > stable * (1.0 + closeness):
        middle = math.sqrt(stable * unstable)
        stable, unstable = (middle, unstable) if radius(middle) < 1.0 else (stable, middle)
    return stable
