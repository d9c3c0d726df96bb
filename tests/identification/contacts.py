"""Contacts whose friction is computed without the blocks: closed forms, and LuGre by LSODA of SciPy."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

LUGRE: Mapping[str, float] = {"sigma0": 1e5, "sigma1": 300.0, "sigma2": 20.0, "Fc": 10.0, "Fs": 15.0, "vs": 5e-3}


def noise(seed: int, samples: int, size: float = 0.01) -> Array:
    return size * np.random.default_rng(seed).standard_normal(samples)


def lugre_motion(samples: int, step: float) -> tuple[Array, Array]:
    """Times and velocities: two thirds of slow to fast sliding to and fro, then small motions at 20 Hz."""
    t = step * np.arange(samples)
    end = t[-1] * 2.0 / 3.0
    slide = 3e-2 * np.sin(2.0 * np.pi * 2.0 * t / end)
    small = 6e-3 * np.sin(2.0 * np.pi * 20.0 * (t - end))
    return t, np.where(t < end, slide, small)


def lugre_force(t: Array, v: Array, p: Mapping[str, float] = LUGRE) -> Array:
    """LuGre (Canudas de Wit et al. 1995, equations 2, 3, 5) along straight lines of the velocity, by LSODA."""

    def level(speed: Array) -> Array:
        return p["Fc"] + (p["Fs"] - p["Fc"]) * np.exp(-((speed / p["vs"]) ** 2))

    def slip(speed: Array, z: Array) -> Array:
        return speed - p["sigma0"] * np.abs(speed) / level(speed) * z

    solution = solve_ivp(
        lambda s, z: slip(np.interp(s, t, v), z),
        (t[0], t[-1]),
        [0.0],
        method="LSODA",
        t_eval=t,
        rtol=1e-8,
        atol=1e-13,
        max_step=2.0 * (t[1] - t[0]),
    )
    z = solution.y[0]
    force: Array = p["sigma0"] * z + p["sigma1"] * slip(v, z) + p["sigma2"] * v
    return force


def dahl_force(q: Array, sigma: float, Fc: float, z: float = 0.0) -> Array:
    """Dahl with n = 1 along a path: the deflection relaxes to the level over the path, in closed form."""
    found = [sigma * z]
    for dx in np.diff(q):
        level = np.sign(dx) * Fc / sigma
        z = level + (z - level) * np.exp(-sigma * abs(dx) / Fc)
        found.append(sigma * z)
    return np.array(found)


def maxwell_force(q: Array, k: Array, W: Array, begin: Array) -> Array:
    """Elastic, perfectly plastic elements along a path."""
    forces = np.array(begin, dtype=np.float64)
    found = [forces.sum()]
    for dx in np.diff(q):
        forces = np.clip(forces + k * dx, -W, W)
        found.append(forces.sum())
    return np.array(found)


def stribeck_force(v: Array, Fc: float, Fs: float, vs: float, Fv: float) -> Array:
    """Stribeck curve with the exponent 2, and viscous friction."""
    force: Array = np.sign(v) * (Fc + (Fs - Fc) * np.exp(-((v / vs) ** 2))) + Fv * v
    return force


def reversals(samples: int, reach: float) -> Array:
    """A path of several reversals of different size, the largest over `reach` to either side."""
    t = np.linspace(0.0, 1.0, samples)
    path: Array = reach * (0.7 * np.sin(2.0 * np.pi * 2.0 * t) + 0.3 * np.sin(2.0 * np.pi * 9.0 * t))
    return path - path[0]
