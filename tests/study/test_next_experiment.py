"""The motion to record next: its band, force and travel."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.study.evaluation import AxisBench
from friction_fmus.study.next_steps import next_experiment, write_experiment

M, KP, LIMIT, LEVEL = 2.0, 7000.0, 50.0, 6.0
SERVO = Servo("PID", {"Kp": KP, "Kd": 160.0, "Ki": 0.0}, 1e-3, LIMIT)
R = np.linspace(0.1, 0.3, 1000)
BENCH = AxisBench(SERVO, AxisPlant("Coulomb", {"Fc": LEVEL}, M), Trajectory(Path(), len(R), 0.1, 0.0), R)
NATURAL = sqrt(KP / M) / (2.0 * pi)


def test_the_force_stays_below_the_limit() -> None:
    found = next_experiment(BENCH, LEVEL)
    inertia = M * np.gradient(np.gradient(found.r, 1e-3), 1e-3)
    assert np.max(np.abs(inertia)) + LEVEL < 0.5 * LIMIT
    middle = slice(5000, 15000)
    assert np.max(np.abs(inertia[middle])) == pytest.approx(0.3 * (LIMIT - LEVEL), rel=0.05)


def test_it_stays_within_the_recorded_travel_and_begins_and_ends_at_rest() -> None:
    found = next_experiment(BENCH, LEVEL)
    assert R.min() <= found.r.min()
    assert found.r.max() <= R.max()
    assert found.r[[0, -1]] == pytest.approx([0.2, 0.2], abs=1e-9)
    assert np.abs(np.diff(found.r)[[0, -1]]) == pytest.approx([0.0, 0.0], abs=1e-7)


def test_its_force_covers_the_band() -> None:
    """The spectrum of a logarithmic chirp of constant amplitude falls with the root of the frequency."""
    found = next_experiment(BENCH, LEVEL)
    assert found.band == pytest.approx((0.5 * NATURAL, 10.0 * NATURAL))
    a = np.gradient(np.gradient(found.r, 1e-3), 1e-3)
    f = np.fft.rfftfreq(len(a), 1e-3)
    size = np.abs(np.fft.rfft(a))
    inside = [np.mean(size[(f > low) & (f <= 1.2 * low)]) for low in np.geomspace(0.7 * NATURAL, 8.0 * NATURAL, 12)]
    assert inside[-1] / inside[0] == pytest.approx(sqrt(0.7 / 8.0), rel=0.15)
    assert np.mean(size[f > 15.0 * NATURAL]) < 0.05 * max(inside)


def test_the_file_has_units(tmp_path: Path) -> None:
    path = write_experiment(tmp_path, next_experiment(BENCH, LEVEL), "m")
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "t [s],reference [m]"
    assert len(lines) == 20002
