"""Random smooth motions and forces, as lines between nodes, and what drives each block."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from fmpy.model_description import ModelDescription
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODE = 1e-3  # s
SPEED = 5e-3  # m/s, five times the Stribeck velocity of the models
HOLD = 0.1  # s
FORCES = {"F_ext": 2.0, "F_drive": 2.0, "F_load": 0.2, "F_friction": 0.5}
"""Amplitudes in N: F_ext is above static friction, 1.5 N, for part of the time."""


def wave(rng: np.random.Generator, t: Array) -> Array:
    """A sum of four sines between 0.5 and 6 Hz with an amplitude of about 1."""
    frequencies, amplitudes, phases = rng.uniform(0.5, 6.0, 4), rng.normal(size=4), rng.uniform(0.0, 2.0 * np.pi, 4)
    angles = 2.0 * np.pi * np.outer(t, frequencies) + phases
    return np.asarray(np.sin(angles) @ amplitudes / 2.0)


def velocity(rng: np.random.Generator, t: Array) -> Array:
    """Smooth motion with reversals, and a hold at v = 0 that it enters and leaves with a finite acceleration."""
    begin = rng.uniform(0.2, 0.6) * t[-1]
    away = np.clip(np.maximum(begin - t, t - begin - HOLD) / 0.05, 0.0, 1.0)
    return np.asarray(SPEED * rng.choice([0.03, 0.3, 1.0]) * wave(rng, t) * away)


def drawn(description: ModelDescription, seed: int, duration: float) -> tuple[Array, Mapping[str, Array]]:
    """The nodes and a line for each Real input."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration + 0.5 * NODE, NODE)
    lines: dict[str, Array] = {}
    for v in description.modelVariables:
        if v.causality != "input" or v.type != "Real":
            continue
        start = float(v.start)
        if v.name in FORCES:
            lines[v.name] = FORCES[v.name] * wave(rng, t)
        elif v.name in ("Fn", "F_t"):
            lines[v.name] = start * (1.0 + 0.3 * np.sin(3.0 * t) * (seed % 2))
        elif v.name in ("x", "v", "v_belt", "v_support"):
            lines[v.name] = velocity(rng, t)
        else:
            lines[v.name] = start + 0.0 * t
    return t, lines
