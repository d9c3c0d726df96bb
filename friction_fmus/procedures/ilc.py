"""Iterative learning control: simulated trials with a learning step between them.

Arimoto, Kawamura, Miyazaki, Journal of Robotic Systems 1(2), 1984; survey: Bristow, Tharayil, Alleyne, IEEE Control
Systems Magazine 26(3), 2006. The FMU IterativeLearning performs the same learning step during a single run.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi

from friction_fmus.errors import FrictionError
from friction_fmus.procedures.static_friction import fitted_curve
from harness import Part, SeriesPart, System

# Friction and cogging from the forces learned by iterative learning at constant speed in both directions.
#
# The method is taken from a summary; its original publication could not be identified.

Array = NDArray[np.float64]

POINTS = 16  # number of points of the tables of TustinFeedback


@dataclass(frozen=True)
class PositionTables:
    """Friction and cogging over the position.

    Attributes
    ----------
    x : array, shape (n,)
        Equally spaced positions [m]; the tables are periodic with n steps.
    speeds : array, shape (m,)
        Speeds [m/s].
    friction : array, shape (m, n)
        Friction force in forward motion [N].
    cogging : array, shape (n,)
        Force that compensates cogging, averaged over the speeds [N].
    """

    x: Array
    speeds: Array
    friction: Array
    cogging: Array

    def tustin(self) -> dict[str, float]:
        """Fit Tustin's curve, with the exponent 1, to friction averaged over the position.

        Returns
        -------
        dict of str to float
            Fc, Fs [N], Fv [N.s/m] and vs [m/s] of TustinFeedback.

        Raises
        ------
        FrictionError
            If there are fewer than four speeds for the four parameters.
        """
        if self.speeds.size < 4:
            raise FrictionError(
                f"tustin: the curve has four parameters, but there are only {self.speeds.size} speeds; use four or more"
            )
        return fitted_curve(self.speeds, self.friction.mean(axis=1), 1.0)

    def start_values(self, pitch: float) -> dict[str, float]:
        """Return start values of TustinFeedback: the curve, and level and cogging at its 16 points.

        Parameters
        ----------
        pitch : float
            Period of the tables [m].

        Returns
        -------
        dict of str to float
            ``Fc``, ``Fs``, ``Fv``, ``vs``, ``pitch``, ``x0``, ``level[1]`` ... ``cogging[16]``.

        Raises
        ------
        FrictionError
            If there are fewer than four speeds, see `tustin`.
        """
        at = self.x[0] + pitch / POINTS * np.arange(POINTS)
        share = (self.friction / self.friction.mean(axis=1, keepdims=True)).mean(axis=0)
        level = np.interp(at, self.x, share, period=pitch)
        cogging = np.interp(at, self.x, self.cogging, period=pitch)
        vectors = {f"level[{i}]": float(each) for i, each in enumerate(level, 1)}
        vectors |= {f"cogging[{i}]": float(each) for i, each in enumerate(cogging, 1)}
        return {**self.tustin(), "pitch": pitch, "x0": float(self.x[0]), **vectors}


def separate(x: ArrayLike, speeds: ArrayLike, forward: ArrayLike, backward: ArrayLike) -> PositionTables:
    """Separate learned forces into friction (u+ - u-)/2 and cogging (u+ + u-)/2.

    Parameters
    ----------
    x : array_like, shape (n,)
        Equally spaced positions over one period [m].
    speeds : array_like, shape (m,)
        Speeds above 0 [m/s].
    forward, backward : array_like, shape (m, n)
        Learned force at each speed and position in forward and backward motion, u+ and u- [N].

    Returns
    -------
    PositionTables
        Friction at each speed, and cogging averaged over the speeds.

    Raises
    ------
    FrictionError
        If the shapes do not match, or a speed is not above 0.
    """
    at, v = np.asarray(x, dtype=np.float64), np.asarray(speeds, dtype=np.float64)
    ahead, back = np.asarray(forward, dtype=np.float64), np.asarray(backward, dtype=np.float64)
    if ahead.shape != (v.size, at.size) or back.shape != ahead.shape or not (v > 0.0).all():
        raise FrictionError(
            f"separate: {at.size} positions and {v.size} speeds need speeds above 0 and forces of the shape "
            f"({v.size}, {at.size}), but the shapes are {ahead.shape} and {back.shape}"
        )
    return PositionTables(at, v, (ahead - back) / 2.0, ((ahead + back) / 2.0).mean(axis=0))


@dataclass(frozen=True)
class PidLoop:
    """Mass under PID control, whose process sensitivity the learning filter inverts.

    Attributes
    ----------
    m : float
        Mass [kg].
    Kp, Kd, Ki : float
        Gains [N/m, N.s/m, N/(m.s)]; Ki = 0 for PD control.
    """

    m: float
    Kp: float
    Kd: float
    Ki: float


@dataclass(frozen=True)
class Training:
    """Forces and errors of all trials of iterative learning.

    Attributes
    ----------
    forces : array, shape (trials + 1, samples)
        Learned force of each trial [N]; 0 in the first trial.
    errors : array, shape (trials + 1, samples)
        Reference minus position in each trial [m].
    """

    forces: Array
    errors: Array

    @property
    def rms(self) -> Array:
        """Root mean square error of each trial [m], shape (trials + 1,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)), dtype=np.float64)


