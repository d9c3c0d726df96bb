"""The motion that a record lacks: a chirp on a slow motion, which shows up to which frequency an axis is rigid."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from friction_fmus.identification import Array
from friction_fmus.study.evaluation import AxisBench
from harness.storage.files import atomic_path

EXPERIMENT_FILE: Final = "next_experiment.csv"
DURATION: Final = 20.0  # [s]
SLOW: Final = 4  # periods of the slow motion
BAND: Final = (0.5, 10.0)  # band of the chirp, in natural frequencies of the position loop
HIGHEST: Final = 0.1  # highest frequency divided by the sample rate
FORCE: Final = 0.3  # inertia force of the chirp over what friction leaves of the force limit
TRAVEL: Final = 0.5  # amplitude of the slow motion, and largest one of the chirp, in parts of half the travel


@dataclass(frozen=True, eq=False)
class NextExperiment:
    """Reference of the experiment."""

    t: Array
    r: Array
    """Time [s] and reference [m or rad], which begins and ends at rest in the middle of the recorded travel."""
    band: tuple[float, float]  # first and last frequency of the chirp [Hz]


def next_experiment(bench: AxisBench, level: float) -> NextExperiment:
    """Return a logarithmic chirp of constant acceleration on a slow sine, within force limit and recorded travel."""
    Ts, natural = bench.servo.Ts, bench.bandwidth / (2.0 * np.pi)
    low, high = BAND[0] * natural, min(BAND[1] * natural, HIGHEST / Ts)
    t = Ts * np.arange(round(DURATION / Ts) + 1.0)
    rate = np.log(high / low) / DURATION
    frequency = low * np.exp(rate * t)
    phase = 2.0 * np.pi * (frequency - low) / rate
    half = 0.5 * TRAVEL * float(np.ptp(bench.r))
    left = max(bench.servo.force_limit - level - abs(bench.plant.offset), 0.0)
    acceleration = min(FORCE * left / bench.plant.mass, half * (2.0 * np.pi * low) ** 2)
    fade = np.sin(np.pi * np.clip(np.minimum(t, DURATION - t) * low, 0.0, 0.5)) ** 2  # two periods at either end
    slow = 0.5 * half * (1.0 - np.cos(2.0 * np.pi * SLOW / DURATION * t))
    middle = 0.5 * float(np.min(bench.r) + np.max(bench.r))
    r = middle + slow + fade * acceleration / (2.0 * np.pi * frequency) ** 2 * np.sin(phase)
    return NextExperiment(t, r, (low, high))


def write_experiment(folder: Path, found: NextExperiment, unit: str) -> Path:
    """Write time and reference as CSV with units in the heading; return the file."""
    path = folder / EXPERIMENT_FILE
    rows = np.column_stack([found.t, found.r])
    with atomic_path(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.9g", delimiter=",", header=f"t [s],reference [{unit}]", comments="")
    return path
