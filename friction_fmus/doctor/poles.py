"""Poles of the sampled loop of an axis: in sliding, in presliding, and where friction falls with speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from friction_fmus import conditions
from friction_fmus.blocks.contact import Level
from friction_fmus.conditions import Condition, DrivenPlant, SampledLaw
from friction_fmus.conditions.condition import first_largest
from friction_fmus.conditions.linear import Matrix, spectral_radius
from friction_fmus.doctor.axis import ActiveLaw, Axis, Finding

_BUZZ = "in presliding the contact acts as a spring, and the loop with this spring is unstable: the axis buzzes at rest"
_INVERSE = "the model in the estimator differs too much from the plant: |Q D| < 1 is violated and oscillations grow"


def examine_poles(axis: Axis, servo: ActiveLaw, left: float) -> Iterator[Finding]:
    """Yield the stability conditions in sliding and in presliding, without and with disturbance estimators."""
    if servo.law.linear is None or "Ts" not in servo.values:
        return
    own, together = (servo,), _with_estimators(axis, servo)
    if not servo.law.estimates:
        yield from _regimes(axis, own, left)
        if servo.path.amplified != 1.0:
            yield Finding(
                (servo.part, axis.plant),
                _poles(axis, own, left, 0.0, "with the force of the dead-zone law", servo.path.amplified),
            )
    if estimating(axis, servo):
        yield from _regimes(axis, together, left)


def _regimes(axis: Axis, laws: tuple[ActiveLaw, ...], left: float) -> Iterator[Finding]:
    """Yield the condition in sliding and, if that holds, the condition in presliding."""
    parts, contact = (*(used.part for used in reversed(laws)), axis.plant), axis.contact
    sliding = _poles(axis, laws, left, 0.0)
    yield Finding(parts, sliding)
    if sliding.ok and contact is not None and contact.stiffness:
        where = f"in presliding (stiffness {contact.stiffness:.4g} N/m)"
        yield Finding(parts, _poles(axis, laws, contact.damping + contact.viscous, contact.stiffness, where))


def estimating(axis: Axis, servo: ActiveLaw) -> bool:
    """Return whether the loop contains a disturbance estimator."""
    return any(used.law.estimates for used in _with_estimators(axis, servo))


def _with_estimators(axis: Axis, servo: ActiveLaw) -> tuple[ActiveLaw, ...]:
    """Return the law of the position loop and the estimators with the same sample time."""
    Ts = servo.values.get("Ts")
    others = [used for used in axis.laws if used.part != servo.part and used.law.estimates]
    return (servo, *(used for used in others if Ts is None or math.isclose(used.values.get("Ts", Ts), Ts)))


def falling(axis: Axis, servo: ActiveLaw, level: Level) -> Iterator[Condition]:
    """Yield the stability of slow motion at the least stable speed, if the loop is stable without dry friction."""
    laws = _with_estimators(axis, servo)
    if axis.contact is None or level.vs is None or not _poles(axis, laws, level.viscous, 0.0).ok:
        return
    driven = axis.driven(level.viscous, 0.0, servo.path.at_load)
    at = 3 if axis.at_load else 1
    mass = axis.m if axis.flexible is None else axis.flexible[int(axis.at_load)]
    speeds = level.vs * np.geomspace(0.05, 5.0, 31)
    g = level.at(speeds)
    found = []
    for v, here, slope in zip(speeds, g, np.gradient(g, speeds), strict=True):
        if axis.contact.stiffness:
            bristles = (axis.contact.stiffness, axis.contact.damping)
            plant = conditions.on_bristles(driven, at, mass, *bristles, float(here), float(slope), float(v))
        else:
            A = driven.A.copy()
            A[at, at] -= slope / mass
            plant = replace(driven, A=A)
        found.append((spectral_radius(_chained(plant, laws)), float(v), float(slope), plant))
    _, v, slope, plant = found[first_largest([radius for radius, *_ in found])]
    yield conditions.loop_poles(
        plant,
        _together(laws),
        servo.values["Ts"],
        servo.path.dynamics,
        name="stick-slip",
        where=f"at {v:.4g} m/s, where friction falls by {-slope:.4g} N.s/m,",
        why="friction falls with speed faster than the loop damps: slow motion is unstable and shows stick-slip",
        hint="raise the damping of the loop or the bandwidth of the estimator, or compensate the friction",
    )


def _resonance(m1: float, m2: float, k: float, d: float) -> str:
    frequency = math.sqrt(k * (m1 + m2) / (m1 * m2)) / (2.0 * math.pi)
    return (
        f"motor and load resonate at {frequency:.4g} Hz, and with its delays and sensor location the loop excites "
        "this resonance: the oscillation grows"
    )


def _chained(plant: DrivenPlant, laws: tuple[ActiveLaw, ...]) -> Matrix:
    Ts = laws[0].values["Ts"]
    return conditions.chain(plant, _together(laws)(Ts), Ts, laws[0].path.dynamics)


def _poles(
    axis: Axis,
    laws: tuple[ActiveLaw, ...],
    damping: float,
    stiffness: float,
    where: str = "in sliding",
    times: float = 1.0,
) -> Condition:
    servo, estimates = laws[0], any(used.law.estimates for used in laws)
    texts = {}
    if estimates:
        texts = {"name": "disturbance observer", "why": _INVERSE}
        texts["hint"] = "lower the bandwidth of the estimator, correct its mass"
    elif axis.flexible is not None:
        texts = {"why": _resonance(*axis.flexible)}
    elif stiffness:
        texts = {"name": "presliding loop", "why": _BUZZ}
    driven = axis.driven(damping, stiffness, servo.path.at_load)
    return conditions.loop_poles(
        driven, _together(laws, times), servo.values["Ts"], servo.path.dynamics, where=where, **texts
    )


def _together(laws: tuple[ActiveLaw, ...], times: float = 1.0) -> Callable[[float], Sequence[SampledLaw]]:
    def sampled(Ts: float) -> list[SampledLaw]:
        return [
            used.law.linear(used.values, Ts).scaled(times * used.to_force, used.of_position, used.of_velocity)
            for used in laws
            if used.law.linear is not None
        ]

    return sampled


def direct_gains(axis: Axis, servo: ActiveLaw) -> tuple[float, float]:
    """Return the immediate response of the force to a step of measured position and velocity [N/m, N.s/m]."""
    laws = _with_estimators(axis, servo)
    found = _together(laws)(servo.values["Ts"])
    return float(sum(law.D[0] for law in found)), float(sum(law.D[1] for law in found))
