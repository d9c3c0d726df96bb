"""Linear regression of the recorded drive force on the signals of a servo, and the gains that follow from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from friction_fmus.axis.servo import GAIN_UNITS, Servo
from friction_fmus.identification import Array, Record
from friction_fmus.identification.fit.scores import independent_samples
from friction_fmus.study.records import IdentifiedParameter


@dataclass(frozen=True, eq=False)
class Comparison:
    """Recorded force and the force that the servo commands."""

    force: Array
    command: Array
    unlimited: Array
    """Recorded force, command within the force limit, and command without this limit."""
    used: NDArray[np.bool_]
    """Samples that are compared."""
    servo: Servo
    """Servo as configured."""
    record: Record
    """Record with reference and position."""
    included: bool = False
    """Whether a declared injected force was subtracted from the recorded force."""

    @property
    def level(self) -> float:
        """Rms value of the recorded force."""
        return rms(self.force[self.used])

    @property
    def residual(self) -> float:
        """Rms difference of force and command; without its mean if the servo has an integral of unknown start value."""
        return self.left(self.force - self.command)

    def left(self, difference: Array) -> float:
        """Return the rms value of a difference of shape (n,) over the compared samples."""
        values = difference[self.used]
        return rms(values - np.mean(values)) if self.servo.pid[2] else rms(values)


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Linear least squares: coefficients by column, their covariance, and the rms residual."""

    values: Mapping[str, float]
    covariance: Array
    left: float


def fitted(compared: Comparison, columns: Mapping[str, Array], target: Array) -> LinearFit:
    """Fit a target of shape (n,) by columns over the compared samples.

    The covariance is that of least squares with as many samples as the residual has independent ones.
    """
    y = target[compared.used]
    if not columns:
        return LinearFit({}, np.zeros((0, 0)), compared.left(target))
    X = np.column_stack([column[compared.used] for column in columns.values()])
    lengths = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    solution = np.linalg.lstsq(X / lengths, y, rcond=None)[0] / lengths
    rest = y - X @ solution
    samples = max(independent_samples([rest]) - len(lengths), 1.0)
    inverse = np.linalg.pinv((X / lengths).T @ (X / lengths)) / np.outer(lengths, lengths)
    covariance = inverse * float(rest @ rest) / samples
    return LinearFit(dict(zip(columns, solution.tolist(), strict=True)), covariance, rms(rest))


def regressors(compared: Comparison, integral: bool) -> dict[str, Array]:
    """Return the signals that the gains of the law multiply: errors of position and velocity, and their integrals."""
    servo, record = compared.servo, compared.record
    assert record.reference is not None
    assert record.q is not None
    e = record.reference - record.q
    d = -velocity(record, servo.Ts, servo.window)
    if servo.velocity_feedforward:
        d = d + np.gradient(record.reference, servo.Ts)
    columns = {"e": e, "d": d}
    if integral:
        columns["integral of e"] = servo.Ts * (np.cumsum(e) - e)
        if servo.law == "CascadePPI" and not servo.velocity_feedforward:  # with it, the integral of d is e
            columns["integral of d"] = servo.Ts * (np.cumsum(d) - d)
        columns["1"] = np.ones_like(e)
    return columns


def references(record: Record, Ts: float) -> dict[str, Array]:
    """Return the signals of a feedforward of the reference."""
    assert record.reference is not None
    rd = np.gradient(record.reference, Ts)
    return {"rd": rd, "rdd": np.gradient(rd, Ts), "sign": np.sign(rd), "constant": np.ones_like(rd)}


def gains_of(compared: Comparison, fit: LinearFit) -> tuple[IdentifiedParameter, ...]:
    """Return the gains of the law, with standard errors, from the coefficients of `regressors`."""
    servo, names = compared.servo, list(fit.values)

    def gain(name: str, value: float, slopes: Mapping[str, float]) -> IdentifiedParameter:
        slope = np.array([slopes.get(column, 0.0) for column in names])
        error = float(np.sqrt(max(slope @ fit.covariance @ slope, 0.0)))
        unit = compared.record.units.words.fill(GAIN_UNITS[name])
        return IdentifiedParameter(name, value, error, unit, "gain of the servo")

    a, b = fit.values["e"], fit.values["d"]
    slow = fit.values.get("integral of e", 0.0)
    if servo.law == "PID":
        gains = [gain("Kp", a, {"e": 1.0}), gain("Kd", b, {"d": 1.0})]
        return (*gains, gain("Ki", slow, {"integral of e": 1.0})) if "integral of e" in names else tuple(gains)
    if "integral of d" in names:
        ki, of_ki = fit.values["integral of d"], {"integral of d": 1.0}
        kp, of_kp = a / b, {"e": 1.0 / b, "d": -a / b**2}
    elif "integral of e" in names:  # a = kv kp + ki and slow = ki kp, of which the smaller ki is the one of a servo
        root = sqrt(max(a**2 - 4.0 * b * slow, 0.0))
        ki, kp = 0.5 * (a - root), 0.5 * (a + root) / b
        of_ki, of_kp = {"integral of e": 1.0 / kp}, {"e": 1.0 / b, "d": -a / b**2}
    else:
        return gain("kp", a / b, {"e": 1.0 / b, "d": -a / b**2}), gain("kv", b, {"d": 1.0})
    return gain("kp", kp, of_kp), gain("kv", b, {"d": 1.0}), gain("ki", ki, of_ki)


def velocity(record: Record, Ts: float, window: int) -> Array:
    """Return the velocity over a window of samples; before the first sample the axis moves as in the first interval."""
    q = record.column("q")
    before = q[0] - (q[1] - q[0]) * np.arange(float(window), 0.0, -1.0)
    return np.asarray((q - np.concatenate([before, q])[: len(q)]) / (window * Ts), dtype=np.float64)


def shifted(values: Array, samples: int) -> Array:
    """Return values that appear some samples later; the ends hold."""
    places = np.clip(np.arange(len(values)) - samples, 0, len(values) - 1)
    return values[places]


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
