"""A small axis with two runs of a study, for the what-if panel of the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.axis.servo import AxisPlant, Compensator, Trajectory
from friction_fmus.study import Servo
from friction_fmus.study.data import LUGRE, build_reference
from friction_fmus.study.evaluation import AxisBench, Scheme, evaluate
from friction_fmus.study.study_result import CompensatorResult

TS = 1e-3
SERVO = Servo("PID", {"Kp": 12e3, "Kd": 190.0, "Ki": 900.0}, TS, 100.0, quantum=1e-7, noise=1e-7, delay=1)
NODES = 20
RIPPLE = tuple(0.5 * np.sin(np.arange(float(NODES))))
TABLE = PositionMap(Grid(-2e-3, 12e-3 / (NODES - 1), NODES), RIPPLE, (0.1,) * NODES, 1e-3)
PLANT = AxisPlant("LuGre", LUGRE, 1.0, 0.2, TABLE)
R = 4e-3 * (1.0 - np.cos(4.0 * np.pi * TS * np.arange(1001.0)))
LAW = Compensator("LuGreFeedforward", "u", {**LUGRE, "m": 0.0})
NOISE = np.random.default_rng(1).standard_normal(len(R))


def bench_of(folder: Path, servo: Servo = SERVO) -> AxisBench:
    t = TS * np.arange(float(len(R)))
    reference, noise = build_reference(t, R, folder, "Reference"), build_reference(t, NOISE, folder, "Noise")
    return AxisBench(servo, PLANT, Trajectory(reference, len(R), 0.0, 0.0, motion=True, offset=0.2, noise=noise), R)


JOINT = Servo("CascadePPI", {"kp": 30.0, "kv": 0.4, "ki": 0.0}, TS, 5.0, quantum=2.0 * np.pi / 2**17)
JOINT_FRICTION = {"sigma0": 50.0, "sigma1": 0.3, "sigma2": 0.01, "Fc": 0.05, "Fs": 0.075, "vs": 0.02, "delta": 2.0}


def rotary_bench_of(folder: Path) -> AxisBench:
    t = TS * np.arange(float(len(R)))
    reference = build_reference(t, 100.0 * R, folder, "RotaryReference", rotary=True)
    trajectory = Trajectory(reference, len(R), 0.0, 0.0, motion=True, rotary=True)
    return AxisBench(JOINT, AxisPlant("LuGre", JOINT_FRICTION, 2e-3), trajectory, 100.0 * R)


def runs_of(bench: AxisBench) -> list[tuple[CompensatorResult, Scheme]]:
    """The compensator of the synthetic study and the servo alone, as a study finds them."""
    found = []
    law, table = Compensator(LAW.model, "u", {**bench.plant.values, "m": 0.0}), bench.plant.position is not None
    schemes = {law.model: Scheme(bench.servo, 0.8, compensator=law, table=table), "none": Scheme(bench.servo)}
    for name, scheme in schemes.items():
        metrics = evaluate(bench, [scheme], ()).metrics
        found.append((CompensatorResult(name, name, "feedforward", True, metrics=metrics), scheme))
    return found
