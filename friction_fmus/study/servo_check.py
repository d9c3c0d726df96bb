"""Comparison of the servo as configured with the recorded drive force, before anything is simulated or ranked.

The law of the servo is a function of reference and position, both of which are in the record. Its force for them is
computed with the FMUs of the servo, in open loop, and compared with the recorded force. No property of the axis enters,
so that a difference is an error of the configuration, of the columns, or a force from outside the servo.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from friction_fmus.axis.loop import block
from friction_fmus.axis.servo import Servo
from friction_fmus.identification import ROTARY, Array, Record
from friction_fmus.study.diagnosis import Explanation, explain
from friction_fmus.study.records import Fit, ServoCheck, StudyFinding
from friction_fmus.study.regression import Comparison
from friction_fmus.study.thinning import thinned
from harness import Experiment, FmuPart, SeriesPart, System

MATCH: Final = 0.02
"""Residual over the rms force up to which the servo reproduces the record."""

TRUSTED: Final = 0.1
"""Residual over the rms force up to which the servo is simulated and its compensators are ranked."""

SETTLING: Final = 10
"""Number of samples, beyond the window of the velocity, that are not compared: the motion before them is unknown."""

SATURATED: Final = 0.98
"""Fraction of the force limit above which a sample is not compared."""


def commanded(servo: Servo, r: Array, q: Array, rotary: bool = False) -> Array:
    """Return the force that the servo commands for a recorded reference and position."""
    rd = np.gradient(r, servo.Ts)
    columns = {"r": r, "rd": rd, "rdd": np.gradient(rd, servo.Ts), "x": q}
    length = "rad" if rotary else "m"
    units = {"r": length, "rd": f"{length}/s", "rdd": f"{length}/s2", "x": length}
    t = servo.Ts * np.arange(float(len(q)))
    record = SeriesPart("record", t, columns, units, interpolation="previous", beyond="hold")
    parts = [record, FmuPart("velocity", block("Differentiator", rotary)), FmuPart("servo", block(servo.law, rotary))]
    wires = ["record.r -> servo.r", "record.x -> servo.x", "record.x -> velocity.x", "velocity.v -> servo.v"]
    start: dict[str, float | int | bool | str] = {f"servo.{name}": value for name, value in servo.gains.items()}
    for name, fed in (("rd", servo.velocity_feedforward), ("rdd", bool(servo.inertia_feedforward))):
        if fed:
            wires.append(f"record.{name} -> servo.{name}")
        else:
            start[f"servo.{name}"] = 0.0
    start |= {"servo.u_min": -servo.force_limit, "servo.u_max": servo.force_limit, "servo.Ts": servo.Ts}
    start |= {"servo.m": servo.inertia_feedforward, "velocity.Ts": servo.Ts, "velocity.window": servo.window}
    start |= {"velocity.v0": float(q[1] - q[0]) / servo.Ts}
    experiment = Experiment(stop=len(q) * servo.Ts, step=servo.Ts, record=("servo.u",))
    with System(parts, wires, start, experiment, "servo_check") as system:
        result = system.run()
    # a row of the result has the force of the sampling period that ends there
    return np.asarray(result["servo.u"].to_numpy(), dtype=np.float64)[1:]


@dataclass(frozen=True, eq=False)
class CheckedServo:
    """Result of the comparison, and the force that was added to that of the servo."""

    result: ServoCheck
    """Residual and findings."""
    included: bool = False
    """Whether the recorded force contains the injected force."""
    injected: Array | None = None
    """Force added to that of the servo from outside, as declared or as found; None without one."""


def check_servo(record: Record, servo: Servo | None) -> CheckedServo:
    """Compare the servo with the recorded drive force."""
    missing = [name for name, values in (("reference", record.reference), ("position", record.q)) if values is None]
    missing += ["drive force"] if record.force is None else []
    if servo is None or missing:
        lacks = "the configuration has no servo" if servo is None else f"the record has no {' and no '.join(missing)}"
        reason = f"The servo was not compared with the record, because {lacks}."
        return CheckedServo(ServoCheck(reason=reason), injected=record.injected)
    compared = _compared(record, servo)
    level, residual = compared.level, compared.residual
    allowed = max(MATCH * level, _resolution(record, servo))
    t = record.t - record.t[0]
    result = ServoCheck(
        Fit(residual, _percent(residual, level), "force", record.units.force),
        _percent(allowed, level),
        recorded=thinned(t, compared.force),
        commanded=thinned(t, compared.command),
    )
    if residual <= allowed:
        return CheckedServo(result, compared.included, record.injected)
    found = explain(compared, allowed)
    stops = residual > max(TRUSTED * level, allowed) and found.injected is None and not found.confirmed
    findings = tuple(_finding(each, result, stops) for each in found.explanations)
    result = replace(result, findings=findings, gains=found.gains)
    if found.injected is None:
        return CheckedServo(result, compared.included, record.injected)
    return CheckedServo(result, True, found.injected)


def _compared(record: Record, servo: Servo) -> Comparison:
    """Return force and command; a declared injected force is taken out of the force if the force contains it."""
    assert record.q is not None
    assert record.reference is not None
    assert record.force is not None
    rotary = record.units == ROTARY
    command = commanded(servo, record.reference, record.q, rotary)
    free = commanded(replace(servo, force_limit=1e6 * servo.force_limit), record.reference, record.q, rotary)
    used = np.maximum(np.abs(record.force), np.abs(command)) < SATURATED * servo.force_limit
    used[: servo.window + SETTLING] = False
    if np.count_nonzero(used) < 50:  # a unit is so wrong that all samples exceed the limit
        used[servo.window + SETTLING :] = True
    whole = Comparison(record.force, command, free, used, servo, record)
    if record.injected is None:
        return whole
    without = replace(whole, force=record.force - record.injected, included=True)
    return without if without.residual < whole.residual else whole


def _resolution(record: Record, servo: Servo) -> float:
    """Return two standard deviations of the force that rounding of the recorded position causes."""
    rounding = max(record.quantum, servo.quantum) / np.sqrt(12.0)
    Kp, Kd, _ = servo.pid
    return float(2.0 * rounding * np.hypot(Kp, np.sqrt(2.0) * Kd / (servo.window * servo.Ts)))


def _finding(found: Explanation, result: ServoCheck, stops: bool) -> StudyFinding:
    assert result.residual is not None
    what = (
        "The servo as configured does not reproduce the recorded drive force (residual "
        f"{result.residual.percent:.3g} % of its rms value): {found.what}"
    )
    return StudyFinding(found.name, what, found.change, stops)


def _percent(value: float, level: float) -> float:
    return 100.0 * value / level if level else 0.0
