"""A simulated servo axis with known parameters, computed here without the FMUs: mass, Coulomb and viscous friction."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, pi
from pathlib import Path

import numpy as np

M, FC, FV, OFFSET = 95.0, 20.0, 200.0, -3.0  # kg, N, N.s/m, N
KP, KV, LIMIT = 160.0, 8500.0, 350.0  # 1/s, N.s/m, N
TS, FINE, QUANTUM = 1e-3, 50, 1e-7  # s, steps in a sample, m

SERVO = f"""
[servo]
law = "CascadePPI"
kp = {KP}
kv = {KV}
Ts = 1e-3
force_limit = {LIMIT}
window = 2
quantum = 1e-7
"""


@dataclass(frozen=True, eq=False)
class Log:
    """Time, reference, measured position, force of the drive and the part of it that was added from outside."""

    t: np.ndarray
    r: np.ndarray
    q: np.ndarray
    force: np.ndarray
    injected: np.ndarray

    def write(self, path: Path, *, injected: bool = False, force: np.ndarray | None = None) -> None:
        """Write the log as CSV, with the injected force as a column if wanted."""
        columns = [self.t, 1e3 * self.r, 1e3 * self.q, self.force if force is None else force]
        head = ["time [s]", "reference [mm]", "position [mm]", "force [N]"]
        if injected:
            columns, head = [*columns, self.injected], [*head, "injected [N]"]
        rows = (",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
        path.write_text("\n".join([",".join(head), *rows]) + "\n", encoding="utf-8")


def pulses(t: np.ndarray, height: float = 90.0) -> np.ndarray:
    """Pulses of 0.1 s, one every 0.7 s, as for the excitation of an axis."""
    return np.where((t > 0.5) & (t % 0.7 < 0.1), height, 0.0)


def simulate(duration: float, injected: float = 0.0) -> Log:
    """Simulate the servo for some seconds; pulses of this height [N] are added to its force."""
    t = TS * np.arange(float(round(duration / TS)))
    r = 0.03 * (1.0 - np.cos(2.0 * pi * 0.4 * t)) + 4e-3 * (1.0 - np.cos(2.0 * pi * 1.3 * t))
    added = pulses(t, injected) if injected else np.zeros_like(t)
    q, force = np.zeros_like(t), np.zeros_like(t)
    x = v = 0.0
    h = TS / FINE
    for k in range(len(t)):
        q[k] = QUANTUM * floor(x / QUANTUM + 0.5)
        measured = (q[k] - q[max(k - 2, 0)]) / (2.0 * TS)
        command = KV * (KP * (r[k] - q[k]) - measured)
        force[k] = min(max(command + added[k], -LIMIT), LIMIT)
        for _ in range(FINE):
            free = v + h / M * (force[k] - OFFSET - FV * v)
            slow = h / M * FC
            v = free - slow if free > slow else free + slow if free < -slow else 0.0  # implicit Coulomb friction
            x += h * v
    return Log(t, r, q, force, added)
