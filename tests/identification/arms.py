"""Simulated arms with friction under load, by an integrator of its own: small steps and exact rests."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, cos, exp, pi, sin

import numpy as np

from friction_fmus.identification import ROTARY, Record

TS, SUBSTEPS, LENGTH = 1e-3, 10, 16.0  # [s], steps in a sample, [s]


def temperature(t: float) -> float:
    """Return the temperature of the gear [K]: it warms up, and cools down again."""
    return 295.0 + 20.0 * sin(pi * t / LENGTH) ** 2


MEAN_TEMPERATURE = 305.0


@dataclass(frozen=True)
class Arm:
    """Truth of an axis, by the names of the identification; terms that are absent are 0."""

    M: float
    Fc: float
    Fs: float
    vs: float
    Fv: float
    OF: float
    G_sin: float = 0.0
    G_cos: float = 0.0
    a: float = 0.0
    direction: float = 0.0
    drift: float = 0.0
    warming: float = 0.0  # of friction, per kelvin

    def friction(self, v: float, drive: float, outside: float, t: float) -> float:
        """Return the magnitude of the friction without its viscous part."""
        level = self.Fc + (self.Fs - self.Fc) * exp(-((v / self.vs) ** 2))
        level *= 1.0 + self.a * abs(outside - drive) / self.Fc
        level *= 1.0 + self.warming * (temperature(t) - MEAN_TEMPERATURE)
        return level * (1.0 + self.direction * copysign(1.0, v)) * (1.0 + self.drift * (t - 0.5 * LENGTH))


def drawn(number: int) -> Arm:
    """Return an arm; the bits of its number say which terms it has."""
    random = np.random.default_rng(1000 + number)
    M, Fc = 10.0 ** random.uniform(-3.0, -1.0), 10.0 ** random.uniform(-2.0, -0.5)
    base = {"M": M, "Fc": Fc, "Fs": Fc * random.uniform(1.0, 1.3), "vs": random.uniform(0.1, 0.3)}
    base |= {"Fv": 0.1 * Fc * random.uniform(0.5, 2.0), "OF": 0.1 * Fc * random.normal()}
    gravity = 2.0 * Fc * random.uniform(1.0, 3.0)
    angle = random.uniform(-0.3, 0.3)
    terms = [
        {"G_sin": gravity * cos(angle), "G_cos": gravity * sin(angle)},
        {"a": random.uniform(0.05, 0.3)},
        {"direction": random.choice([-1.0, 1.0]) * random.uniform(0.05, 0.2)},
        {"drift": random.choice([-1.0, 1.0]) * random.uniform(0.1, 0.3) / LENGTH},
    ]
    for bit, term in enumerate(terms):
        if number >> bit & 1:
            base |= term
    return Arm(**base)


def moved(arm: Arm, number: int) -> Record:
    """Return the record of an arm that follows a sum of sines."""
    random = np.random.default_rng(2000 + number)
    t = TS * np.arange(round(LENGTH / TS))
    waves = [(0.8, 0.23, 0.0), (0.3, 0.71, random.uniform(0.0, 6.0)), (0.12, 1.9, random.uniform(0.0, 6.0))]
    r = sum(A * np.sin(2.0 * pi * f * t + phase) for A, f, phase in waves)
    rd = sum(A * 2.0 * pi * f * np.cos(2.0 * pi * f * t + phase) for A, f, phase in waves)
    rdd = np.gradient(rd, TS)
    w = 2.0 * pi * 8.0
    q, v, h = float(r[0]), float(rd[0]), TS / SUBSTEPS
    angle, torque = np.empty(len(t)), np.empty(len(t))
    for k in range(len(t)):
        for i in range(SUBSTEPS):
            now = t[k] + i * h
            want, speed = r[k] + i * h * rd[k], rd[k] + i * h * rdd[k]
            drive = arm.M * (w * w * (want - q) + 1.4 * w * (speed - v)) + arm.G_sin * sin(q) + arm.G_cos * cos(q)
            if i == 0:
                angle[k], torque[k] = q, drive
            outside = -(arm.G_sin * sin(q) + arm.G_cos * cos(q)) - arm.OF
            free = drive + outside - arm.Fv * v
            way = copysign(1.0, v) if v != 0.0 else copysign(1.0, free)
            level = arm.friction(v if v != 0.0 else way * 1e-12, drive, outside, now)
            if v == 0.0 and abs(free) <= level:
                continue
            new = v + h * (free - way * level) / arm.M
            if v != 0.0 and new * v < 0.0:
                new = 0.0
            q, v = q + h * 0.5 * (v + new), new
    noise = 0.005 * float(np.std(torque))
    measured = np.round((angle + random.normal(0.0, 1e-5, len(t))) / 1e-5) * 1e-5
    return Record(f"arm {number}", t, q=measured, force=torque + random.normal(0.0, noise, len(t)), units=ROTARY)
