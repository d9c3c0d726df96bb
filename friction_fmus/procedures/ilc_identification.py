"""Friction and cogging from the forces learned by iterative learning at constant speed in both directions.

The method is taken from a summary; its original publication could not be identified.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from friction_fmus.errors import FrictionError

Array = NDArray[np.float64]

POINTS = 16
"""Number of points of the tables of TustinFeedback."""


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
        v, level = self.speeds, self.friction.mean(axis=1)

        def misfit(p: Array) -> Array:
            return np.asarray(p[0] + (p[1] - p[0]) * np.exp(-v / np.exp(p[3])) + p[2] * v - level)

        guesses = [[level.min(), level.max(), 0.0, np.log(vs)] for vs in np.geomspace(v.min(), v.max(), 8)]
        fits = [least_squares(misfit, guess, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14) for guess in guesses]
        Fc, Fs, Fv, log_vs = min(fits, key=lambda fit: fit.cost).x
        return {"Fc": float(Fc), "Fs": float(Fs), "Fv": float(Fv), "vs": float(np.exp(log_vs))}

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
