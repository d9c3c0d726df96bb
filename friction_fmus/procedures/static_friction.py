"""Static friction from break-away experiments: the drive force rises slowly until the axis moves.

The experiment is mentioned, not described, in a summary of a paper that could not be identified; the procedure is this
library's.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from friction_fmus.errors import FrictionError
from harness import System

Array = NDArray[np.float64]


def fitted_curve(v: Array, level: Array, exponent: float) -> dict[str, float]:
    """Return Fc, Fs, vs and Fv of the Stribeck curve through levels of friction at speeds above 0."""

    def misfit(p: Array) -> Array:
        return np.asarray(p[0] + (p[1] - p[0]) * np.exp(-((v / np.exp(p[3])) ** exponent)) + p[2] * v - level)

    guesses = [[level.min(), level.max(), 0.0, np.log(vs)] for vs in np.geomspace(v.min(), v.max(), 8)]
    fits = [least_squares(misfit, guess, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14) for guess in guesses]
    Fc, Fs, Fv, log_vs = min(fits, key=lambda fit: fit.cost).x
    return {"Fc": float(Fc), "Fs": float(Fs), "vs": float(np.exp(log_vs)), "Fv": float(Fv)}


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
        return fitted_curve(v, level, 2.0)


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


STEEPEST = 0.1
"""Fraction of the break-away force by which the force may rise over the last quarter of `travel` in sliding."""

BEGUN = 0.5  # fraction of the break-away force above which its rate is measured


@dataclass(frozen=True)
class BreakAways:
    """Break-aways of an axis from rest.

    Attributes
    ----------
    direction : array, shape (n,)
        1 for forward, -1 for backward motion.
    force : array, shape (n,)
        Largest force in the direction of motion, from rest until the axis has moved by `travel` [N].
    position, dwell, rate : array, shape (n,)
        Position at rest [m], time at rest, 0 for a ramp [s], mean rate at which the force rose over its
        second half [N/s].
    sliding : array of bool, shape (n,)
        Whether the axis slid when it had moved by `travel`: over the last quarter of it the force rose by less than a
        tenth, by less than in presliding.
    """

    direction: Array
    force: Array
    position: Array
    dwell: Array
    rate: Array
    sliding: NDArray[np.bool_]

    def level(self, direction: int) -> tuple[float, float]:
        """Return the static friction in one direction and its standard error.

        Parameters
        ----------
        direction : int
            1 for forward, -1 for backward.

        Returns
        -------
        (float, float)
            Mean break-away force, and its standard error from the scatter, NaN for a single break-away [N].

        Raises
        ------
        FrictionError
            If the axis did not slide after any break-away in this direction.
        """
        force = self.force[(self.direction == direction) & self.sliding]
        if force.size == 0:
            way = "forward" if direction > 0 else "backward"
            raise FrictionError(
                f"level: the axis did not slide {way} within `travel` in any of {(self.direction == direction).sum()} "
                "break-aways; choose a `travel` beyond presliding"
            )
        error = float(force.std(ddof=1) / np.sqrt(force.size)) if force.size > 1 else float("nan")
        return float(force.mean()), error


def find_break_aways(t: ArrayLike, force: ArrayLike, position: ArrayLike, *, travel: float, dwell: float) -> BreakAways:
    """Find the break-aways in a record: the axis rests, then moves by `travel`.

    Parameters
    ----------
    t, force, position : array_like, shape (n,)
        Times [s], drive force or measured friction force, positive forward [N], and position [m].
    travel : float
        Displacement from rest that counts as break-away [m]: more than presliding and noise.
    dwell : float
        Shortest time at rest, within a quarter of `travel` around one position [s].

    Returns
    -------
    BreakAways
        All break-aways, in the order of the record.

    Raises
    ------
    FrictionError
        If the lengths differ, a number is not finite, or `travel` or `dwell` is outside its range.
    """
    times, forces, x = (np.asarray(each, dtype=np.float64) for each in (t, force, position))
    if times.ndim != 1 or not times.shape == forces.shape == x.shape or not times.size:
        raise FrictionError(
            f"find_break_aways: t, force and position have the shapes {times.shape}, {forces.shape} and {x.shape}; "
            "give three vectors of the same length"
        )
    if not (np.isfinite([times, forces, x]).all() and (np.diff(times) > 0.0).all()):
        raise FrictionError("find_break_aways: a value is not finite or the times do not rise; remove such samples")
    if not (travel > 0.0 and dwell >= 0.0):
        raise FrictionError(f"find_break_aways: travel = {travel} m must be above 0 and dwell = {dwell} s at least 0")
    rows: list[tuple[float, ...]] = []
    start, rested, rest, end = 0, slice(0), 0.0, None
    while (left := _leaves(x, start, x[start], travel / 4.0)) is not None or end is not None:
        if end is not None and (left is None or end <= left):
            among, held = slice(rested.start, end + 1), times[rested.stop - 1] - times[rested.start]
            rows.append(_break_away(times[among], forces[among], x[among] - rest, rest, held, travel))
            start, end = end, None
            continue
        assert left is not None
        if times[left] - times[start] >= dwell:
            rested, rest = slice(start, left), float(np.median(x[start:left]))
            end = _leaves(x, left, rest, travel)
        start = left
    return _table(rows)


def _table(rows: list[tuple[float, ...]]) -> BreakAways:
    direction, force, position, dwell, rate, sliding = np.array(rows, dtype=np.float64).reshape(-1, 6).T
    return BreakAways(direction, force, position, dwell, rate, sliding > 0.0)


def _leaves(x: Array, start: int, rest: float, travel: float) -> int | None:
    """Return the first sample from `start` on that is farther than `travel` from a position; None if there is none."""
    block = 1024
    for first in range(start, x.size, block):
        away = np.abs(x[first : first + block] - rest) > travel
        if away.any():
            return first + int(away.argmax())
    return None


def _break_away(t: Array, force: Array, moved: Array, rest: float, held: float, travel: float) -> tuple[float, ...]:
    """Return a row of `BreakAways` from the samples between the begin of rest and detection."""
    direction = float(np.sign(moved[-1]))
    along, ahead = direction * force, direction * moved
    loading = int(along.argmin())  # the force of the motion before has then decayed
    top = loading + int(along[loading:].argmax())
    level, last = float(along[top]), float(along[-1])
    before = float(along[np.flatnonzero(ahead <= 0.75 * travel)[-1]])
    # the time at rest before the force rises does not count
    below = np.flatnonzero(along[loading : top + 1] <= BEGUN * level)
    begun = loading + (int(below[-1]) if below.size else 0)
    rate = (level - along[begun]) / (t[top] - t[begun]) if top > begun else float("nan")
    return direction, level, rest, held, float(rate), float(last - before <= STEEPEST * abs(level))


def break_away(
    system: Callable[[float, float], System],
    positions: ArrayLike = 0.0,
    *,
    rate: float,
    force: str,
    position: str,
    travel: float,
    stop: float,
    step: float,
    repetitions: int = 1,
    master: str = "newton",
) -> BreakAways:
    """Ramp the force on a resting axis up at several positions in both directions, and find the break-away forces.

    Parameters
    ----------
    system : callable
        ``system(position, rate) -> System``: returns the axis at rest at this position [m] with a drive force that
        rises from 0 at this rate [N/s], which is negative for the backward direction.
    positions : array_like, shape (n,)
        Positions [m].
    rate : float
        Rate of the force, above 0 [N/s]. A rigid contact lets the result exceed static friction by `rate` times the
        time t with (Fs - Fc) t^2/2 + rate t^3/6 = m travel. Halve the rate until the result stays.
    force, position : str
        Names of the signals of the drive force and of the position.
    travel : float
        Displacement that counts as break-away, beyond presliding [m].
    stop, step : float
        Longest duration of a ramp, and communication step [s].
    repetitions : int
        Ramps at each position in each direction, for an axis with random or measured parts.
    master : str
        Master algorithm, see `System.run`.

    Returns
    -------
    BreakAways
        One break-away per position, direction and repetition.

    Raises
    ------
    FrictionError
        If the axis does not move by `travel` in a ramp, or moves against the force, or a number is outside its range.
    """
    places = np.atleast_1d(np.asarray(positions, dtype=np.float64))
    if not (np.isfinite(places).all() and rate > 0.0 and repetitions >= 1):
        raise FrictionError(
            f"break_away: rate = {rate} N/s must be above 0, repetitions = {repetitions} at least 1, positions finite"
        )
    rows: list[tuple[float, ...]] = []
    for place in places:
        for way in (1.0, -1.0):
            for _ in range(repetitions):
                with system(float(place), way * rate) as made:
                    result = made.run(stop=stop, step=step, record=[force, position], master=master)
                t, F, x = (result[name].to_numpy() for name in ("time", force, position))
                end = _leaves(x, 0, x[0], travel)
                if end is None or way * (x[end] - x[0]) < 0.0:
                    moved = "stayed within travel" if end is None else "moved against the force"
                    raise FrictionError(
                        f"break_away: at {place:g} m the axis {moved} while the force went to {F[-1]:.4g} N; "
                        "check the signs, extend stop or raise rate"
                    )
                among = slice(0, end + 1)
                rows.append(_break_away(t[among], F[among], x[among] - x[0], x[0], 0.0, travel))
    return _table(rows)