def inverse_process_sensitivity(error: ArrayLike, Ts: float, loop: PidLoop) -> Array:
    """Return the force that would have cancelled an error: m e'' + Kd e' + Kp e + Ki int e, by central differences."""
    e = np.asarray(error, dtype=np.float64)
    wide = np.concatenate([e[:1], e, e[-1:]])
    second = np.diff(wide, 2) / Ts**2
    first = (wide[2:] - wide[:-2]) / (2.0 * Ts)
    integral = Ts * (np.cumsum(e) - e)
    force: Array = loop.m * second + loop.Kd * first + loop.Kp * e + loop.Ki * integral
    return force


def zero_phase(force: ArrayLike, Ts: float, fq: float) -> Array:
    """Filter a signal with a zero-phase low-pass filter: second-order Butterworth, forward and backward."""
    values = np.asarray(force, dtype=np.float64)
    if fq <= 0.0 or fq * Ts >= 0.5:
        return values
    sections = butter(2, fq, fs=1.0 / Ts, output="sos")
    rest = sosfilt_zi(sections)
    for _ in range(2):
        values = sosfilt(sections, values, zi=rest * values[0])[0][::-1]
    return np.asarray(values, dtype=np.float64)


def learning_step(force: ArrayLike, error: ArrayLike, Ts: float, loop: PidLoop, *, rate: float, fq: float) -> Array:
    """Return the force of the next trial, Q (force + rate L error)."""
    return zero_phase(np.asarray(force) + rate * inverse_process_sensitivity(error, Ts, loop), Ts, fq)


def train(
    system: Callable[[Part], System],
    loop: PidLoop,
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
    """Learn the force of a motion in repeated runs that start in the same state.

    Parameters
    ----------
    system : callable
        ``system(learned) -> System``: returns the system including the part ``learned``, whose output ``F`` [N] must
        be connected to the input of the controller that is added to its force. It is called for each trial.
    loop : PidLoop
        Loop that the learning filter inverts.
    reference, position : str
        Names of the signals whose difference is the error, ``"part.port"``.
    samples : int
        Number of samples of a trial.
    Ts : float
        Sample time [s].
    step : float, optional
        Communication step [s]; Ts must be an integer multiple of it. By default Ts.
    trials : int
        Number of learning steps; the number of trials is one more.
    rate, fq : float
        Learning rate, and corner frequency of the zero-phase filter Q [Hz].
    master : str
        Master algorithm, see `System.run`.

    Returns
    -------
    Training
        Forces and errors of all trials.

    Raises
    ------
    FrictionError
        If Ts is not an integer multiple of the step, or a number is outside its range.

    Notes
    -----
    For a linear loop with the process P and the controller C, the 2-norm of the error decreases monotonically if
    ``|Q (1 - rate L P/(1 + P C))| < 1`` at all frequencies (Bristow, Tharayil, Alleyne 2006). The first trials reduce
    the error by a factor of about ``1 - rate``.
    """
    every = round(Ts / step) if step else 1
    if every < 1 or (step and not math.isclose(every * step, Ts, rel_tol=1e-9)):
        raise FrictionError(
            f"train: the sample time {Ts} s is not an integer multiple of the step {step} s; correct it"
        )
    if samples < 2 or trials < 0 or not 0.0 < rate < 2.0:
        raise FrictionError(
            f"train: samples = {samples}, trials = {trials}, rate = {rate}; use 2 samples or more, 0 trials or more, "
            "and a rate between 0 and 2"
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
