"""Filters of a servo drive in sampled time: low-pass filter of the velocity and notch filter of the force command."""

from dataclasses import dataclass
from math import atan, exp, pi, sqrt
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi

from friction_fmus.conditions.chain import second_order

Array: TypeAlias = NDArray[np.float64]

BUTTERWORTH: Final = sqrt(0.5)  # damping ratio of a low-pass filter of order 2


@dataclass(frozen=True)
class LowPass:
    """Low-pass filter of the measured velocity: order, 1 or 2 (Butterworth), and frequency of -3 dB [Hz]."""

    order: int
    cutoff: float

    @property
    def tau(self) -> float:
        """Time constant of order 1 in the block Differentiator [s]; 0 for order 2."""
        return 1.0 / (2.0 * pi * self.cutoff) if self.order == 1 else 0.0

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the block SecondOrderFilter for order 2."""
        return {"f": self.cutoff, "zeta": BUTTERWORTH, "low": 1.0, "band": 0.0, "high": 0.0}


@dataclass(frozen=True)
class Notch:
    """Notch filter of the force command: centre [Hz], damping ratio of the poles, gain at the centre."""

    frequency: float
    damping: float
    depth: float = 0.0

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the block SecondOrderFilter."""
        return {"f": self.frequency, "zeta": self.damping, "low": 1.0, "band": self.depth, "high": 1.0}


@dataclass(frozen=True)
class CurrentLoop:
    """Lag of order 1 from a held command to the force, by the trapezoidal rule: time constant, sample time [s]."""

    tau: float
    Ts: float

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the block SecondOrderFilter, of which a pole and a zero cancel."""
        f = atan(0.5 * self.Ts / self.tau) / (pi * self.Ts)
        return {"f": f, "zeta": 1.0, "low": 1.0, "band": 0.5, "high": 0.0}


def coefficients(own: LowPass | Notch | CurrentLoop, Ts: float) -> tuple[Array, Array]:
    """Return numerator and denominator in powers of 1/z, as the blocks of the simulation have them."""
    if isinstance(own, LowPass) and own.order == 1:
        keep = exp(-Ts / own.tau)
        return np.array([1.0 - keep, 0.0]), np.array([1.0, -keep])
    return second_order(**own.parameters, Ts=Ts)


def filtered(own: LowPass | Notch | CurrentLoop | None, values: Array, Ts: float) -> Array:
    """Return values of shape (n,) behind a filter, which begins as if the first one had always been there."""
    if own is None:
        return values
    b, a = coefficients(own, Ts)
    found, _ = lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])
    return np.asarray(found, dtype=np.float64)
