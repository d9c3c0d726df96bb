"""Estimate of the servo of an axis from a record with reference, position and drive force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from scipy.ndimage import binary_erosion

from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.identification import Array, Record
from friction_fmus.identification.fit.scores import rms
from friction_fmus.study.servo_check import (
    SATURATED,
    SETTLING,
    TRUSTED,
    ComparedForce,
    LinearFit,
    fitted,
    gains_of,
    references,
    regressors,
    shifted,
)
from friction_fmus.study.study_result import StudyFinding

WINDOWS: Final = (1, 2, 3, 4, 6, 8)  # numbers of samples over which the velocity may be computed
DELAYS: Final = (0, 1, 2, 3)  # samples by which the recorded force may lag the command
ENOUGH: Final = 5000  # samples above which only some are used
SIMPLER: Final = 1.05  # residual over the smallest one up to which a simpler servo is taken
EXACT: Final = 1e-3  # residual over the rms force up to which fits are equally good
PILED: Final = 0.01  # fraction of samples at the largest force above which it is the limit of the drive
BEYOND: Final = 1.5  # assumed limit over the largest recorded force, if the record does not show the limit


@dataclass(frozen=True, eq=False)
class EstimatedServo:
    """Servo, and how well it reproduces the record."""

    servo: Servo
    residual: float  # rms residual over the rms force
    finding: StudyFinding  # what was estimated, and what to check


@dataclass(frozen=True, eq=False)
class _Attempt:
    servo: Servo
    fit: LinearFit
    extras: int  # number of features beyond two gains

    def gains(self, compared: ComparedForce) -> dict[str, float]:
        return {gain.name: gain.value for gain in gains_of(compared, self.fit)}


def estimate_servo(record: Record) -> EstimatedServo | None:
    """Return the servo that reproduces the recorded drive force, or None if none of the known laws does.

    The force is fitted by linear least squares for each velocity window, delay, and with or without feedforward of the
    velocity, of the acceleration, and integral action. Of those that fit nearly as well as the best, the one with the
    fewest features is taken.
    """
    if record.reference is None or record.q is None or record.force is None or len(record) < 20 * SETTLING:
        return None
    highest = float(np.max(np.abs(record.force)))
    if highest == 0.0:
        return None
    piled = float(np.mean(np.abs(record.force) >= (1.0 - 1e-6) * highest)) > PILED
    limit = highest if piled else BEYOND * highest
    attempts = list(_attempts(record, limit))
    least, level = min((attempt.fit.left for attempt, _ in attempts), default=0.0), rms(record.force)
    good = [pair for pair in attempts if pair[0].fit.left <= max(SIMPLER * least, EXACT * level)]
    good.sort(key=lambda pair: (pair[0].extras, pair[0].fit.left))
    for attempt, compared in good:
        gains = {name: 0.0 for name in GAINS[attempt.servo.law]} | attempt.gains(compared)
        if all(gains[name] > 0.0 for name in GAINS[attempt.servo.law][:-1]) and attempt.fit.left <= TRUSTED * level:
            inertia = max(attempt.fit.values.get("rdd", 0.0), 0.0)
            servo = replace(attempt.servo, gains=gains, inertia_feedforward=inertia)
            return EstimatedServo(
                servo, attempt.fit.left / level, _finding(record, servo, attempt.fit.left / level, piled)
            )
    return None


def _attempts(record: Record, limit: float) -> Iterator[tuple[_Attempt, ComparedForce]]:
    """Yield the fits of all combinations."""
    assert record.force is not None
    inside = np.abs(record.force) < SATURATED * limit
    inside &= binary_erosion(inside, iterations=max(DELAYS))
    inside[: max(WINDOWS) + SETTLING + max(DELAYS)] = False
    places = np.flatnonzero(inside)
    if len(places) < 10 * SETTLING:
        return
    inside = np.isin(np.arange(len(record)), places[:: len(places) // ENOUGH + 1])
    rdd = references(record, record.Ts)["rdd"]
    for window, delay, fed, inertia, integral in product(WINDOWS, DELAYS, *((False, True),) * 3):
        law = "PID" if integral else "CascadePPI"
        servo = Servo(law, dict.fromkeys(GAINS[law], 0.0), record.Ts, limit, window, record.quantum, fed, delay=delay)
        compared = ComparedForce(record.force, record.force, record.force, inside, servo, record)
        columns: Mapping[str, Array] = regressors(compared, integral=integral)
        columns = {**columns, **({"rdd": rdd} if inertia else {})}
        late = {name: shifted(column, delay) for name, column in columns.items()}
        yield (
            _Attempt(servo, fitted(compared, late, record.force), fed + inertia + 2 * integral + (delay > 0)),
            compared,
        )


def _finding(record: Record, servo: Servo, residual: float, piled: bool) -> StudyFinding:
    u = record.units.words
    gains = ", ".join(f"{name} = {value:.4g}" for name, value in servo.gains.items() if value)
    parts = [f"{servo.law} with {gains}, velocity over {servo.window} samples"]
    parts += ["velocity feedforward"] if servo.velocity_feedforward else []
    parts += [f"inertia feedforward {servo.inertia_feedforward:.4g} {u.kg}"] if servo.inertia_feedforward else []
    parts += [f"a delay of {servo.delay} samples"] if servo.delay else []
    what = (
        f"The controller was estimated from the record: {', '.join(parts)}. It reproduces the {u.force} within "
        f"{100.0 * residual:.2g} % of its rms value. The {u.force} limit, {servo.force_limit:.4g} {u.N}, is "
        + (
            "the largest one of the record."
            if piled
            else f"assumed: the record reaches {servo.force_limit / BEYOND:.4g} {u.N}."
        )
    )
    return StudyFinding("servo-estimated", what, "Compare it with the settings of the drive, and correct [servo].")
