"""Write three log files of a simulated axis, as a drive, a recorder and a robot controller write them.

The axis has an inertia of 0.012 kg.m2, 0.8 N.m Coulomb friction, 0.05 N.m.s/rad viscous friction and an offset of
0.04 N.m. Its servo is u = kv (kp (r - q) + r' - v); the torque constant is 0.5 N.m/A.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

INERTIA, COULOMB, VISCOUS, OFFSET, TORQUE_CONSTANT = 0.012, 0.8, 0.05, 0.04, 0.5
KP, KV = 25.0, 0.6
INNER = 10  # simulation steps in a sample


def axis(step: float, seconds: float, slow: float = 0.6, fast: float = 1.7) -> NDArray[np.float64]:
    """Return time, position, velocity, torque and reference at the samples of the servo."""
    t = step * np.arange(round(seconds / step))
    r = 1.2 * np.sin(2 * np.pi * slow * t) + 0.5 * np.sin(2 * np.pi * fast * t)
    rd = np.gradient(r, t)
    q = v = 0.0
    rows = []
    for k in range(len(t)):
        u = KV * (KP * (r[k] - q) + rd[k] - v)
        rows.append((t[k], q, v, u, r[k]))
        for _ in range(INNER):
            drive = u - OFFSET
            if v == 0.0 and abs(drive) <= COULOMB:
                continue
            after = v + step / INNER * (drive - COULOMB * np.sign(v or drive) - VISCOUS * v) / INERTIA
            v = 0.0 if v * after < 0.0 else after
            q += step / INNER * v
    return np.array(rows).T


def drive(path: Path) -> None:
    """Write what a drive logs: a preamble, names and units in two rows, counts, rpm and mA."""
    t, q, v, torque, _ = axis(1e-3, 8.0)
    lines = ["Created:;2026-03-02 10:11:12", "Sampling period:;1.000"]
    lines += [";Position actual value;Velocity actual value;Current actual value", "ms;qc;rpm;mA"]
    counts, rpm, current = np.round(q * 4096 / (2 * np.pi)), v * 30 / np.pi, 1e3 * torque / TORQUE_CONSTANT
    lines += [f"{1e3 * a:.3f};{b:.0f};{c:.2f};{d:.1f}" for a, b, c, d in zip(t, counts, rpm, current, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def recorder(path: Path) -> None:
    """Write a German recording with decimal commas."""
    t, q, _, torque, r = axis(2e-3, 6.0)
    lines = ["Messung;Achse X", "Zeit [s];Istposition [°];Sollposition [°];Iststrom [A];Status"]
    columns = zip(t, np.degrees(q), np.degrees(r), torque / TORQUE_CONSTANT, strict=True)
    lines += [f"{a:.4f};{b:.5f};{c:.5f};{d:.5f};OK".replace(".", ",") for a, b, c, d in columns]
    path.write_text("\n".join(lines) + "\n", encoding="iso-8859-1")


def robot(path: Path) -> None:
    """Write two joints without headings: time, positions, velocities and currents."""
    (t, *one), (_, *two) = axis(8e-3, 8.0), axis(8e-3, 8.0, 0.45, 1.3)
    columns = [1203.4 + t, *(part for pair in zip(one[:3], two[:3], strict=True) for part in pair)]
    columns[5:] = [column / TORQUE_CONSTANT for column in columns[5:]]
    path.write_text("\n".join(",".join(f"{x:.6f}" for x in row) for row in zip(*columns, strict=True)) + "\n")


if __name__ == "__main__":
    drive(Path("drive.csv"))
    recorder(Path("messung.csv"))
    robot(Path("joints.csv"))
