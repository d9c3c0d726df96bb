"""Condition on iterative learning and repetitive control."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.condition import Condition, at_least, below, compared, first_largest, held_mass
from friction_fmus.conditions.position_loop import closed_loop

Response: TypeAlias = NDArray[np.complex128]


def sampled_sensitivity(
    frequency: NDArray[np.float64], m: float, s2: float, Kp: float, Kd: float, Ki: float, Ts: float
) -> Response:
    """Return the frequency response of the sampled loop, from a force held for Ts to the position at the samples.

    Parameters
    ----------
    frequency : float64 array, shape (n,)
        Frequencies up to 1/(2 Ts) [Hz].
    m, s2, Kp, Kd, Ki, Ts : float
        As in `closed_loop`.

    Returns
    -------
    complex128 array, shape (n,)
        First row of (z - A)^-1 b of the closed loop at z = exp(2 pi j frequency Ts) [m/N].
    """
    A = closed_loop(m, s2, Kp, Kd, Ki, Ts)
    b = np.zeros(len(A))
    b[:2] = held_mass(m, s2, Ts)[1]
    z = np.exp(2j * np.pi * np.asarray(frequency) * Ts)
    systems = z[:, None, None] * np.eye(len(A)) - A
    return np.asarray(np.linalg.solve(systems, np.broadcast_to(b[:, None], (len(z), len(b), 1)))[:, 0, 0])


def learning_filter(frequency: NDArray[np.float64], m: float, Kp: float, Kd: float, Ki: float, Ts: float) -> Response:
    """Return the frequency response of m e'' + Kd e' + Kp e + Ki times the integral of e, by central differences.

    Parameters
    ----------
    frequency : float64 array, shape (n,)
        Frequencies above 0, up to 1/(2 Ts) [Hz].
    m, Kp, Kd, Ki, Ts : float
        Mass [kg] and gains [N/m, N.s/m, N/(m.s)] of the model of the loop, and sample time [s].

    Returns
    -------
    complex128 array, shape (n,)
        Response [N/m]; the integral at a sample excludes that sample.
    """
    z = np.exp(2j * np.pi * np.asarray(frequency) * Ts)
    differences = m * (z - 2.0 + 1.0 / z) / Ts**2 + Kd * (z - 1.0 / z) / (2.0 * Ts) + Kp
    return np.asarray(differences + Ki * Ts / (z - 1.0), dtype=np.complex128)


def contraction(
    frequency: NDArray[np.float64],
    sensitivity: Response,
    learning: Response,
    lowpass: Response | NDArray[np.float64] | float = 1.0,
    gamma: float = 1.0,
) -> Condition:
    """Check that errors shrink from trial to trial or period to period: |Q| |1 - gamma L P/(1 + P C)| < 1.

    Parameters
    ----------
    frequency : float64 array, shape (n,)
        Frequencies of the responses [Hz], up to half the sample rate; dense enough to resolve their peaks.
    sensitivity : complex128 array, shape (n,)
        P/(1 + P C) of the real loop, see `sampled_sensitivity` [m/N].
    learning : complex128 array, shape (n,)
        Learning filter L [N/m].
    lowpass : float64 or complex128 array, shape (n,), or float
        Low-pass filter Q.
    gamma : float
        Learning gain.

    Returns
    -------
    Condition
        Its value is the largest ratio of consecutive errors, its bound 1.
    """
    ratio = np.abs(lowpass) * np.abs(1.0 - gamma * learning * sensitivity)
    worst = first_largest(ratio.tolist())
    value, at = float(ratio[worst]), float(frequency[worst])
    first = float(frequency[next((i for i, one in enumerate(ratio) if at_least(float(one), 1.0)), 0)])
    return Condition(
        "learning",
        *compared(below, value, 1.0),
        wrong=f"|Q| |1 - gamma L S| is {value:.4g} at {at:.4g} Hz, not below 1",
        why=f"errors at {at:.4g} Hz grow from trial to trial, even if the total error shrinks at first",
        change=f"correct the model in L, lower the learning rate, or put the corner of Q well below {first:.4g} Hz, "
        "where the ratio first reaches 1",
        source="Bristow, Tharayil, Alleyne, IEEE Control Systems 26(3), 2006",
    )
