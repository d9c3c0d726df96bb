"""The servo of an axis from its record, and the acceleration feedforward that fits it.

The records are simulated here, by a mass with Coulomb friction and the formulas of the laws.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, pi
from pathlib import Path

import numpy as np
import pytest
from logged_axis import FC, RD, RDD, TS, M, N, R, T, logged
from scipy.signal import butter, lfilter
from thorough import landing, some

from friction_fmus.axis.servo import AxisPlant, Compensator, Servo, Trajectory
from friction_fmus.axis.servo_loop import accurate
from friction_fmus.identification import Record
from friction_fmus.study import evaluation
from friction_fmus.study.data import build_reference
from friction_fmus.study.evaluation import LATE, AxisBench, Case, Scheme, evaluate, motion_feedforward
from friction_fmus.study.servo_check import estimate_servo


@landing
@pytest.mark.parametrize(("window", "delay"), some([(1, 0), (1, 2), (3, 0), (3, 2)], [(3, 2)]))
def test_a_cascade(window: int, delay: int) -> None:
    found = estimate_servo(logged(lambda k, e, v, total: 80.0 * (25.0 * e - v), window, delay))
    assert found is not None
    assert (found.servo.law, found.servo.window, found.servo.delay) == ("CascadePPI", window, delay)
    assert found.servo.gains == pytest.approx({"kp": 25.0, "kv": 80.0, "ki": 0.0}, rel=1e-6)
    assert not found.servo.velocity_feedforward
    assert found.servo.Ts == TS


@landing
def test_feedforward_of_velocity_and_acceleration() -> None:
    found = estimate_servo(logged(lambda k, e, v, total: 2000.0 * e + 80.0 * (RD[k] - v) + 1.5 * RDD[k], 2))
    assert found is not None
    assert found.servo.velocity_feedforward
    assert found.servo.inertia_feedforward == pytest.approx(1.5, rel=0.02)
    assert found.servo.gains["kv"] == pytest.approx(80.0, rel=1e-3)


@landing
@pytest.mark.parametrize("order", some([1, 2], [2]))
def test_a_velocity_filter_and_coulomb_feedforward(order: int) -> None:
    own, past = butter(order, 40.0, fs=1.0 / TS), []
    if order == 1:  # the exact step of the filter for a held velocity
        own = [1.0 - exp(-2.0 * pi * 40.0 * TS)], [1.0, -exp(-2.0 * pi * 40.0 * TS)]

    def law(k: int, e: float, v: float, total: float) -> float:
        past.append(v)
        return 80.0 * (25.0 * e - float(lfilter(*own, past)[-1])) + 1.5 * float(np.sign(RD[k]))

    found = estimate_servo(logged(law, 2))
    assert found is not None
    assert found.servo.velocity_filter is not None
    assert found.servo.velocity_filter.order == order
    assert found.servo.velocity_filter.cutoff == pytest.approx(40.0, rel=0.02)
    assert found.servo.gains == pytest.approx({"kp": 25.0, "kv": 80.0, "ki": 0.0}, rel=0.01)
    assert found.servo.coulomb_feedforward == pytest.approx(1.5, rel=0.01)


@landing
def test_an_integral() -> None:
    found = estimate_servo(logged(lambda k, e, v, total: 2000.0 * e - 80.0 * v + 9000.0 * total, 2))
    assert found is not None
    assert found.servo.law == "PID"
    assert found.servo.gains == pytest.approx({"Kp": 2000.0, "Kd": 80.0, "Ki": 9000.0}, rel=0.02)


def test_the_limit_of_a_drive_that_saturates() -> None:
    found = estimate_servo(logged(lambda k, e, v, total: 80.0 * (25.0 * e - v), 2, limit=7.0))
    assert found is not None
    assert found.servo.force_limit == 7.0
    assert "largest one of the record" in found.finding.what


@landing
def test_the_limit_of_a_drive_that_saturates_in_a_noisy_force() -> None:
    record = logged(lambda k, e, v, total: 80.0 * (25.0 * e - v), 2, limit=7.5)
    assert record.force is not None
    assert np.mean(np.abs(record.force) == 7.5) > 0.1
    found = estimate_servo(replace(record, force=record.force + np.random.default_rng(1).normal(0.0, 0.04, N)))
    assert found is not None
    assert found.servo.force_limit == pytest.approx(7.5, rel=0.01)
    assert found.servo.gains == pytest.approx({"kp": 25.0, "kv": 80.0, "ki": 0.0}, rel=0.03)
    assert "largest one of the record" in found.finding.what


@landing
def test_a_limit_that_the_record_does_not_show_is_said_to_be_assumed() -> None:
    found = estimate_servo(logged(lambda k, e, v, total: 80.0 * (25.0 * e - v), 2))
    assert found is not None
    assert "is assumed" in found.finding.what


@landing
def test_a_force_that_no_law_gives_is_not_explained() -> None:
    rng = np.random.default_rng(3)
    record = logged(lambda k, e, v, total: 80.0 * (25.0 * e - v), 2)
    assert estimate_servo(Record("noise", T, q=record.q, reference=R, force=rng.normal(0.0, 5.0, N))) is None
    assert estimate_servo(Record("no reference", T, q=record.q, force=record.force)) is None


def bench_of(folder: Path, servo: Servo) -> AxisBench:
    t = servo.Ts * np.arange(round(4.0 / servo.Ts))
    r = 0.02 * (1.0 - np.cos(2.0 * pi * 0.5 * t))
    reference = build_reference(t, r, folder, "Reference")
    plant = AxisPlant("Coulomb", {"Fc": FC, "Fv": 0.0}, M)
    return AxisBench(servo, plant, Trajectory(reference, len(t), 0.0, 0.0, motion=True), r)


@pytest.mark.parametrize("window", [1, 4])
def test_the_feedforward_of_the_acceleration_is_less_than_the_mass_by_the_late_velocity(
    tmp_path: Path, window: int
) -> None:
    """Kd (rd - v) with v late by window/2 samples has the part Kd Ts window/2 times the acceleration."""
    servo = Servo("PID", {"Kp": 4000.0, "Kd": 160.0, "Ki": 0.0}, 1e-3, 100.0, window=window)
    assert motion_feedforward(bench_of(tmp_path, servo))[0] == pytest.approx(M - 160.0 * 1e-3 * window / 2.0, rel=2e-3)


@pytest.mark.parametrize(("motion", "mass", "runs"), [(False, 0.0, 1), (False, 1.5, 2), (True, 0.0, 2)])
def test_a_late_acceleration_is_simulated_only_where_it_is_fed_forward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, motion: bool, mass: float, runs: int
) -> None:
    servo = Servo("PID", {"Kp": 4000.0, "Kd": 160.0, "Ki": 0.0}, 1e-3, 100.0)
    bench = bench_of(tmp_path, servo)
    bench = replace(bench, trajectory=replace(bench.trajectory, motion=motion))
    law = Compensator("StaticFeedforward", "u", {"Fc": FC, "Fs": FC, "Fv": 0.0, "m": mass})
    done = []
    monkeypatch.setattr(evaluation, "accurate", lambda system: (done.append(1), accurate(system))[1])
    found = evaluate(bench, [Scheme(servo, compensator=law)], [Case(LATE, late=True)], bounded=False)
    (corner,) = found.corners
    assert len(done) == runs
    assert (corner.metrics == found.metrics) == (runs == 1)


@pytest.mark.parametrize("window", [2, 4])
def test_the_integral_of_a_late_velocity_is_fed_forward(tmp_path: Path, window: int) -> None:
    """The integral of rd - v with v late by T = Ts window/2 is T rd where the axis follows exactly: d = -ki T."""
    late = 1e-3 * window / 2.0
    servo = Servo("CascadePPI", {"kp": 25.0, "kv": 160.0, "ki": 3000.0}, 1e-3, 100.0, window=window)
    mass, viscous = motion_feedforward(bench_of(tmp_path, servo))
    assert mass == pytest.approx(M - 160.0 * late, rel=0.02)
    assert viscous == pytest.approx(-3000.0 * late, rel=0.02)


@pytest.mark.parametrize("Ts", [1e-3, 2e-3])
def test_the_numerical_error_of_a_loop_with_several_steps_in_a_sample_is_small(tmp_path: Path, Ts: float) -> None:
    """The parts are exact for a held force, whatever the step: encoder and reference must not be read more rarely."""
    servo = Servo("PID", {"Kp": 4000.0, "Kd": 160.0, "Ki": 0.0}, Ts, 100.0, quantum=1e-6)
    metrics = evaluate(bench_of(tmp_path, servo), [Scheme(servo)], ()).metrics
    assert metrics is not None
    assert metrics.rms_bound is not None
    assert metrics.rms_bound < 1e-4 * metrics.rms
