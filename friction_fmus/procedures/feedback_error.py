"""Friction over speed from the feedback force at constant speed; each pass improves the feedforward force.

Method of Johnson, Lorenz, IEEE Transactions on Industry Applications 28(6), 1992, taken from a summary of the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from friction_fmus.errors import FrictionError
from harness import System

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FrictionTable:
    """Friction over speed, identified from the feedback force.

    Attributes
    ----------
    speeds : array, shape (n,)
        Speeds [m/s]; negative for backward motion.
    levels : array, shape (passes + 1, n)
        Feedforward force of each pass [N]; the last row is the result.
    feedback : array, shape (passes, n)
        Mean feedback force of each pass [N].
    ripple : array, shape (passes, n)
        Largest relative deviation of the velocity from the speed. If it is 1 or more, the axis stopped: it showed
        stick-slip, and the mean force is not the friction at that speed.
    """

    speeds: Array
    levels: Array
    feedback: Array
    ripple: Array

    @property
    def friction(self) -> Array:
        """Friction force at each speed [N]; NaN if the axis showed stick-slip in the last pass."""
        return np.where(self.ripple[-1] < 1.0, self.levels[-1], np.nan)

    def stribeck(self) -> dict[str, float]:
        """Fit a Stribeck curve to the speeds without stick-slip.

        Returns
        -------
        dict of str to float
            Fc, Fs [N], vs [m/s] and Fv [N.s/m] of StaticFeedforward with the exponent 2.

        Raises
        ------
        FrictionError
            If fewer than four speeds are available for the four parameters.
        """
        good = np.isfinite(self.friction)
        v, level = np.abs(self.speeds[good]), np.abs(self.friction[good])
        if np.unique(v).size < 4:
            raise FrictionError(
                "stribeck: the curve has four parameters, but the axis moved without stick-slip at "
                f"{np.unique(v).size} of {self.speeds.size} speeds; measure at four or more, or increase the damping "
                "of the controller"
            )

        def misfit(p: Array) -> Array:
            return np.asarray(p[0] + (p[1] - p[0]) * np.exp(-((v / np.exp(p[3])) ** 2)) + p[2] * v - level)

        guesses = [[level.min(), level.max(), 0.0, np.log(vs)] for vs in np.geomspace(v.min(), v.max(), 8)]
        fits = [least_squares(misfit, guess, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14) for guess in guesses]
        Fc, Fs, Fv, log_vs = min(fits, key=lambda fit: fit.cost).x
        return {"Fc": float(Fc), "Fs": float(Fs), "vs": float(np.exp(log_vs)), "Fv": float(Fv)}


def identify_from_feedback(
    system: Callable[[float, float], System],
    speeds: ArrayLike,
    *,
    control: str,
    velocity: str,
    settled: float,
    stop: float,
    step: float,
    passes: int = 2,
    start: ArrayLike = 0.0,
    master: str = "newton",
) -> FrictionTable:
    """Identify the friction of an axis at constant speeds: F_next(v) = F(v) + mean feedback force at v.

    Parameters
    ----------
    system : callable
        ``system(speed, force) -> System``: returns the axis following a reference with this speed [m/s], with this
        force [N] added to the output of its controller. It is called for each speed of each pass.
    speeds : array_like, shape (n,)
        Speeds [m/s], none of them 0; negative for backward motion.
    control, velocity : str
        Names of the signals of the total controller force, including the added force, and of the velocity.
    settled, stop, step : float
        Start of averaging, end of a run, and communication step [s].
    passes : int
        Number of passes over all speeds.
    start : array_like, shape (n,)
        Force of the first pass [N].
    master : str
        Master algorithm, see `System.run`.

    Returns
    -------
    FrictionTable
        Forces of all passes.

    Raises
    ------
    FrictionError
        If a speed is 0, or a number is outside its range.

    Notes
    -----
    Method of Johnson, Lorenz, IEEE Transactions on Industry Applications 28(6), 1992. The axis moves without stick-slip
    at every speed, and the means are valid, if the damping Kd of the controller exceeds the steepest fall of the
    friction curve, 0.858 (Fs - Fc)/vs for the exponent 2, see `friction_fmus.conditions.steepest_fall`. For bristles
    with damping, a smaller Kd may be sufficient. The result is the friction at constant speed, without presliding and
    frictional lag.
    """
    v = np.atleast_1d(np.asarray(speeds, dtype=np.float64))
    if v.ndim != 1 or not np.isfinite(v).all() or not v.all():
        raise FrictionError(
            "identify_from_feedback: a speed is 0 or not a number; at rest friction has no unique value, remove it"
        )
    if passes < 1 or not 0.0 <= settled < stop:
        raise FrictionError(
            f"identify_from_feedback: passes = {passes}, settled = {settled} s, stop = {stop} s; use one pass or more, "
            "and settled before stop"
        )
    levels = [np.broadcast_to(np.asarray(start, dtype=np.float64), v.shape).copy()]
    feedback, ripple = [], []
    for _ in range(passes):
        means, deviations = np.empty(v.size), np.empty(v.size)
        for i, (speed, force) in enumerate(zip(v, levels[-1], strict=True)):
            with system(float(speed), float(force)) as made:
                result = made.run(stop=stop, step=step, record=[control, velocity], master=master)
            late = result["time"].to_numpy() >= settled
            means[i] = result[control].to_numpy()[late].mean() - force
            deviations[i] = np.abs(result[velocity].to_numpy()[late] / speed - 1.0).max()
        feedback.append(means)
        ripple.append(deviations)
        levels.append(levels[-1] + means)
    return FrictionTable(v, np.array(levels), np.array(feedback), np.array(ripple))
