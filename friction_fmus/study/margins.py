"""Margins of the servo with a compensator, from the loop linearised in sliding and at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from friction_fmus.axis.drive_filters import coefficients
from friction_fmus.axis.loop_assembly import block
from friction_fmus.axis.servo import GAINS, AxisPlant, Compensator, Servo
from friction_fmus.blocks.catalogue import find
from friction_fmus.conditions import DrivenPlant, PathDynamics, SampledLaw, chain, on_bristles, one_mass, two_masses
from friction_fmus.conditions.chain import Margins, loop_margins
from friction_fmus.conditions.condition import spectral_radius
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
    found, resonance = [], 0.0
    for at, driven in operating_points(plant, speed):
        if not at and not _rests(servo, driven):
            continue
        laws = _laws(servo, compensator if kind not in OPEN_LOOP else None, kind, gain, at)
        if laws is None:
            return None
        found.append(loop_margins(driven, laws, servo.Ts, path_of(servo)))
        resonance = max(resonance, tolerated_resonance(servo, plant, laws))
    return replace(_worst(found), resonance=resonance)


def path_of(servo: Servo) -> PathDynamics:
    """Return delay, velocity estimate and filters of a servo."""
    filters = (servo.velocity_filter, servo.notch)
    lowpass, notch = (None if own is None else coefficients(own, servo.Ts) for own in filters)
    return PathDynamics(servo.lag, servo.delay * servo.Ts, servo.window, lowpass=lowpass, notch=notch)


def _rests(servo: Servo, driven: DrivenPlant) -> bool:
    """Return whether the servo without integral action is stable on a contact at rest.

    The measured axis was at rest with it: otherwise the record does not determine stiffness and damping of the contact,
    and margins at rest say nothing about the axis.
    """
    laws = _laws(replace(servo, gains={**servo.gains, GAINS[servo.law][-1]: 0.0}), None, "", 1.0, 0.0)
    return laws is not None and spectral_radius(chain(driven, laws, servo.Ts, path_of(servo))) < 1.0


FREQUENCIES: Final = 32  # number of resonances that are tried
LOWEST: Final = 0.25  # lowest of them divided by the natural frequency of the position loop
HIGHEST: Final = 0.4  # highest of them divided by the sample rate
DAMPING: Final = 0.02  # damping ratio of the resonance
LOAD: Final = 0.5  # mass of the load divided by the mass of the motor


def tolerated_resonance(servo: Servo, plant: AxisPlant, laws: Sequence[SampledLaw]) -> float:
    """Return the frequency above which a loop is stable with any lightly damped resonance [Hz].

    Motor and load have the mass of the plant together; the encoder is at the motor, as is the viscous friction.
    """
    motor = plant.mass / (1.0 + LOAD)
    load = plant.mass - motor
    reduced = motor * load / plant.mass
    viscous = max(plant.values.get("Fv", plant.values.get("sigma2", 0.0)), 0.0)
    path = path_of(servo)
    natural = float(np.sqrt(servo.pid[0] / plant.mass)) / (2.0 * np.pi)
    tolerated = 0.5 / servo.Ts
    for frequency in np.geomspace(HIGHEST / servo.Ts, min(LOWEST * natural, 0.1 / servo.Ts), FREQUENCIES):
        w = 2.0 * np.pi * float(frequency)
        flexible = two_masses(motor, load, reduced * w**2, 2.0 * DAMPING * reduced * w, (viscous, 0.0))
        if spectral_radius(chain(flexible, laws, servo.Ts, path)) > 1.0 + 1e-9:
            return tolerated
        tolerated = float(frequency)
    return 0.0


def operating_points(plant: AxisPlant, speed: float) -> list[tuple[float, DrivenPlant]]:
    """Return the plant linearised in sliding at a speed and, if its contact is elastic, at rest, with the speeds."""
    friction = find(plant.friction).about.in_loop.friction
    m = plant.mass
    if plant.load is not None:
        viscous = max(plant.values.get("Fv", plant.values.get("sigma2", 0.0)), 0.0)
        parted = (1.0 - plant.load.friction) * viscous, plant.load.friction * viscous
        p = plant.load.parameters(m)
        return [(speed, two_masses(p["m1"], p["m2"], p["k"], p["d"], parted))]
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
