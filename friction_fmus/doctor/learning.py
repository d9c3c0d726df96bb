"""Rules of the laws that learn a force from trial to trial or from period to period."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus import conditions
from friction_fmus.conditions import Condition
from friction_fmus.doctor.axis import ActiveLaw, Axis, Values

Array: TypeAlias = NDArray[np.float64]
Lowpass: TypeAlias = Callable[[Array, Values], Array]


def butterworth_there_and_back(frequency: Array, p: Values) -> Array:
    """Return Q of IterativeLearning: a second-order Butterworth filter, forward and backward; 1 for fq = 0."""
    fq, Ts = p["fq"], p["Ts"]
    if not 0.0 < fq < 0.5 / Ts:
        return np.ones_like(frequency)
    return np.asarray(1.0 / (1.0 + (np.tan(np.pi * frequency * Ts) / np.tan(np.pi * fq * Ts)) ** 4))


def windowed_sinc(frequency: Array, p: Values) -> Array:
    """Return Q of RepetitiveController: a low-pass filter over M samples to each side, with a squared-cosine window."""
    fq, Ts, M = p["fq"], p["Ts"], int(p["M"])
    if not 0.0 < fq < 0.5 / Ts or M == 0:
        return np.ones_like(frequency)
    i = np.arange(-M, M + 1)
    q = np.sinc(2.0 * fq * Ts * i) * np.cos(np.pi * i / (2.0 * (M + 1))) ** 2
    return np.asarray(np.cos(2.0 * np.pi * np.outer(frequency * Ts, i)) @ (q / q.sum()))


def trials_contract(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the convergence condition of iterative learning with a position loop."""
    yield from _contract(axis, used, butterworth_there_and_back)


def periods_contract(axis: Axis, used: ActiveLaw) -> Iterator[Condition]:
    """Yield the convergence condition of repetitive control with a position loop."""
    yield from _contract(axis, used, windowed_sinc)


def _contract(axis: Axis, used: ActiveLaw, lowpass: Lowpass) -> Iterator[Condition]:
    """Evaluate the condition on the sampled loop, from 1/(N Ts), the lowest frequency that can be learned."""
    gains, p = axis.servo.gains if axis.servo else None, used.values
    if gains is None:
        return
    Ts = p["Ts"]
    frequency = np.linspace(1.0 / (p["N"] * Ts), 0.5 / Ts, 4001)
    viscous = axis.damping + (axis.contact.levels[0].viscous if axis.contact else 0.0)
    loop = (axis.m, viscous, gains.Kp, gains.Kd, gains.Ki, Ts, axis.stiffness)
    sensitivity = used.to_force * p["gain"] * conditions.sampled_sensitivity(frequency, *loop)
    learning = conditions.learning_filter(frequency, p["m"], p["Kp"], p["Kd"], p["Ki"], Ts)
    yield conditions.contraction(frequency, sensitivity, learning, lowpass(frequency, p), p["rate"])
