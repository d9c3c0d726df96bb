"""Rests of an axis in a record: samples at which the motion cannot explain the drive force."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from friction_fmus.identification.data.record import Array, Record

STILL: Final = 5  # fewest samples of a rest
CHANGE: Final = 0.5  # change of the drive force during a rest that is unresolved, over the rms force
SPREAD: Final = 8.0  # range of a resting position with noise, in standard deviations
SHARE: Final = 0.15  # longest time within one step before and after a standstill, over its duration


def unresolved_rest(record: Record) -> NDArray[np.bool_]:
    """Return the samples, shape (n,), at which the axis sticks and no friction model can explain the drive force."""
    # The position stays within one step of the encoder, or the velocity is zero, while the force changes by more than
    # `CHANGE`: the deflection of the contact is then smaller than the resolution, and friction is whatever the drive
    # gives. Rests whose force hardly changes are kept, as a model with presliding explains them.
    force = record.force_at_samples()
    least = CHANGE * float(np.sqrt(np.mean(np.square(force))))
    found = np.zeros(len(force), dtype=bool)
    for begin, end in _sections(record):
        if end - begin < STILL:
            continue
        part = force[begin:end]
        width = max(len(part) // 4, STILL)
        noise = float(np.std(np.diff(part))) / float(np.sqrt(2.0 * width))
        found[begin:end] = np.ptp(uniform_filter1d(part, width)) > least + 4.0 * noise
    return found


def standstill(record: Record) -> NDArray[np.bool_]:
    """Return the samples, shape (n,), at which the axis stands still, so that friction has no value of its own."""
    # A slow motion also stays within one step of the encoder for some time, but for as long within the next step;
    # before and after a standstill the axis leaves the step faster than `SHARE` of it. At a smooth reversal the step
    # before and after takes (sqrt(2) - 1)/2 = 0.21 of the time.
    found = np.zeros(len(record), dtype=bool)
    sections = list(_sections(record))
    lengths = [0, *(end - begin for begin, end in sections), 0]
    for (begin, end), before, samples, after in zip(sections, lengths, lengths[1:], lengths[2:], strict=False):
        if samples >= STILL and max(before, after) <= SHARE * samples:
            found[begin:end] = True
    return found


def _sections(record: Record) -> Iterator[tuple[int, int]]:
    """Yield consecutive sections within one step of the encoder, within the noise of the position, or at v = 0."""
    if record.q is None:
        moving, most = np.cumsum(record.column("v") != 0.0).astype(np.float64), 0.0
    else:
        moving, most = record.q, max(1.01 * record.quantum, SPREAD * position_noise(record.q))
    values = [*moving.tolist(), float(moving[-1])]  # a list, as single elements of an array are slow
    begin, low, high = 0, values[0], values[0]
    for k in (*(np.flatnonzero(np.diff(moving)) + 1).tolist(), len(moving)):
        value = values[k]
        low, high = (value, high) if value < low else (low, value if value > high else high)
        if high - low > most or k == len(moving):
            yield begin, k
            begin, low, high = k, value, value


def position_noise(q: Array, order: int = 4) -> float:
    """Return the standard deviation of the noise of a position from its differences of an even order."""
    # Differences hardly contain the motion: those of order 8 do not even at a tenth of the sample rate.
    if len(q) <= order:
        return 0.0
    return float(np.median(np.abs(np.diff(q, order)))) / 0.6745 / math.sqrt(math.comb(2 * order, order))
