"""Recognition of a force that was added to the drive from outside: in pulses, or periodic."""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np

from friction_fmus.identification import Array
from friction_fmus.study.regression import Comparison, references, rms

BETWEEN: Final = 0.5
"""Fraction of the samples that the servo must reproduce if the rest is a force in pulses."""

LINES: Final = 0.6
"""Fraction of the power of a periodic force in its strongest frequencies."""


def pulses(compared: Comparison, difference: Array) -> str:
    """Return the description of pulses between which the servo reproduces the force; empty if there are none."""
    size = np.where(compared.used, np.abs(difference), 0.0)
    peak = float(np.max(size))
    outside = size > 0.2 * peak
    between = compared.used & (size <= 0.05 * peak)
    if np.count_nonzero(between) < BETWEEN * np.count_nonzero(compared.used):
        return ""
    starts = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8)])) == 1)
    peaks = [size[begin:end].max() for begin, end in zip(starts, [*starts[1:], len(size)], strict=True)]
    force, t = compared.record.units.force, compared.record.t[starts[0]]
    one = len(peaks) == 1
    return (
        f"in {'one pulse' if one else f'{len(peaks)} pulses'} of {float(np.median(peaks)):.3g} {force}, "
        f"{'at' if one else 'the first one at'} {t:.4g} s"
    )


def frequencies(compared: Comparison, difference: Array) -> str:
    """Return the description of a periodic force; empty if its frequency is one of the reference, or it is not one."""
    power, reference = (
        np.abs(np.fft.rfft((values - np.mean(values)) * np.hanning(len(values)))) ** 2
        for values in (np.where(compared.used, difference, 0.0), references(compared.record, compared.servo.Ts)["rd"])
    )
    left, places = power.copy(), np.zeros(len(power), dtype=bool)
    for _ in range(3):
        place = int(np.argmax(left))
        if np.sum(left[max(0, place - 3) : place + 4]) < 0.05 * np.sum(power):
            break
        places[max(0, place - 3) : place + 4] = True
        left[places] = 0.0
    if np.sum(power[places]) < LINES * np.sum(power) or np.sum(reference[places]) > 0.05 * np.sum(reference):
        return ""
    frequency = float(np.argmax(power)) / (len(difference) * compared.servo.Ts)
    amplitude = sqrt(2.0) * rms(difference[compared.used])
    return f"periodic, mainly at {frequency:.4g} Hz, with an amplitude of {amplitude:.3g} {compared.record.units.force}"
