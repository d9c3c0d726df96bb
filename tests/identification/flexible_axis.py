"""A simulated servo axis of one or two masses with known defects, computed here without the FMUs."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, pi, sin

import numpy as np
from thorough import THOROUGH

from friction_fmus.identification import LINEAR, Record

FINE = 20 if THOROUGH else 10  # steps of the plant in a sample


@dataclass(frozen=True)
class Axis:
    """Masses [kg], friction [N, N.s/m], coupling and servo; with load = 0, one rigid mass."""

    motor: float = 12.0
    load: float = 0.0
    resonance: float = 8.0  # of the free masses [Hz]
    damping: float = 0.03  # of the antiresonance
    forward: float = 18.0
    backward: float = 18.0  # Coulomb friction of the motor by direction [N]
    viscous: float = 45.0
    presliding: float = 0.0  # stiffness of an elastic and ideally plastic contact in place of Coulomb friction [N/m]
    load_friction: float = 0.0  # Coulomb friction of the load [N]
    drift: float = 0.0  # growth of the Coulomb friction during the record, relative
    offset_drift: float = 0.0  # growth of a constant force during the record [N]
    gravity: float = 0.0  # amplitude of a force over sin(wave q) [N]
    wave: float = 1.0  # [rad/m]
    outside: tuple[float, float] = (0.0, 1.0)  # amplitude and frequency of a force that the log does not have [N, Hz]
    backlash: float = 0.0  # gap between motor and load [m]
    stiffness: float = 0.0  # of the closed gap; 0: from the resonance [N/m]
    kp: float = 40.0
    kv: float = 1500.0
    limit: float = 400.0
    Ts: float = 1e-3
    quantum: float = 1e-7
    delay: int = 1
    noise: float = 0.0  # of the recorded force [N]


def reference(t: np.ndarray, stroke: float = 0.1) -> np.ndarray:
    """Two harmonics, as of a machine that moves back and forth, with a short dwell after each second period."""
    w = 2.0 * pi * 0.4
    return stroke * (1.0 - np.cos(w * t)) / 2.0 + 0.06 * stroke * (1.0 - np.cos(6.0 * w * t))


def moves(t: np.ndarray, stroke: float = 0.1, duration: float = 0.35, period: float = 0.6) -> np.ndarray:
    """Point-to-point moves with constant acceleration and deceleration, and a dwell after each."""
    part = np.clip((t % period) / duration, 0.0, 1.0)
    way = np.where(part < 0.5, 2.0 * part**2, 1.0 - 2.0 * (1.0 - part) ** 2)
    return stroke * np.where((t // period) % 2 == 0, way, 1.0 - way)


def simulate(axis: Axis, r: np.ndarray, seed: int = 0) -> Record:
    """Simulate the servo along a reference and return position and force as its drive records them."""
    h, n = axis.Ts / FINE, len(r)
    m1, m2 = axis.motor, axis.load
    k = (2.0 * pi * axis.resonance) ** 2 / (1.0 / m1 + 1.0 / m2) if m2 else 0.0
    k = axis.stiffness or k
    c = 2.0 * axis.damping * (k * m2) ** 0.5
    x1 = x2 = v1 = v2 = 0.0
    q, force = [0.0] * n, [0.0] * n
    queue = [0.0] * (axis.delay + 1)
    half, bristle = 0.5 * axis.backlash, 0.0
    for i in range(n):
        q[i] = axis.quantum * floor(x1 / axis.quantum + 0.5)
        command = axis.kv * (axis.kp * (r[i] - q[i]) - (q[i] - q[max(i - 2, 0)]) / (2.0 * axis.Ts))
        force[i] = min(max(command, -axis.limit), axis.limit)
        queue = [*queue[1:], force[i]]
        grown = 1.0 + axis.drift * i / n
        outside = axis.offset_drift * i / n - axis.outside[0] * sin(2.0 * pi * axis.outside[1] * axis.Ts * i)
        for _ in range(FINE):
            spring = 0.0
            if m2:
                twist = x1 - x2
                stretch = twist - half if twist > half else twist + half if twist < -half else 0.0
                spring = k * stretch + (c * (v1 - v2) if stretch or not half else 0.0)
            free = v1 + h / m1 * (queue[0] - outside - axis.gravity * sin(axis.wave * x1) - axis.viscous * v1 - spring)
            if axis.presliding:
                bristle = slide(bristle + axis.presliding * h * v1, axis.forward)
                v1 = free - h / m1 * bristle
            else:
                v1 = slowed(free, h / m1 * grown * (axis.forward if free > 0.0 else axis.backward))
            x1 += h * v1
            if m2:
                v2 = slowed(v2 + h / m2 * spring, h / m2 * axis.load_friction)
                x2 += h * v2
    t = axis.Ts * np.arange(float(n))
    recorded = np.array(force) + axis.noise * np.random.default_rng(seed).standard_normal(n)
    return Record("axis", t, q=np.array(q), reference=r, force=recorded, units=LINEAR, quantum=axis.quantum)


def slide(force: float, limit: float) -> float:
    """Return the force of an elastic and ideally plastic contact."""
    return min(max(force, -limit), limit)


def slowed(v: float, change: float) -> float:
    """Return a velocity after Coulomb friction, implicitly: friction stops a motion, but does not reverse it."""
    return v - change if v > change else v + change if v < -change else 0.0


def deviation_of_two_masses(axis: Axis, f: float) -> float:
    """Return the relative deviation of the force over acceleration of the motor from the total mass, at a frequency."""
    s = 2j * pi * f
    k = (2.0 * pi * axis.resonance) ** 2 / (1.0 / axis.motor + 1.0 / axis.load)
    c = 2.0 * axis.damping * (k * axis.load) ** 0.5
    transfer = (c * s + k) / (axis.load * s**2 + c * s + k)
    return abs((axis.motor + axis.load * transfer) / (axis.motor + axis.load) - 1.0)
