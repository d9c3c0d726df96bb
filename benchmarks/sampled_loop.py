"""A servo loop at 2 kHz: what it costs to step a feedforward behind the plant.

The force of the feedforward is held for a sample, so it comes half a sample late on the mean; stepped behind the plant
it comes one sample later still. If that is all that the feedforward does wrong, the tracking error goes with the lag:
three times as large, in the limit of samples that are short against the motion (here, at 0.03 rad a sample, 3.03 times,
at half of that 3.016 times). So it is in sliding that never reverses: there friction is Fc + sigma2 v for the
feedforward and for LuGre alike, and the inertia, of an oscillation on top of the motion, is exact but for its time.
Where the motion reverses the error is that of presliding, which the feedforward does not know, and a sample more or
less says nothing.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from benchmarks.rows import Row
from friction_fmus import build
from harness import FmuPart, System

SAMPLE = 5e-4  # [s]
BLOCKS = {"reference": "Sine", "pid": "PID", "feedforward": "StaticFeedforward", "mass": "Mass", "friction": "LuGre"}
WIRES = (
    *(f"reference.{name} -> pid.{name}" for name in ("r", "rd")),
    *(f"reference.{name} -> feedforward.{name}" for name in ("rd", "rdd")),
    *("mass.x -> pid.x", "mass.v -> pid.v", "feedforward.u -> pid.f", "pid.u -> mass.F_drive"),
    *("mass.v -> friction.v", "friction.F -> mass.F_friction"),
)
SLIDING = ((0.5, 0.05), (2e-4, 10.0))
"""Amplitude [m] and frequency [Hz]: for the 3.5 s that are run the velocity stays above 0.06 m/s, 60 times vs."""

REVERSING = ((0.01, 1.0),)
ORDERS = (
    ("feedforward", "pid", "mass", "friction", "reference"),
    ("pid", "mass", "friction", "feedforward", "reference"),
)


def residuals(folder: Path, sines: tuple[tuple[float, float], ...]) -> list[float]:
    """Root mean square of r - x [m] with the feedforward before and behind the plant, without the first second."""
    start = {"pid.Ts": SAMPLE, "feedforward.Ts": SAMPLE, "pid.rdd": 0.0}
    for number, (amplitude, frequency) in enumerate(sines, 1):
        start |= {f"reference.amplitude[{number}]": amplitude, f"reference.frequency[{number}]": frequency}
    start["mass.v0"] = sum(2.0 * math.pi * amplitude * frequency for amplitude, frequency in sines)
    parts = [FmuPart(name, build(block, folder)) for name, block in BLOCKS.items()]
    found = []
    with System(parts, WIRES, start) as system:
        for order in ORDERS:
            result = system.run(stop=3.5, step=SAMPLE, order=order, record=["reference.r", "mass.x"])
            error = (result["reference.r"] - result["mass.x"]).to_numpy()[round(1.0 / SAMPLE) :]
            found.append(float(np.sqrt(np.mean(error**2))))
    return found


def sampled_rows(folder: Path) -> list[Row]:
    """The law where it holds, and where it does not."""
    before, behind = residuals(folder, SLIDING)
    early, late = residuals(folder, REVERSING)
    return [
        Row("Servo loop, sliding: residual with the feedforward behind / before the plant", behind / before, "x"),
        Row("Servo loop, sliding: deviation of that ratio from 3", abs(behind / before - 3.0), "", 0.1),
        Row("Servo loop, reversing: residual with the feedforward behind / before the plant", late / early, "x"),
    ]
