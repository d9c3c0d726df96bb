"""Conditions on friction compensation: what the drive can apply, how much may be compensated, and learning."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from friction_fmus.conditions.condition import (
    Condition,
    above,
    at_least,
    at_most,
    below,
    compared,
    first_largest,
    held_mass,
)
from friction_fmus.conditions.position_loop import closed_loop


def break_away(most: float, Fs: float, direction: str = "forward") -> Condition:
    """Check that the drive can break the axis away: the largest force behind all limits is above static friction.

    Parameters
    ----------
    most : float
        Largest force of the drive in this direction [N].
    Fs : float
        Static friction [N].
    direction : str
        ``forward`` or ``backward``, for the text.

    Returns
    -------
    Condition
        Its value is the largest force, its bound static friction [N].
    """
    return Condition(
        "break-away",
        *compared(above, most, Fs),
        wrong=f"the largest {{force}} {direction}, behind all limits, is {most:.4g} {{N}}; static friction is "
        f"{Fs:.4g} {{N}}",
        why="the drive cannot start a slow motion in that direction: the axis sticks",
        change=f"raise the limits of the law and of the actuator above {Fs:.4g} {{N}}",
        source="balance of {force}s at rest",
    )


def overcompensation(share: float, measured: bool = True) -> Condition:
    """Check that the compensation does not exceed the friction of the axis: a ratio of at most 1.

    Parameters
    ----------
    share : float
        Ratio of compensated friction to the friction of the axis, at the speed where it is largest.
    measured : bool
        Whether the compensation is computed from the measured velocity; otherwise from the reference.

    Returns
    -------
    Condition
        Its value is the ratio, its bound 1.
    """
    why = (
        "the excess {force} pushes in the direction of motion: a limit cycle that grows with the gain"
        if measured
        else "the excess {force} pushes in the direction of the reference: the axis overshoots at each reversal"
    )
    return Condition(
        "over-compensation",
        *compared(at_most, share, 1.0),
        wrong=f"the compensation is {share:.4g} times the friction of the axis",
        why=why,
        change=f"multiply the gain by {0.9 / share:.2g}, or correct the friction parameters of the law"
        if share > 0.0
        else "no change is needed",
        source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; Papadopoulos, Chasparis, IROS 2002",
    )


def fed_back_stiffness(fed_back: float, stiffness: float) -> Condition:
    """Check that a law feeds back less stiffness than contact and loop have: gain s0_hat is below s0 + Kp + k.

    Parameters
    ----------
    fed_back : float
        Contact stiffness in the law's model, times the gain of the law [N/m].
    stiffness : float
        Stiffness of the real contact, the position loop and a spring to ground together [N/m].

    Returns
    -------
    Condition
        Its value is the stiffness fed back, its bound the stiffness of contact and loop [N/m].
    """
    return Condition(
        "fed-back stiffness",
        *compared(below, fed_back, stiffness),
        wrong=f"the law feeds back a stiffness of {fed_back:.4g} {{N_m}}; contact and loop have only {stiffness:.4g} "
        f"{{N_m}}",
        why="the resulting stiffness in presliding is negative: the axis leaves presliding by itself, to one side and "
        "back",
        change=f"correct sigma0 of the law, or multiply its gain by {0.9 * stiffness / fed_back:.2g}"
        if fed_back > 0.0
        else "no change is needed",
        source="sum of stiffnesses at rest; derived here",
    )


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
