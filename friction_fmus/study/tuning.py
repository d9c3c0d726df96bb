"""Trials of a compensator: gains or bandwidths for which the loop keeps the limits on its margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import Final

import numpy as np

from friction_fmus.axis.servo import GAINS, Servo
from friction_fmus.study.compensator_records import Limits
from friction_fmus.study.compensators import INTEGRAL, TABLE, AxisKnowledge, Candidate, tuned_to, within_range
from friction_fmus.study.evaluation import Scheme
from friction_fmus.study.margins import margins_of

SCALES: Final = tuple(float(2.0**power) for power in np.arange(4.0, -4.1, -0.5))
"""Bandwidths over the rule of `AxisKnowledge` among which the largest within the limits is sought, largest first."""

SHARES: Final = (1.0, 0.7, 0.5, 0.35, 0.25, 0.125)
"""Bandwidths that are tried, over the largest one within the limits."""


def trials(
    candidate: Candidate,
    known: AxisKnowledge,
    speed: float,
    limits: Limits,
    gains: Sequence[float],
) -> list[Scheme]:
    """Return the trials of a compensator that keep the limits; empty if there are none."""
    servo, plant = known.servo, known.plant

    def with_gain(gain: float) -> Scheme:
        margins = margins_of(servo, plant, speed, candidate.compensator, candidate.kind, gain)
        return Scheme(servo, gain, None, candidate.compensator, margins=margins)

    def with_scale(scale: float) -> Scheme:
        scaled = replace(known, scale=scale)
        bandwidth = candidate.bandwidth(scaled)
        if candidate == INTEGRAL:
            feedback = with_integral(servo, 2.0 * pi * bandwidth)
            return Scheme(feedback, 1.0, bandwidth, margins=margins_of(feedback, plant, speed))
        compensator = tuned_to(candidate, scaled)
        margins = margins_of(servo, plant, speed, compensator, candidate.kind)
        return Scheme(servo, 1.0, bandwidth, compensator, margins=margins)

    if candidate == TABLE:
        return [Scheme(servo, margins=margins_of(servo, plant, speed), table=True)]
    if not candidate.has_bandwidth:
        return [each for each in map(with_gain, gains) if limits.kept_by(each.margins)]
    # scales beyond the cap of the bandwidth give the same compensator
    cap = candidate.bandwidth(replace(known, scale=SCALES[0]))
    scales = [scale for scale in SCALES[1:] if candidate.bandwidth(replace(known, scale=scale)) < cap]

    def possible(scheme: Scheme) -> bool:
        inside = scheme.compensator is None or within_range(scheme.compensator)
        return inside and limits.kept_by(scheme.margins)

    largest = next((scale for scale in scales if possible(with_scale(scale))), None)
    if largest is None:
        return []
    # a slower estimator can have a higher sensitivity peak
    return [each for share in SHARES if possible(each := with_scale(share * largest))]


def with_integral(servo: Servo, rate: float) -> Servo:
    """Return the servo with an integral action whose corner frequency is `rate` [rad/s].

    The corner is Ki/Kp of a PID controller, and ki/kv of the velocity loop of a cascade.
    """
    first, second, third = GAINS[servo.law]
    over = servo.gains[first] if servo.law == "PID" else servo.gains[second]
    return replace(servo, gains={**servo.gains, third: rate * over})
