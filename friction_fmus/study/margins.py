"""Margins of the servo with a compensator, from the loop linearised in sliding and at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from friction_fmus.axis.loop_assembly import block
from friction_fmus.axis.servo import AxisPlant, Compensator, Servo
from friction_fmus.blocks.catalogue import find
from friction_fmus.conditions import DrivenPlant, SampledLaw, on_bristles, one_mass
from friction_fmus.conditions.chain import Margins, loop_margins
from friction_fmus.doctor.roles import law_of, linearised
from friction_fmus.study.study_result import LoopMargins
from harness import FmuPart

OPEN_LOOP: Final = ("feedforward", "dither")
"""Kinds of compensators that do not use measured signals and leave the margins unchanged."""


LEAK: Final = 1e-6
"""Share of the deflection of modelled bristles that is lost in a sample at rest.

At rest it only changes with the position, which is an eigenvalue of exactly 1; any motion makes it decay.
"""


def margins_of(
    servo: Servo,
    plant: AxisPlant,
    speed: float,
    compensator: Compensator | None = None,
    kind: str = "",
    gain: float = 1.0,
) -> LoopMargins | None:
    """Return the margins of the servo with a compensator; None if the compensator cannot be linearised."""
    found = []
    for at, driven in operating_points(plant, speed):
        laws = _laws(servo, compensator if kind not in OPEN_LOOP else None, kind, gain, at)
        if laws is None:
            return None
        found.append(loop_margins(driven, laws, servo.Ts, servo.window, servo.delay))
    return _worst(found)


def operating_points(plant: AxisPlant, speed: float) -> list[tuple[float, DrivenPlant]]:
    """Return the plant linearised in sliding at a speed and, if its contact is elastic, at rest, with the speeds."""
    friction = find(plant.friction).about.in_loop.friction
    m = plant.mass
    if friction is None or speed <= 0.0:
        return [(speed, one_mass(m))]
    contact = friction.contact(plant.values)
    level = contact.levels[0]
    near = speed * np.array([0.99, 1.01])
    low, high = level.at(near)
    slope = float((high - low) / (near[1] - near[0]))
    beside = plant.values.get("Fv", 0.0) if friction.viscous == "0" else 0.0
    sliding = one_mass(m, level.viscous + beside)
    if not contact.stiffness:
        sliding.A[1, 1] -= slope / m
        return [(speed, sliding)]
    size = float(level.at(np.array([speed]))[0])
    if size > 0.0:
        sliding = on_bristles(sliding, 1, m, contact.stiffness, contact.damping, size, slope, speed)
    return [(speed, sliding), (0.0, one_mass(m, contact.damping + contact.viscous + beside, contact.stiffness))]


def _laws(
    servo: Servo, compensator: Compensator | None, kind: str, gain: float, speed: float
) -> Sequence[SampledLaw] | None:
    """Return the linear laws in the loop; None if one of them cannot be linearised."""
    feedback = law_of(servo.law)
    assert feedback is not None
    assert feedback.linear is not None
    laws = [feedback.linear(servo.gains, servo.Ts)]
    if compensator is None:
        return laws
    limits = {"u_min": -servo.force_limit, "u_max": servo.force_limit}
    values = {**limits, **compensator.values}
    if find(compensator.model).is_law:
        at = speed if kind == "model feedback" else 0.0  # the other laws are linear
        law = linearised(compensator.model, values, servo.Ts, compensator.output, at)
        if kind == "model feedback" and speed == 0.0:
            law = replace(law, A=(1.0 - LEAK) * law.A)
    else:
        known = law_of(compensator.model)
        if known is None or known.linear is None:
            return None
        part = FmuPart("law", block(compensator.model))
        starts = {port.name: float(port.start) for port in part.parameters if isinstance(port.start, (int, float))}
        law = known.linear({**starts, **values}, servo.Ts)
    return [*laws, replace(law, C=gain * law.C, D=gain * law.D)]


def _worst(found: Sequence[Margins]) -> LoopMargins:
    stable = all(each.stable for each in found)
    phase, delay = min(each.phase for each in found), min(each.delay for each in found)
    return LoopMargins(
        max(each.sensitivity for each in found) if stable else None,
        float(np.degrees(phase)) if np.isfinite(phase) else None,
        delay if np.isfinite(delay) else None,
    )
