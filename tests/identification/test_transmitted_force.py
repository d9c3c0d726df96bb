"""Identification of LoadDependentDahl, whose friction is that of the drive force itself: truth from own steps."""

from __future__ import annotations

from dataclasses import replace
from math import copysign, exp, pi, sin
from pathlib import Path

import numpy as np
import pytest
from thorough import landing

from friction_fmus.axis.servo import AxisPlant, Trajectory
from friction_fmus.axis.servo_loop import closed_loop
from friction_fmus.errors import FitError
from friction_fmus.identification import ROTARY, Record, identify
from friction_fmus.study import Servo
from friction_fmus.study.data import build_reference
from friction_fmus.study.evaluation import off_by

TS, SUBSTEPS = 1e-3, 10
M, G = 0.09, 2.9


def arm(mu_avg: float, mu_dif: float, eps: float, Fv: float) -> Record:
    """The record of an arm that a PD controller with its gravity moves by three sines."""
    t = TS * np.arange(10000)
    w = 2.0 * pi * 8.0
    waves = np.array([0.8, 0.3, 0.12]), 2.0 * pi * np.array([0.23, 0.71, 1.9]), np.array([0.0, 1.0, 2.0])
    r = np.sum([A * np.sin(o * t + p) for A, o, p in zip(*waves, strict=True)], axis=0)
    rd = np.gradient(r, TS)
    q, v, z, h = float(r[0]), float(rd[0]), 0.0, TS / SUBSTEPS
    angle, torque = np.empty(len(t)), np.empty(len(t))
    for k in range(len(t)):
        u = M * (w * w * (r[k] - q) + 1.4 * w * (rd[k] - v)) + G * sin(q)
        angle[k], torque[k] = q, u
        for _ in range(SUBSTEPS):
            v += h * (u - G * sin(q) - (mu_avg * abs(u) * z + mu_dif * u * z * z + Fv * v)) / M
            moved = h * v
            way = copysign(1.0, moved) if moved else 0.0
            q, z = q + moved, way + (z - way) * exp(-abs(moved) / eps)
    random = np.random.default_rng(3)
    measured = 1e-5 * np.round((angle + random.normal(0.0, 1e-5, len(t))) / 1e-5)
    return Record("gear", t, q=measured, force=torque + random.normal(0.0, 0.01, len(t)), units=ROTARY)


@landing
@pytest.mark.parametrize("truth", [{"mu_avg": 0.2, "mu_dif": -0.05, "eps": 0.02, "Fv": 0.05}])
def test_both_coefficients_are_found(truth: dict[str, float]) -> None:
    found = identify("LoadDependentDahl", arm(**truth), terms=("gravity",)).values()
    assert found["G_sin"] == pytest.approx(G, rel=0.02)
    for name, value in (truth | {"M": M}).items():
        assert found[name] == pytest.approx(value, rel=0.05, abs=0.005), name


@landing
def test_the_drive_force_does_not_predict_itself() -> None:
    """Slow motion with a friction of 15 N: with mu_avg + mu_dif = 1, the measured force would be its own prediction."""
    t = TS * np.arange(12000)
    w = 2.0 * pi * np.array([0.1, 0.23])
    q = 0.05 * (np.sin(w[0] * t) + np.sin(w[1] * t))
    v = 0.05 * (w[0] * np.cos(w[0] * t) + w[1] * np.cos(w[1] * t))
    force = 15.0 * np.sign(v) + 30.0 * v + np.random.default_rng(0).normal(0.0, 0.3, len(t))
    record = Record("slow", t, q=q, force=force)
    errors = {name: identify(name, record).train.rms for name in ("LoadDependentDahl", "Coulomb")}
    assert errors["LoadDependentDahl"] > 5.0 * errors["Coulomb"]


def test_a_record_without_drive_force_is_refused() -> None:
    record = arm(0.1, 0.0, 0.01, 0.05)
    with pytest.raises(FitError, match="LoadDependentDahl needs the force of the drive"):
        identify("LoadDependentDahl", replace(record, force=None, friction=record.force))


@landing
def test_the_simulated_axis_transmits_the_force_of_its_drive(tmp_path: Path) -> None:
    r = np.zeros(200)
    reference = build_reference(TS * np.arange(200.0), r, tmp_path, "Rest", rotary=True)
    plant = AxisPlant("LoadDependentDahl", {"mu_avg": 0.1, "mu_dif": 0.03, "eps": 0.01, "Fv": 0.0}, M)
    servo = Servo("PID", {"Kp": 60.0, "Kd": 3.0, "Ki": 0.0}, TS, 40.0)
    with closed_loop(servo, plant, Trajectory(reference, 200, 0.0, 0.0, rotary=True)) as system:
        wires = {wire.target: wire.source for wire in system.wires}
    assert wires["friction.F_t"] == wires["axis.F_drive"] == "motor.y"
    assert wires["motor.u1"] == "servo.u"
    friction = {"friction.mu_avg": 0.12, "friction.mu_dif": 0.036}  # 20 % more friction
    assert off_by(system, 1.2, 1.0) == pytest.approx({**friction, "axis.m": M})
