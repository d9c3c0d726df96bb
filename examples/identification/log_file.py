"""Writes axis.csv, a log file as a drive makes it: of a simulated axis, so that the true parameters are known.

A carriage of 20 kg on a LuGre contact goes to and fro, fast, slowly and in steps below the presliding distance; an
encoder measures its position in steps of 0.1 um, and the drive logs its command with some noise.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from friction_fmus import fmu
from harness import FmuPart, SeriesPart, System

TRUE = {"sigma0": 1e6, "sigma1": 2e3, "sigma2": 60.0, "Fc": 20.0, "Fs": 25.0, "vs": 5e-3}  # in SI units
M, OF = 20.0, 1.5  # moved mass [kg], offset of the drive [N]
GAIN = 35.15  # of the drive [N/V]
H = 2e-3  # sampling interval [s]

# amplitude [m], frequency [Hz], periods: first those for the fit, then those for the validation, from 14 s on
STROKES = [(0.04, 1.0, 3), (4e-3, 0.25, 2), (3e-5, 1.0, 3), (0.025, 0.8, 2), (2e-3, 0.25, 1), (5e-5, 1.0, 2)]


def main(folder: Path) -> None:
    """Simulates the axis and writes its log."""
    fine = H / 10
    q, v, a = (np.concatenate(part) for part in zip(*(stroke(*given, fine) for given in STROKES), strict=True))
    t = np.arange(len(v)) * fine
    motion = SeriesPart("motion", t, {"v": v}, {"v": "m/s"})
    start = {f"friction.{name}": value for name, value in TRUE.items()}
    parts = [motion, FmuPart("friction", fmu("LuGre"))]
    with System(parts=parts, wires=["motion.v -> friction.v"], start=start) as system:
        friction = system.run(stop=t[-1], step=fine)["friction.F"].to_numpy()
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(t))
    u = (M * a + friction + OF + noise) / GAIN
    x = 1e-7 * np.round(q / 1e-7)
    rows = (f"{row[0]:.3f};{1e3 * row[1]:.4f};{row[2]:.5f}" for row in zip(t[::10], x[::10], u[::10], strict=True))
    (folder / "axis.csv").write_text("\n".join(["# axis X, run 7", "t;x;u", *rows]) + "\n", encoding="utf-8")


def stroke(amplitude: float, frequency: float, periods: int, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of strokes from rest to rest."""
    w = 2 * np.pi * frequency
    wt = w * h * np.arange(round(periods / frequency / h))
    half = amplitude / 2
    return half * (1 - np.cos(wt)), half * w * np.sin(wt), half * w**2 * np.cos(wt)


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
