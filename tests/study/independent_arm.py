"""An arm with gravity and friction under load, its sampled servo and a log, simulated with steps of its own."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import copysign, cos, exp, sin
from pathlib import Path

import numpy as np
from identification.arms import Arm
from independent_axis import Law

TS, SUBSTEPS, LIMIT = 1e-3, 10, 40.0  # [s], steps in a sample, [N m]
ARM = Arm(M=0.09, Fc=0.1, Fs=0.12, vs=0.1, Fv=0.05, OF=0.0, G_sin=2.9, G_cos=0.2, a=0.15)
GAINS = {"Kp": 60.0, "Kd": 3.2, "Ki": 200.0}
PLACES = (0.0, 1.2, -0.4, 0.9, -1.1, 0.6, 0.0)  # [rad]

Torque = Callable[[float, float, float, float], float]


def moves() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angle, velocity and acceleration of moves of minimal jerk between the places, with rests."""
    parts = [[np.full(200, PLACES[0]), np.zeros(200), np.zeros(200)]]
    for begin, end in pairwise(PLACES):
        way = end - begin
        time = max(0.5, 1.2 * abs(way))
        s = np.arange(round(time / TS)) * TS / time
        r = begin + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
        rd = way / time * (30 * s**2 - 60 * s**3 + 30 * s**4)
        rdd = way / time**2 * (60 * s - 180 * s**2 + 120 * s**3)
        rest = np.zeros(250)
        parts.append([np.append(r, rest + end), np.append(rd, rest), np.append(rdd, rest)])
    r, rd, rdd = (np.concatenate([part[i] for part in parts]) for i in range(3))
    return r, rd, rdd


def servo() -> Torque:
    """Return the PID controller of the record, with the velocity over two samples and of the reference."""
    past: list[float] = []
    integral = 0.0

    def torque(r: float, rd: float, rdd: float, x: float) -> float:
        nonlocal integral
        past[:] = [*(past or [x, x]), x][-3:]
        v = (past[2] - past[0]) / (2.0 * TS)
        u = GAINS["Kp"] * (r - x) + GAINS["Kd"] * (rd - v) + integral
        integral += GAINS["Ki"] * TS * (r - x)
        return min(max(u, -LIMIT), LIMIT)

    return torque


def exported(law: Law) -> Torque:
    """Return an exported law."""
    law.start()
    call = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * 4)(law.function.value or 0)
    return lambda r, rd, rdd, x: float(call(r, rd, rdd, x))


def follow(arm: Arm, torque: Torque) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and torque at the samples; the encoder has steps of 1e-5 rad."""
    r, rd, rdd = moves()
    q, v, h = float(r[0]), 0.0, TS / SUBSTEPS
    angle, applied = np.empty(len(r)), np.empty(len(r))
    for k in range(len(r)):
        drive = torque(r[k], rd[k], rdd[k], 1e-5 * round(q / 1e-5))
        angle[k], applied[k] = q, drive
        for _ in range(SUBSTEPS):
            outside = -(arm.G_sin * sin(q) + arm.G_cos * cos(q)) - arm.OF
            free = drive + outside - arm.Fv * v
            way = copysign(1.0, v) if v != 0.0 else copysign(1.0, free)
            level = arm.Fc + (arm.Fs - arm.Fc) * exp(-((v / arm.vs) ** 2))
            level *= 1.0 + arm.a * abs(outside - drive) / arm.Fc
            if v == 0.0 and abs(free) <= level:
                continue
            new = v + h * (free - way * level) / arm.M
            if v != 0.0 and new * v < 0.0:
                new = 0.0
            q, v = q + h * 0.5 * (v + new), new
    return angle, applied


def write(arm: Arm, folder: Path, models: Sequence[str], compensators: Sequence[str]) -> np.ndarray:
    """Write ``log.csv`` and ``arm.toml`` as a user would; return the error of the servo."""
    r = moves()[0]
    angle, applied = follow(arm, servo())
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(r))
    rows = np.column_stack([TS * np.arange(len(r)), r, 1e-5 * np.round(angle / 1e-5), applied + noise])
    folder.mkdir(parents=True, exist_ok=True)
    heading = "time [s],reference [rad],position [rad],torque [N.m]"
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header=heading, comments="")
    gains = "\n".join(f"{name} = {value}" for name, value in GAINS.items())
    (folder / "arm.toml").write_text(
        f'[data]\nfile = "log.csv"\nname = "arm"\n\n[servo]\nlaw = "PID"\n{gains}\nTs = {TS}\nforce_limit = {LIMIT}\n'
        "window = 2\nquantum = 1e-5\nvelocity_feedforward = true\n\n"
        f"[identify]\nmodels = {json.dumps(models)}\n\n[compensation]\ncompensators = {json.dumps(compensators)}\n",
        encoding="utf-8",
    )
    return r - angle
