"""A contact that is moved at a constant velocity and vibrated, and its mean friction."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product
from math import ceil, pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from friction_fmus import build
from harness import CallablePart, FmuPart, Port, System

SINE, SQUARE, TRIANGLE = 0.0, 1.0, 2.0
"""Values of Dither's parameter `shape`."""


def mean_forces(
    friction: str,
    ratios: Iterable[float],
    strokes: Iterable[float],
    amplitude: float,
    parameters: Mapping[str, float],
    *,
    shape: float = SINE,
    samples: int = 400,
    settling: float = 0.0,
) -> dict[tuple[float, float], float]:
    """Mean friction over a period at the velocity v0 + A w.

    Parameters
    ----------
    friction : str
        Name of the friction model.
    ratios : iterable of float
        v0/A.
    strokes : iterable of float
        A/(2 pi f), how far a sine moves the contact to either side [m].
    amplitude : float
        A [m/s].
    parameters : mapping of str to float
        Start values of the friction model.
    shape : float
        The waveform w.
    samples : int
        Samples of a period.
    settling : float
        How far the contact is moved to and fro before that period, at least [m].

    Returns
    -------
    dict of (ratio, stroke) to float
        Mean force [N].
    """
    found = {}
    with TemporaryDirectory() as folder:
        parts = [
            FmuPart("dither", build("Dither", Path(folder))),
            # what Dither adds to a force is here added to a velocity
            CallablePart("shaker", lambda t, u, x: u, [Port("u", "N")], [Port("v", "m/s")]),
            FmuPart("friction", build(friction, Path(folder))),
        ]
        start = {"dither.Ad": amplitude, "dither.shape": shape} | {f"friction.{k}": v for k, v in parameters.items()}
        for ratio, stroke in product(ratios, strokes):
            period = 2.0 * pi * stroke / amplitude
            step = period / samples
            periods = 1 + ceil(settling / (4.0 * stroke))
            case = {"dither.f": ratio * amplitude, "dither.frequency": 1.0 / period, "dither.Ts": step}
            with System(parts, ["dither.u -> shaker.u", "shaker.v -> friction.v"], start | case) as system:
                force = system.run(stop=periods * period, step=step, record=["friction.F"])["friction.F"].to_numpy()
            found[ratio, stroke] = float(np.mean(force[-samples:]))
    return found
