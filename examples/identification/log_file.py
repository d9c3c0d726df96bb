"""Writes axis.csv, a log file as a drive makes it: of a simulated axis, so that the true parameters are known.

A carriage of 20 kg on a LuGre contact goes to and fro, fast, slowly and in steps below the presliding displacement; an
encoder measures its position in steps of 0.1 um, and the drive logs its command with some noise.
"""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np

from friction_fmus import fmu
from harness import Drive, FmuPart

TRUE = {"sigma0": 1e6, "sigma1": 2e3, "sigma2": 60.0, "Fc": 20.0, "Fs": 25.0, "vs": 5e-3}  # in SI units
M, OF = 20.0, 1.5  # moved mass [kg], offset of the drive [N]
GAIN = 35.15  # of the drive [N/V]
H = 2e-3  # sampling interval [s]

# amplitude [m], frequency [Hz], periods: first those for the fit, then those for the validation, after 14 s
STROKES = [(0.04, 1.0, 3), (4e-3, 0.25, 2), (3e-5, 1.0, 3), (0.025, 0.8, 2), (2e-3, 0.25, 1), (5e-5, 1.0, 2)]


def main(folder: Path) -> None:
    """Simulates the axis and writes its log."""
    fine = H / 10
    q, v, a = (np.concatenate(part) for part in zip(*(stroke(*given, fine) for given in STROKES), strict=True))
    with closing(Drive(FmuPart("friction", fmu("LuGre")))) as contact:
        friction = contact.run({"v": v}, ["F"], fine, between="linear", start=TRUE)[:, 0]
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(q))
    u = (M * a + friction + OF + noise) / GAIN
    t = np.arange(len(q)) * fine
    x = 1e-7 * np.round(q / 1e-7)
    rows = (f"{row[0]:.3f};{1e3 * row[1]:.4f};{row[2]:.5f}" for row in zip(t[::10], x[::10], u[::10], strict=True))
    (folder / "axis.csv").write_text("\n".join(["# axis X, run 7", "t;x;u", *rows]) + "\n", encoding="utf-8")


def stroke(amplitude: float, frequency: float, periods: int, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of strokes A sin(w t / 2)^4, which begin and end at rest."""
    w = 2 * np.pi * frequency
    wt = w * h * np.arange(round(periods / frequency / h))
    q = 3 - 4 * np.cos(wt) + np.cos(2 * wt)
    v = 4 * w * np.sin(wt) - 2 * w * np.sin(2 * wt)
    a = 4 * w**2 * (np.cos(wt) - np.cos(2 * wt))
    return amplitude / 8 * q, amplitude / 8 * v, amplitude / 8 * a


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
