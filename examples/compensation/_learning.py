"""Iterative learning control: simulated trials with a learning step between them.

Arimoto, Kawamura, Miyazaki, Journal of Robotic Systems 1(2), 1984; survey: Bristow, Tharayil, Alleyne, IEEE Control
Systems Magazine 26(3), 2006. The FMU IterativeLearning performs the same learning step during a single run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from _loop import TS, Array
from harness import Part, SeriesPart, System


@dataclass(frozen=True)
class Training:
    """Forces and errors of all trials."""

    forces: Array
    """Learned force of each trial [N], shape (trials + 1, samples); 0 in the first trial."""
    errors: Array
    """Reference minus position in each trial [m], of the same shape."""

    @property
    def rms(self) -> Array:
        """Root mean square error of each trial [m]."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)))


def train(
    system: Callable[[Part], System],
    gains: Mapping[str, float],
    samples: int,
    trials: int = 15,
    rate: float = 0.5,
    fq: float = 200.0,
) -> Training:
    """Learn the force of a motion in repeated runs that start in the same state.

    For a linear loop with the process P and the controller C, the 2-norm of the error decreases monotonically if
    ``|Q (1 - rate L P/(1 + P C))| < 1`` at all frequencies. The first trials reduce it by about ``1 - rate``.

    Parameters
    ----------
    system : callable
        Returns the system with the part ``learned``, whose output ``F`` [N] is added to the force of the controller.
        The signals reference.r and mass.x are compared.
    gains : mapping of str to float
        m, Kp, Kd and Ki of the loop that the learning filter L inverts.
    samples, trials : int
        Samples of a trial, and number of learning steps; the number of trials is one more.
    rate, fq : float
        Learning rate, and corner frequency of the zero-phase filter Q [Hz].
    """
    times, force = TS * np.arange(samples), np.zeros(samples)
    forces, errors = [], []
    for _ in range(trials + 1):
        learned = SeriesPart("learned", times, {"F": force}, {"F": "N"}, interpolation="previous", beyond="hold")
        with system(learned) as made:
            result = made.run(stop=samples * TS, step=TS, record=["reference.r", "mass.x"], master="newton")
        forces.append(force)
        errors.append((result["reference.r"].to_numpy() - result["mass.x"].to_numpy())[:samples])
        force = zero_phase(force + rate * inverse_process_sensitivity(errors[-1], gains), fq)
    return Training(np.array(forces), np.array(errors))


def inverse_process_sensitivity(error: Array, gains: Mapping[str, float]) -> Array:
    """Return the force that would have cancelled an error: m e'' + Kd e' + Kp e + Ki int e, by central differences."""
    wide = np.concatenate([error[:1], error, error[-1:]])
    second = np.diff(wide, 2) / TS**2
    first = (wide[2:] - wide[:-2]) / (2.0 * TS)
    integral = TS * (np.cumsum(error) - error)
    force: Array = gains["m"] * second + gains["Kd"] * first + gains["Kp"] * error + gains["Ki"] * integral
    return force


def zero_phase(force: Array, fq: float) -> Array:
    """Filter with a second-order Butterworth low-pass filter, forward and backward."""
    sections = butter(2, fq, fs=1.0 / TS, output="sos")
    rest = sosfilt_zi(sections)
    for _ in range(2):
        force = sosfilt(sections, force, zi=rest * force[0])[0][::-1]
    return np.asarray(force)
