"""Friction over speed from what the feedback has to add to a feedforward at constant speed, improved pass by pass.

Johnson, Lorenz, IEEE Transactions on Industry Applications 28(6), 1992 (from a summary, the paper was not read).
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
    """Friction over speed, and how it came about.

    Attributes
    ----------
    speeds : array, shape (n,)
        Speeds [m/s], negative ones backward.
    levels : array, shape (passes + 1, n)
        Feedforward force of each pass [N], and last the force that was found.
    feedback : array, shape (passes, n)
        Mean force that the feedback added in each pass [N].
    ripple : array, shape (passes, n)
        Largest deviation of the velocity from the speed over the speed. From 1 on the axis stood still: it stuck and
        slipped, and the mean force is not the friction at that speed.
    """

    speeds: Array
    levels: Array
    feedback: Array
    ripple: Array

    @property
    def friction(self) -> Array:
        """Friction force at each speed [N], NaN where the axis stuck and slipped in the last pass."""
        return np.where(self.ripple[-1] < 1.0, self.levels[-1], np.nan)

    def stribeck(self) -> dict[str, float]:
        """The Stribeck curve through the table, of all speeds at which the axis did not stick.

        Returns
        -------
        dict of str to float
            Fc, Fs [N], vs [m/s] and Fv [N.s/m] as in StaticFeedforward, for its exponent 2.

        Raises
        ------
        FrictionError
            If fewer than four speeds are left for the four numbers.
        """
        good = np.isfinite(self.friction)
        v, level = np.abs(self.speeds[good]), np.abs(self.friction[good])
        if np.unique(v).size < 4:
            raise FrictionError(
                f"stribeck: the curve has four numbers, and at {np.unique(v).size} speeds the axis moved evenly; "
                "measure at four or more, with more damping in the controller if it stuck"
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
    """Find the friction of an axis at constant speeds: F_next(v) = F(v) + mean feedback force at v.

    Parameters
    ----------
    system : callable
        ``system(speed, force) -> System``: the axis that follows a reference of that speed [m/s], with that force [N]
        added to the force of its controller. It is called for each speed of each pass.
    speeds : array_like, shape (n,)
        Speeds [m/s], none of them 0; negative ones are backward.
    control, velocity : str
        Names of the signals of the whole force of the controller, with the one that is added, and of the velocity.
    settled, stop, step : float
        Time from which on the means are taken, end of a run, and communication step [s].
    passes : int
        How often all speeds are run.
    start : array_like, shape (n,)
        Force of the first pass [N].
    master : str
        Who steps when, as of `System.run`.

    Returns
    -------
    FrictionTable
        The forces of all passes.

    Raises
    ------
    FrictionError
        If a speed is 0, or a number is out of its range.

    Notes
    -----
    The axis moves evenly at every speed, and the means are right, if the damping Kd of the controller exceeds the
    steepest fall of the friction curve, 0.858 (Fs - Fc)/vs for the exponent 2, see
    `friction_fmus.conditions.steepest_fall`. Less may do on bristles with damping. What is found is the friction at
    constant speed, without presliding and lag.
    """
    v = np.atleast_1d(np.asarray(speeds, dtype=np.float64))
    if v.ndim != 1 or not np.isfinite(v).all() or not v.all():
        raise FrictionError("identify_from_feedback: a speed is 0 or no number; there friction has no one value")
    if passes < 1 or not 0.0 <= settled < stop:
        raise FrictionError(
            f"identify_from_feedback: passes = {passes}, settled = {settled} s, stop = {stop} s; it takes one pass or "
            "more, and settled before stop"
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
