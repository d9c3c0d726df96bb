"""Robustness margins of the sampled loop of an axis, from its frequency response cut open at the drive force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.chain import DrivenPlant, PathDynamics, SampledLaw, chain
from friction_fmus.conditions.linear import Matrix, held, is_stable, spectral_radius

Response = NDArray[np.complex128]

POINTS = 1500
"""Number of frequencies at which the loop is evaluated, from `LOWEST` times the Nyquist frequency up to it."""

LOWEST = 1e-5

RIGOROUS = 40
"""Number of states up to which stability is tested for all matrices within rounding errors."""


@dataclass(frozen=True)
class Margins:
    """Margins of a loop."""

    stable: bool
    """Whether the loop is stable; otherwise the margins are those of an unstable loop, and `sensitivity` is infinite.
    """
    sensitivity: float
    """Peak of the sensitivity function Ms = max |1/(1 + L)|."""
    phase: float
    """Phase margin [rad]; infinite if the gain is nowhere 1."""
    delay: float
    """Delay margin [samples]: further delay at which the loop becomes unstable; infinite if the gain is nowhere 1."""


def loop_margins(plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, window: int = 0, delay: int = 0) -> Margins:
    """Return the margins of a sampled loop with respect to the force of the drive.

    Notes
    -----
    With the transfer functions K of all laws from (x, v, u_prev) to the force and P of the held plant, the loop is

        L(z) = -(Kx Px + Kv Pv) / (1 - Ku/z) z^-delay

    (Astrom, Wittenmark: Computer-Controlled Systems, 3rd ed., 1997; Ms: Astrom, Hagglund: Advanced PID Control, 2006).
    """
    w = math.pi * np.geomspace(LOWEST, 1.0, POINTS)
    L = open_loop(plant, laws, Ts, window, delay, np.exp(1j * w))
    loop = chain(plant, laws, Ts, PathDynamics(delay=delay * Ts, window=window))
    # a long filter has many states, for which the rigorous test takes gigabytes
    stable = is_stable(loop) if len(loop) <= RIGOROUS else spectral_radius(loop) < 1.0
    size, lag = np.abs(L), np.angle(L)
    at = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)
    share = (size[at] - 1.0) / (size[at] - size[at + 1])  # linear interpolation to |L| = 1
    turned = np.angle(L[at + 1] / L[at])
    phase = (lag[at] + share * turned + math.pi) % (2.0 * math.pi)
    frequency = w[at] + share * (w[at + 1] - w[at])
    return Margins(
        stable,
        float(np.max(1.0 / np.maximum(np.abs(1.0 + L), 1e-300))) if stable else math.inf,
        float(np.min(np.minimum(phase, 2.0 * math.pi - phase), initial=math.inf)),
        float(np.min(phase / frequency, initial=math.inf)),
    )


def open_loop(
    plant: DrivenPlant, laws: Sequence[SampledLaw], Ts: float, window: int, delay: int, z: Response
) -> Response:
    """Return L at points z of the complex plane, shape (n,); see `loop_margins`."""
    step, push = held(plant.A, plant.b, Ts)
    motion = _response(step, push[:, None], np.array([plant.x, plant.v]), np.zeros((2, 1)), z)[:, :, 0]
    x, v = motion.T
    if window:
        v = x * (1.0 - z**-window) / (window * Ts)
    K = np.zeros((len(z), 3), dtype=complex)
    for law in laws:
        K += _response(law.A, law.B, law.C[None, :], law.D[None, :], z)[:, 0, :]
    found: Response = -(K[:, 0] * x + K[:, 1] * v) / (1.0 - K[:, 2] / z) * z**-delay
    return found


def _response(A: Matrix, B: Matrix, C: Matrix, D: Matrix, z: Response) -> Response:
    """Return C (z - A)^-1 B + D at each z, shape (n, outputs, inputs)."""
    found = np.broadcast_to(D.astype(complex), (len(z), *D.shape)).copy()
    if not len(A):
        return found
    if not np.triu(A).any():  # strictly lower triangular: a finite impulse response, of up to 1000 states
        row, power = C, 1.0 / z
        while row.any():
            found += power[:, None, None] * (row @ B)
            row, power = row @ A, power / z
        return found
    return found + C @ np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (len(z), *B.shape)))
