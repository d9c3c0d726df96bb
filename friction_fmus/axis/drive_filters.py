"""Filters of a servo drive in sampled time: low-pass filter of the velocity and notch filter of the force command."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt, tan
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi

Array = NDArray[np.float64]

BUTTERWORTH: Final = sqrt(0.5)  # damping ratio of a low-pass filter of order 2


@dataclass(frozen=True)
class SecondOrder:
    """Parameters of the block SecondOrderFilter."""

    f: float
    zeta: float
    low: float = 1.0
    band: float = 0.0
    high: float = 0.0

    def coefficients(self, Ts: float) -> tuple[Array, Array]:
        """Return numerator and denominator in powers of 1/z."""
        if not 0.0 < self.f * Ts < 0.5:
            return np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
        q = 1.0 / tan(pi * self.f * Ts)
        d, high = 2.0 * self.zeta * q, self.high * q * q
        b = np.array([high + self.band * d + self.low, 2.0 * (self.low - high), high - self.band * d + self.low])
        a = np.array([q * q + d + 1.0, 2.0 * (1.0 - q * q), q * q - d + 1.0])
        return b / a[0], a / a[0]


@dataclass(frozen=True)
class LowPass:
    """Low-pass filter of the measured velocity.

    Attributes
    ----------
    order : int
        1, or 2 for a Butterworth filter.
    cutoff : float
        Frequency at which the gain is 1/sqrt(2) [Hz].
    """

    order: int
    cutoff: float

    @property
    def tau(self) -> float:
        """Time constant of order 1 [s]."""
        return 1.0 / (2.0 * pi * self.cutoff)

    @property
    def section(self) -> SecondOrder:
        """Parameters of the block of order 2."""
        return SecondOrder(self.cutoff, BUTTERWORTH)

    def coefficients(self, Ts: float) -> tuple[Array, Array]:
        """Return numerator and denominator in powers of 1/z, as the blocks of the simulation have them."""
        if self.order == 2:
            return self.section.coefficients(Ts)
        keep = exp(-Ts / self.tau)
        return np.array([1.0 - keep, 0.0]), np.array([1.0, -keep])


@dataclass(frozen=True)
class Notch:
    """Notch filter of the force command.

    Attributes
    ----------
    frequency : float
        Centre [Hz].
    damping : float
        Damping ratio of the poles; the notch is 2 `damping` `frequency` wide.
    depth : float
        Gain at the centre.
    """

    frequency: float
    damping: float
    depth: float = 0.0

    @property
    def section(self) -> SecondOrder:
        """Parameters of the block."""
        return SecondOrder(self.frequency, self.damping, 1.0, self.depth, 1.0)


def filtered(section: LowPass | SecondOrder | None, values: Array, Ts: float) -> Array:
    """Return values of shape (n,) behind a filter, which begins as if the first one had always been there."""
    if section is None:
        return values
    b, a = section.coefficients(Ts)
    found, _ = lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])
    return np.asarray(found, dtype=np.float64)
