"""Iterative learning control: trials on the harness, a learning step between them.

Arimoto, Kawamura, Miyazaki, Journal of Robotic Systems 1(2), 1984; survey: Bristow, Tharayil, Alleyne, IEEE Control
Systems Magazine 26(3), 2006. The FMU IterativeLearning does the same step inside, during one run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi

from friction_fmus.errors import FrictionError
from harness import Part, SeriesPart, System

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loop:
    """A mass under PID control, whose process sensitivity the learning filter inverts.

    Attributes
    ----------
    m : float
        Mass [kg].
    Kp, Kd, Ki : float
        Gains [N/m], [N.s/m], [N/(m.s)]; Ki = 0 for PD control.
    """

    m: float
    Kp: float
    Kd: float
    Ki: float


@dataclass(frozen=True)
class Training:
    """What was learned.

    Attributes
    ----------
    forces : array, shape (trials + 1, samples)
        Learned force of each trial [N]; the first one is 0.
    errors : array, shape (trials + 1, samples)
        Reference minus position in each trial [m].
    """

    forces: Array
    errors: Array

    @property
    def rms(self) -> Array:
        """Root mean square error of each trial [m], shape (trials + 1,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)), dtype=np.float64)


def inverse_process_sensitivity(error: ArrayLike, Ts: float, loop: Loop) -> Array:
    """The force that would have made an error vanish: m e'' + Kd e' + Kp e + Ki int e, by central differences.

    Parameters
    ----------
    error : array_like, shape (samples,)
        Error of a trial [m]; beyond its ends it is taken to be constant.
    Ts : float
        Sample time [s].
    loop : Loop
        The loop in which the force will act.

    Returns
    -------
    array, shape (samples,)
        Force [N]. The integral of a sample does not contain that sample, like PID's.
    """
    e = np.asarray(error, dtype=np.float64)
    wide = np.concatenate([e[:1], e, e[-1:]])
    second = np.diff(wide, 2) / Ts**2
    first = (wide[2:] - wide[:-2]) / (2.0 * Ts)
    integral = Ts * (np.cumsum(e) - e)
    force: Array = loop.m * second + loop.Kd * first + loop.Kp * e + loop.Ki * integral
    return force


def zero_phase(force: ArrayLike, Ts: float, fq: float) -> Array:
    """Low-pass without phase: Butterworth of order 2, there and back, at rest on the first value of either way.

    Parameters
    ----------
    force : array_like, shape (samples,)
        What is filtered.
    Ts, fq : float
        Sample time [s] and corner frequency [Hz]; 0, or 1/(2 Ts) and more, is no filter.

    Returns
    -------
    array, shape (samples,)
        The filtered values; the gain is the square of the filter's.
    """
    values = np.asarray(force, dtype=np.float64)
    if fq <= 0.0 or fq * Ts >= 0.5:
        return values
    sections = butter(2, fq, fs=1.0 / Ts, output="sos")
    rest = sosfilt_zi(sections)
    for _ in range(2):
        values = sosfilt(sections, values, zi=rest * values[0])[0][::-1]
    return np.asarray(values, dtype=np.float64)


def learning_step(force: ArrayLike, error: ArrayLike, Ts: float, loop: Loop, *, rate: float, fq: float) -> Array:
    """The force of the next trial: Q (force + rate L error), shape (samples,) [N]."""
    return zero_phase(np.asarray(force) + rate * inverse_process_sensitivity(error, Ts, loop), Ts, fq)


def train(
    system: Callable[[Part], System],
    loop: Loop,
    *,
    reference: str,
    position: str,
    samples: int,
    Ts: float,
    step: float | None = None,
    trials: int = 15,
    rate: float = 0.5,
    fq: float = 50.0,
    master: str = "gauss-seidel",
) -> Training:
    """Learn the force of a motion in repeated runs, each of which begins in the same state.

    Parameters
    ----------
    system : callable
        ``system(learned) -> System``: the system with the part ``learned`` in it, whose output ``F`` [N] is wired to
        the input of the controller to which the force is added, and held for a sample. It is called for each trial.
    loop : Loop
        What the learning filter inverts.
    reference, position : str
        Names of the signals whose difference is the error, ``"part.port"``.
    samples : int
        Samples of a trial.
    Ts, step : float
        Sample time and communication step [s], a whole part of Ts; without `step` it is Ts.
    trials : int
        Learning steps; one more trial than that is run.
    rate, fq : float
        Learning rate, and corner frequency of the zero-phase filter Q [Hz].
    master : str
        Who steps when, as of `System.run`.

    Returns
    -------
    Training
        Forces and errors of all trials.

    Raises
    ------
    FrictionError
        If step is no whole part of Ts, or a number is out of its range.

    Notes
    -----
    For a linear loop with the process P and the controller C the error falls monotonically in the 2-norm if
    ``|Q (1 - rate L P/(1 + P C))| < 1`` at all frequencies; the first trials take it down by about ``1 - rate``.
    """
    every = round(Ts / step) if step else 1
    if every < 1 or (step and not math.isclose(every * step, Ts, rel_tol=1e-9)):
        raise FrictionError(f"train: the step {step} s is no whole part of the sample time {Ts} s; choose one that is")
    if samples < 2 or trials < 0 or not 0.0 < rate < 2.0:
        raise FrictionError(
            f"train: samples = {samples}, trials = {trials}, rate = {rate}; it takes 2 samples or more, no negative "
            "number of trials, and a rate between 0 and 2"
        )
    times = Ts * np.arange(samples)
    force = np.zeros(samples)
    forces, errors = [], []
    for _ in range(trials + 1):
        learned = SeriesPart("learned", times, {"F": force}, {"F": "N"}, interpolation="previous", beyond="hold")
        with system(learned) as made:
            signals = [reference, position]
            result = made.run(stop=samples * Ts, step=Ts / every, decimate=every, record=signals, master=master)
        error = (result[reference].to_numpy() - result[position].to_numpy())[:samples]
        forces.append(force)
        errors.append(error)
        force = learning_step(force, error, Ts, loop, rate=rate, fq=fq)
    return Training(np.array(forces), np.array(errors))
