"""A joint under a servo against gravity: motor and friction with the truth from an integrator of its own."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from math import copysign, sin
from pathlib import Path

import numpy as np
import pytest
from thorough import landing, nightly

from friction_fmus.errors import FitError, RecordError
from friction_fmus.identification import LINEAR, ROTARY, Joint, JointRecord, Record, identify_joint
from friction_fmus.identification import joint as joint_module
from harness import System
from harness.errors import ExperimentError

ROOT = Path(__file__).parents[2]
JOINT = Joint(0.005, 0.5)
K, R, MOTOR, Fc, A, Fv = 0.4, 4.0, 0.002, 0.01, 0.15, 0.004
Ts, SUBSTEPS, U = 5e-3, 50, 7.4


def swung(gain: float, frequency: float) -> JointRecord:
    """A joint whose reference swings, with friction Fc + A |external - drive|; exact rests, steps of 0.1 ms."""
    t = Ts * np.arange(240)
    goal = 1.2 * np.sin(2.0 * np.pi * frequency * t) * np.minimum(t, 1.0)
    q, v, h, angle = 0.0, 0.0, Ts / SUBSTEPS, np.empty(len(t))
    for k in range(len(t)):
        angle[k] = q
        for i in range(SUBSTEPS):
            want = goal[k] + (i / SUBSTEPS) * (goal[min(k + 1, len(t) - 1)] - goal[k])
            duty = min(max(gain * (want - q), -1.0), 1.0)
            drive = K * (duty * U - K * v) / R
            outside = -0.5 * sin(q)
            level = Fc + A * abs(outside - drive)
            free = drive + outside - Fv * v
            if v == 0.0 and abs(free) <= level:
                continue
            new = v + h * (free - copysign(level, v or free)) / (0.005 + MOTOR)
            new = 0.0 if new * v < 0.0 else new
            q, v = q + 0.5 * h * (v + new), new
    return JointRecord(Record("swung", t, q=angle, reference=goal, units=ROTARY), np.full(len(t), U), gain)


@pytest.fixture(scope="module")
def records() -> list[JointRecord]:
    """Records with two gains."""
    return [swung(1.0, 0.7), swung(2.0, 1.1)]


def test_a_run_that_fails_leaves_no_other_behind(records: list[JointRecord], monkeypatch: pytest.MonkeyPatch) -> None:
    """The systems of those that run beside it are free for the next parameters."""
    good = {"K": K, "R": R, "inertia": MOTOR, "q0": 0.0, "base": Fc}
    angle = joint_module._angle

    def fails(start: Mapping[str, float], system: System, record: JointRecord) -> np.ndarray:
        if record is records[0] and start["motor.K"] < 0.0:
            raise ExperimentError("does not converge")
        return angle({**start, "motor.K": abs(start["motor.K"])}, system, record)

    monkeypatch.setattr(joint_module, "_angle", fails)
    with joint_module._simulator("Stribeck", JOINT, records) as run:
        first = run(good)
        for _ in range(5):
            with pytest.raises(ExperimentError):
                run({**good, "K": -K})
            assert np.array_equal(np.concatenate(run(good)), np.concatenate(first))


@landing
def test_motor_and_friction_under_load_are_found(records: list[JointRecord]) -> None:
    simple = identify_joint(records, JOINT)
    found = identify_joint(records, JOINT, load="M3", start=simple.values())
    values = found.values()
    assert found.rms < 0.2 * simple.rms
    assert found.rms < 2e-3
    # a part of the braking of the motor is like viscous friction
    assert values["K"] / values["R"] == pytest.approx(K / R, rel=0.03)
    assert values["a"] == pytest.approx(A, rel=0.1)
    assert values["inertia"] == pytest.approx(MOTOR, rel=0.1)
    other = [swung(1.5, 0.9)]
    assert found.error(other) < 5e-3


def test_what_contradicts_gravity_or_is_incomplete_is_refused(records: list[JointRecord]) -> None:
    motion = records[0].motion
    upside = JointRecord(
        Record(
            "turned", motion.t, q=motion.column("q") + np.pi, reference=motion.column("reference") + np.pi, units=ROTARY
        ),
        records[0].supply,
        1.0,
    )
    with pytest.raises(FitError, match="where the arm hangs down"):
        identify_joint([upside], JOINT)
    with pytest.raises(RecordError, match="hardly moves"):
        still = Record("still", motion.t, q=0.0 * motion.t, reference=motion.column("reference"), units=ROTARY)
        identify_joint([JointRecord(still, records[0].supply, 1.0)], JOINT)
    with pytest.raises(RecordError, match="supply voltage"):
        JointRecord(motion, records[0].supply[1:], 1.0)
    with pytest.raises(RecordError, match="units=ROTARY"):
        JointRecord(replace(motion, units=LINEAR), records[0].supply, 1.0)
    with pytest.raises(FitError, match="start value of K"):
        identify_joint(records, JOINT, start={"K": np.nan})
    with pytest.raises(RecordError, match="gain"):
        JointRecord(motion, records[0].supply, -1.0)
    with pytest.raises(FitError, match="must be positive"):
        Joint(0.005, 0.0)
    with pytest.raises(FitError, match="no input Fn"):
        identify_joint(records, JOINT, model="Viscous")
    with pytest.raises(FitError, match="M7"):
        identify_joint(records, JOINT, load="M7")


@nightly
def test_the_program_of_the_page_prints_what_it_says() -> None:
    page = (ROOT / "docs" / "identification.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- joint -->\n```python\n(.*?)^```$", page, re.S | re.M)
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert f"It prints `{done.stdout.strip()}`" in page
