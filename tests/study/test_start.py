"""The simulated axis starts at rest, so that no compensator disturbs it at the start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from thorough import some

from friction_fmus.axis.servo import AxisPlant, Trajectory
from friction_fmus.axis.servo_loop import REST, closed_loop, from_rest, run_loop
from friction_fmus.data import load_emps
from friction_fmus.study import load_config
from friction_fmus.study.compensators import AxisKnowledge, candidates
from friction_fmus.study.data import build_reference

TS = 1e-3
T = TS * np.arange(400.0)


def test_a_reference_at_rest_is_not_changed() -> None:
    r = 4e-3 * (1.0 - np.cos(2.0 * np.pi * T))
    assert from_rest(r, TS) is r


@pytest.mark.parametrize("v0", [0.02, -0.05])
def test_the_run_up_ends_with_velocity_and_acceleration(v0: float) -> None:
    """In the last sample before the record, a cubic velocity differs from v0 - a0 Ts by less than 2 % of v0 here."""
    a0 = 0.8
    r = 0.1 + v0 * T + 0.5 * a0 * T**2
    found = from_rest(r, TS)
    before = len(found) - len(r)
    np.testing.assert_array_equal(found[before:], r)
    np.testing.assert_array_equal(found[: REST + 1], found[0])
    v = np.diff(found) / TS
    assert abs(v[before - 1] - (v0 - 0.5 * a0 * TS)) < 0.02 * abs(v0)
    a = np.diff(v) / TS
    assert np.max(np.abs(a)) < 1.5 * a0 + (4.0 * a0 if v0 < 0.0 else 0.0)  # it turns round first against v0
    assert abs(a[before - 1] - a0) < 0.15 * a0


def test_a_steady_motion_has_the_acceleration_of_the_rest() -> None:
    """Without acceleration at the start, the largest one of v0 (3 s^2 - 2 s^3) is 1.5 v0 / duration."""
    speed = np.where(T < 0.2, 0.04, 0.04 * np.cos(20.0 * (T - 0.2)))
    r = np.cumsum(speed) * TS
    strongest = 0.8
    found = from_rest(r, TS)
    before = len(found) - len(r) - REST
    assert before == pytest.approx(1.5 * 0.04 / strongest / TS, rel=0.02)
    assert np.max(np.abs(np.diff(found, 2))) / TS**2 == pytest.approx(strongest, rel=0.02)


@pytest.mark.parametrize(
    "name",
    some(
        ["none", "StaticFeedforward", "DisturbanceObserver", "ExtendedStateObserver", "KalmanFriction"],
        ["none", "KalmanFriction"],
    ),
)
def test_the_start_disturbs_no_more_than_the_motion(name: str, tmp_path: Path) -> None:
    """EMPS begins in motion; with states that start at zero there, ExtendedStateObserver made 74 um and 224 N."""
    servo = load_config("emps").servo
    assert servo is not None
    values = {"Fc": 20.39, "Fs": 20.39, "Fv": 203.5, "vs": 1e-3, "delta": 2.0}  # published, without Stribeck effect
    plant = AxisPlant("Stribeck", values, 95.1089, -3.1648)
    recorded = load_emps().column("reference")[:2001]
    known = AxisKnowledge(servo, plant, {"Stribeck": values}, speed=0.13)
    compensator = None if name == "none" else candidates([name], known)[0].compensator
    r = from_rest(recorded, servo.Ts)
    reference = build_reference(servo.Ts * np.arange(float(len(r))), r, tmp_path, "Reference")
    trajectory = Trajectory(reference, len(r), float(r[0]), 0.0, motion=True, offset=plant.offset)
    with closed_loop(servo, plant, trajectory, compensator) as system:
        trace = run_loop(system)
    error, begins = np.abs(r - trace.q), len(r) - len(recorded) + 200
    assert np.max(error[:begins]) < 1.1 * np.max(error[begins:])
    assert np.max(np.abs(trace.force[:begins])) < 1.1 * np.max(np.abs(trace.force[begins:]))
    assert error[0] == 0.0
