"""The resonance that a loop tolerates, against a simulation of two masses with the law as a formula."""

from __future__ import annotations

import numpy as np
import pytest

from friction_fmus.axis.servo import AxisPlant, Servo
from friction_fmus.study.margins import FREQUENCIES, HIGHEST, LOWEST, margins_of

M, KP, KD, TS = 2.0, 8000.0, 160.0, 1e-3
PLANT = AxisPlant("Viscous", {"Fv": 0.0}, M)


def grows(frequency: float, delay: int, window: int) -> bool:
    """Whether an oscillation of motor and load (2 : 1, damping 2 %) grows under a sampled PD law with a late force."""
    m1, m2 = M / 1.5, M / 3.0
    reduced, w = m1 * m2 / M, 2.0 * np.pi * frequency
    k, d = reduced * w**2, 2.0 * 0.02 * reduced * w
    steps, n = 40, 1500
    x1, v1, x2, v2 = 1e-6, 0.0, 0.0, 0.0
    x, u = np.zeros(n), np.zeros(n)
    h = TS / steps
    for i in range(n):
        x[i] = x1
        u[i] = -KP * x1 - KD * (x1 - x[max(i - window, 0)]) / (window * TS)
        force = u[max(i - delay, 0)]
        for _ in range(steps):
            spring = k * (x1 - x2) + d * (v1 - v2)
            v1 += h * (force - spring) / m1
            v2 += h * spring / m2
            x1 += h * v1
            x2 += h * v2
    return bool(np.max(np.abs(x[-300:])) > np.max(np.abs(x[300:600])))


def resonance_of(delay: int, window: int) -> float:
    """The resonance above which the loop is said to be stable."""
    servo = Servo("PID", {"Kp": KP, "Kd": KD, "Ki": 0.0}, TS, 1e6, window=window, delay=delay)
    found = margins_of(servo, PLANT, 0.1)
    assert found is not None
    return found.resonance


@pytest.mark.parametrize(("delay", "window"), [(3, 4), (4, 2)])
def test_the_edge_is_where_the_simulated_oscillation_begins_to_grow(delay: int, window: int) -> None:
    found = resonance_of(delay, window)
    natural = (KP / M) ** 0.5 / (2.0 * np.pi)
    step = (LOWEST * natural / (HIGHEST / TS)) ** (1.0 / (FREQUENCIES - 1))  # from one frequency to the next lower one
    assert LOWEST * natural < found < HIGHEST / TS
    assert not grows(1.05 * found, delay, window)
    assert grows(0.95 * step * found, delay, window)


@pytest.mark.parametrize("frequency", [3.0, 10.0, 30.0, 100.0, 300.0])
def test_a_loop_with_little_delay_tolerates_any_resonance(frequency: float) -> None:
    assert resonance_of(1, 2) == 0.0
    assert not grows(frequency, 1, 2)
