"""A force added to that of the servo from outside: it moves the axis in every method; simulated here, step by step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from thorough import nightly

from friction_fmus import identify
from friction_fmus.axis.servo import AxisPlant, Servo, Trajectory
from friction_fmus.axis.servo_loop import closed_loop, run_loop
from friction_fmus.identification import Record
from friction_fmus.study.data import build_reference

M, FC, FV, TS, FINE = 5.0, 10.0, 40.0, 1e-3, 20
KP, KV, QUANTUM = 60.0, 900.0, 1e-8


def simulated(samples: int) -> Record:
    """A mass with Coulomb and viscous friction under a cascade, by implicit steps of 50 us, exact in the limit."""
    t = TS * np.arange(samples)
    r = 0.02 * (1.0 - np.cos(2.0 * np.pi * 1.3 * t))
    injected = 12.0 * np.sin(2.0 * np.pi * 7.0 * t) * (np.sin(2.0 * np.pi * 0.7 * t) > 0.0)
    q, force = np.zeros(samples), np.zeros(samples)
    x = v = 0.0
    h = TS / FINE
    for k in range(samples):
        q[k] = QUANTUM * np.round(x / QUANTUM)
        speed = (q[k] - q[max(k - 2, 0)]) / (2.0 * TS)
        force[k] = KV * (KP * (r[k] - q[k]) - speed)
        for _ in range(FINE):
            free = v + h / M * (force[k] + injected[k])
            v = np.sign(free) * max(abs(free) - h * FC / M, 0.0) / (1.0 + h * FV / M)
            x += h * v
    return Record("injected", t, q=q, reference=r, force=force, injected=injected, quantum=QUANTUM)


@pytest.fixture(scope="module")
def record() -> Record:
    return simulated(1200)


@nightly
def test_the_injected_force_drives_the_axis_in_a_free_run(record: Record) -> None:
    found = identify("Coulomb", record, method="free-run", viscous=True, starts=1)
    assert found.parameters["Fc"].value == pytest.approx(FC, rel=0.03)
    assert found.parameters["M"].value == pytest.approx(M, rel=0.02)
    assert np.array_equal(found.predict(record), found.predict(record.with_total_force()))


def test_the_closed_loop_has_the_injected_force(record: Record, tmp_path: Path) -> None:
    """The simulated servo moves as the one above, to 1 % of what the injected force makes of its motion."""
    servo = Servo("CascadePPI", {"kp": KP, "kv": KV, "ki": 0.0}, TS, 1e4, quantum=QUANTUM)
    reference = build_reference(record.t, record.column("reference"), tmp_path, "Injected")
    plant = AxisPlant("Stribeck", {"Fc": FC, "Fs": FC, "Fv": FV}, M)
    errors = []
    for injected in (record.injected, None):
        course = Trajectory(reference, len(record), 0.0, 0.0, injected=injected)
        with closed_loop(servo, plant, course) as system:
            errors.append(float(np.sqrt(np.mean((run_loop(system).q - record.column("q")) ** 2))))
    assert errors[0] < 0.01 * errors[1]
