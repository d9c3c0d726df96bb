"""Estimate of the servo of an axis from a record with reference, position and drive force."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter
from typing import Final

import numpy as np
from scipy.ndimage import binary_erosion
from threadpoolctl import threadpool_limits

from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.identification import Record
from friction_fmus.identification.fit.scores import rms
from friction_fmus.study.servo_check import (
    ENOUGH,
    SATURATED,
    SETTLING,
    SIMPLER,
    TRUSTED,
    ComparedForce,
    LinearFit,
    best_filter,
    fitted,
    gains_of,
    references,
    regressors,
    shifted,
)
from friction_fmus.study.study_result import StudyFinding

WINDOWS: Final = (1, 2, 3, 4, 6, 8)  # numbers of samples over which the velocity may be computed
FILTERED: Final = (1, 2)  # the same, if a low-pass filter follows
FEW: Final = 1500  # samples that are used in the search for a filter
DELAYS: Final = (0, 1, 2, 3)  # samples by which the recorded force may lag the command
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
    compared: ComparedForce  # its servo has no gains yet
    fit: LinearFit
    extras: int  # number of features beyond two gains

    def servo(self) -> Servo | None:
        """Return the servo with gains and feedforwards; None if one of them is negative."""
        servo, fed = self.compared.servo, [self.fit.values.get(name, 0.0) for name in ("rdd", "sign")]
        gains = {**servo.gains} | {gain.name: gain.value for gain in gains_of(self.compared, self.fit)}
        *needed, integral = (gains[name] for name in GAINS[servo.law])
        if min(needed) <= 0.0 or min(integral, *fed) < 0.0:
            return None
        return replace(servo, gains=gains, inertia_feedforward=fed[0], coulomb_feedforward=fed[1])


def estimate_servo(record: Record) -> EstimatedServo | None:
    """Return the servo that reproduces the recorded drive force, or None if none of the known laws does."""
    # The force is fitted by linear least squares for each velocity window, delay, and with or without feedforward of
    # the velocity, of the acceleration, of Coulomb friction, and integral action, and for a low-pass filter of the
    # velocity beside the best of them. Of those that fit nearly as well as the best, the one with the fewest features
    # is taken.
    if record.reference is None or record.q is None or record.force is None or len(record) < 20 * SETTLING:
        return None
    highest = float(np.max(np.abs(record.force)))
    if highest == 0.0:
        return None
    piled = float(np.mean(np.abs(record.force) >= (1.0 - 1e-6) * highest)) > PILED
    limit = highest if piled else BEYOND * highest
    with threadpool_limits(1):  # a thread would take longer to start than one of these small fits
        attempts = list(_attempts(record, limit))
    least, level = min((attempt.fit.left for attempt in attempts), default=0.0), rms(record.force)
    good = [each for each in attempts if each.fit.left <= max(SIMPLER * least, EXACT * level)]
    for attempt in sorted(good, key=lambda each: (each.extras, each.fit.left)):
        servo, residual = attempt.servo(), attempt.fit.left / level
        if servo is not None and residual <= TRUSTED:
            return EstimatedServo(servo, residual, _finding(record, servo, residual, piled))
    return None


def _attempts(record: Record, limit: float) -> Iterator[_Attempt]:
    """Yield the fits of all combinations, and of filters beside the best of them."""
    assert record.force is not None
    inside = np.abs(record.force) < SATURATED * limit
    inside &= binary_erosion(inside, iterations=max(DELAYS))
    inside[: max(WINDOWS) + SETTLING + max(DELAYS)] = False
    if np.count_nonzero(inside) < 10 * SETTLING:
        return
    none = Servo("PID", dict.fromkeys(GAINS["PID"], 0.0), record.Ts, limit, quantum=record.quantum)
    compared = ComparedForce(record.force, record.force, record.force, inside, none, record).thinned(ENOUGH)
    attempts = []
    for window, delay, fed, coulomb, inertia, integral in product(WINDOWS, DELAYS, *((False, True),) * 4):
        servo = replace(none, window=window, velocity_feedforward=fed, delay=delay)
        attempts.append(_fitted(replace(compared, servo=servo), coulomb, inertia, integral))
        yield attempts[-1]
    best = min(attempts, key=lambda each: each.fit.left)
    has = [name in best.fit.values for name in ("sign", "rdd", "integral of e")]
    few = compared.thinned(FEW)

    def left(servo: Servo) -> float:
        return _fitted(replace(few, servo=servo), *has).fit.left

    for name in ("velocity-filter", "velocity-filter-2"):
        start = best.compared.servo
        begins = [replace(start, window=window, delay=delay) for window, delay in product(FILTERED, DELAYS)]
        servo, _ = min((best_filter(name, each, left, 20) for each in begins), key=itemgetter(1))
        for fed, *flags in product(*((False, True),) * 4):
            yield _fitted(replace(compared, servo=replace(servo, velocity_feedforward=fed)), *flags)


def _fitted(compared: ComparedForce, coulomb: bool, inertia: bool, integral: bool) -> _Attempt:
    """Fit the gains of a servo, with these feedforwards and an integral or without."""
    law = "PID" if integral else "CascadePPI"
    servo = replace(compared.servo, law=law, gains=dict.fromkeys(GAINS[law], 0.0))
    compared = replace(compared, servo=servo)
    known = references(compared.record, servo.Ts)
    columns = regressors(compared, integral=integral)
    columns |= {name: known[name] for name, has in (("sign", coulomb), ("rdd", inertia)) if has}
    late = {name: shifted(column, servo.delay) for name, column in columns.items()}
    extras = servo.velocity_feedforward + coulomb + inertia + 2 * integral + (servo.delay > 0)
    extras += servo.velocity_filter is not None
    return _Attempt(compared, fitted(compared, late, compared.force), extras)


def _finding(record: Record, servo: Servo, residual: float, piled: bool) -> StudyFinding:
    u = record.units.words
    gains = ", ".join(f"{name} = {value:.4g}" for name, value in servo.gains.items() if value)
    parts = [f"{servo.law} with {gains}, velocity over {servo.window} samples"]
    parts += [f"{name} = {value}" for name, value in servo.features.items()]
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
