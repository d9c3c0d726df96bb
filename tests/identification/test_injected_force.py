"""A force added to that of the servo from outside: it moves the axis in every method; simulated here, step by step."""

from __future__ import annotations

import numpy as np
import pytest
from thorough import nightly

from friction_fmus import identify
from friction_fmus.data import MeasuredAxis, ServoSettings
from friction_fmus.identification import Record

M, FC, FV, TS, FINE = 5.0, 10.0, 40.0, 1e-3, 20
SERVO = ServoSettings(kp=60.0, kv=900.0, force_limit=1e4, Ts=TS, window=2, quantum=1e-8, drive_gain=1.0)


def simulated(samples: int) -> Record:
    """A mass with Coulomb and viscous friction under a cascade, by implicit steps of 50 us, exact in the limit."""
    t = TS * np.arange(samples)
    r = 0.02 * (1.0 - np.cos(2.0 * np.pi * 1.3 * t))
    injected = 12.0 * np.sin(2.0 * np.pi * 7.0 * t) * (np.sin(2.0 * np.pi * 0.7 * t) > 0.0)
    q, force = np.zeros(samples), np.zeros(samples)
    x = v = 0.0
    h = TS / FINE
    for k in range(samples):
        q[k] = SERVO.quantum * np.round(x / SERVO.quantum)
        speed = (q[k] - q[max(k - 2, 0)]) / (2.0 * TS)
        force[k] = SERVO.kv * (SERVO.kp * (r[k] - q[k]) - speed)
        for _ in range(FINE):
            free = v + h / M * (force[k] + injected[k])
            v = np.sign(free) * max(abs(free) - h * FC / M, 0.0) / (1.0 + h * FV / M)
            x += h * v
    return Record("injected", t, q=q, reference=r, force=force, injected=injected, quantum=SERVO.quantum)


@pytest.fixture(scope="module")
def record() -> Record:
    return simulated(1200)


@nightly
def test_the_injected_force_drives_the_axis_in_a_free_run(record: Record) -> None:
    found = identify("Coulomb", record, method="free-run", viscous=True, starts=1)
    assert found.parameters["Fc"].value == pytest.approx(FC, rel=0.03)
    assert found.parameters["M"].value == pytest.approx(M, rel=0.02)
    assert np.array_equal(found.predict(record), found.predict(record.with_total_force()))


def test_the_closed_loop_has_the_injected_force(record: Record) -> None:
    found = identify("Coulomb", MeasuredAxis(record.window(0.0, 0.8), SERVO), viscous=True, starts=1)
    assert found.parameters["Fc"].value == pytest.approx(FC, rel=0.02)
    assert found.parameters["M"].value == pytest.approx(M, rel=0.02)
