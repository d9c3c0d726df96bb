"""Which conditions apply to an axis, and with which numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from friction_fmus import conditions
from friction_fmus.conditions import Condition
from friction_fmus.doctor.axis import Axis, Finding, Gains, Level, Used


def examine_axis(axis: Axis) -> Iterator[Finding]:
    """All conditions that apply to an axis, also those that hold."""
    servo = axis.servo
    gains = servo.gains if servo is not None else None
    if servo is not None and gains is not None:
        for condition in _linear(axis, servo, gains):
            yield Finding((servo.part, axis.plant), condition)
        for condition in _with_friction(axis, gains):
            yield Finding((servo.part, *_plant(axis)), condition)
        yield from _inertia(axis, servo, gains)
    yield from _compensated(axis)
    for used in axis.laws:
        for rule in used.law.rules:
            for condition in rule(axis, used):
                yield Finding((used.part, *((servo.part,) if servo else ()), axis.plant), condition)


def injection_of_error(axis: Axis, used: Used) -> Iterator[Condition]:
    """A LuGre observer that is corrected by the position error, k > 0."""
    gains = axis.servo.gains if axis.servo else None
    p = used.values
    if gains is not None and p["k"] > 0.0:
        yield conditions.injection(axis.m, gains.Kp, gains.Kd, gains.Ki, p["sigma0"], p["sigma1"])


def disturbance_observer_poles(axis: Axis, used: Used) -> Iterator[Condition]:
    """A disturbance observer beside a position loop, in sliding and on the stiffness of the contact."""
    gains = axis.servo.gains if axis.servo else None
    if gains is None:
        return
    p, loop = used.values, (axis.m, gains.Kp, gains.Kd, gains.Ki)
    share, contact = used.to_force * p["gain"], axis.contact
    viscous = axis.damping + (contact.levels[0].viscous if contact else 0.0)
    observer = (p["fq"], p["Ts"])
    yield conditions.disturbance_observer(*loop, *observer, viscous, axis.stiffness, p["m"], share)
    if contact and contact.stiffness:
        damping, Kt = axis.damping + contact.damping + contact.viscous, axis.stiffness + contact.stiffness
        yield conditions.disturbance_observer(*loop, *observer, damping, Kt, p["m"], share)


def _plant(axis: Axis) -> tuple[str, ...]:
    return (axis.plant,) if axis.friction in (None, axis.plant) else (axis.plant, str(axis.friction))


def _linear(axis: Axis, servo: Used, gains: Gains) -> Iterator[Condition]:
    viscous = axis.damping + (min(_left(axis, side).viscous for side in (0, 1)) if axis.contact else 0.0)
    loop = (axis.m, viscous, gains.Kp, gains.Kd, gains.Ki)
    yield conditions.routh(*loop, axis.stiffness)
    if "Ts" in servo.values:
        yield conditions.sampled(*loop, servo.values["Ts"], axis.stiffness)


def _with_friction(axis: Axis, gains: Gains) -> Iterator[Condition]:
    """Stick-slip and hunting, in the direction in which they are worse."""
    if axis.contact is None:
        return
    left = [_left(axis, side) for side in (0, 1)]
    taken = axis.m * gains.Ki / gains.Kp if gains.Kp > 0.0 and gains.Ki > 0.0 else 0.0
    curves = [at for at in left if at.vs is not None and at.vs > 0.0]
    falls = [
        conditions.stick_slip_free(gains.Kd, axis.damping + at.viscous, at.Fc, at.Fs, at.vs or 0.0, at.delta, taken)
        for at in curves
        if at.Fs > at.Fc
    ]
    if falls:
        yield max(falls, key=lambda fall: fall.bound - fall.value)
    at = max(left, key=lambda level: level.Fs - level.Fc)
    if gains.db > 0.0 and gains.Ki > 0.0 and gains.Kp > 0.0:
        slip = conditions.expected_slip(axis.m, axis.damping + at.viscous, gains.Kp, gains.Kd, at.Fc, at.Fs)
        yield conditions.dead_band(gains.db, slip)
    else:
        yield conditions.hunting(gains.Ki, at.Fc, at.Fs)


def _left(axis: Axis, side: int) -> Level:
    """What observers that also act at rest leave of the friction in one direction."""
    assert axis.contact is not None
    left = axis.contact.levels[side]
    for used in axis.laws:
        if used.law.at_rest and used.law.levels is not None:
            share, known = _share(used), used.law.levels(used.values)[side]
            left = replace(
                left,
                Fc=max(left.Fc - share * known.Fc, 0.0),
                Fs=max(left.Fs - share * known.Fs, 0.0),
                viscous=left.viscous - share * known.viscous,
            )
    return left


def _share(used: Used) -> float:
    return used.to_force * used.values.get("gain", 1.0)


def _compensated(axis: Axis) -> Iterator[Finding]:
    """All friction that is compensated together, against that of the axis, at the worst speed."""
    known = [(used, used.law.levels(used.values)) for used in axis.laws if used.law.levels is not None]
    if axis.contact is None or not known:
        return
    worst = 0.0
    for side, level in enumerate(axis.contact.levels):
        scales = [at.vs for at in (level, *(levels[side] for _, levels in known)) if at.vs]
        speeds = np.geomspace(1e-3 * min(scales, default=1.0), 1e3 * max(scales, default=1.0), 1000)
        there = level.at(speeds)
        total = sum(_share(used) * levels[side].at(speeds) for used, levels in known)
        if there.min() > 0.0:
            worst = max(worst, float(np.max(total / there)))
    measured = any(used.law.measured for used, _ in known)
    parts = (*(used.part for used, _ in known), axis.friction or axis.plant)
    yield Finding(parts, conditions.overcompensation(worst, measured))


def _inertia(axis: Axis, servo: Used, gains: Gains) -> Iterator[Finding]:
    """The inertia force is fed forward once: by the position loop or by the law whose u it gets."""
    feeding = [used for used in axis.laws if used.law.inertia and used.values[used.law.inertia] != 0.0]
    total = gains.m + sum(used.to_force * used.values[used.law.inertia] for used in feeding)
    if feeding:
        parts = (*(used.part for used in feeding), servo.part, axis.plant)
        yield Finding(parts, conditions.inertia(total, axis.m, laws=len(feeding) + (gains.m != 0.0)))
