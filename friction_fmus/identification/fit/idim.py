"""Inverse dynamic identification by least squares (IDIM-LS).

The drive force of the axis is linear in the parameters,

    F = M q'' + Fv q' + Fc sgn(q') + OF.                                                      (1)

With the motion from a filtered position, each sample is a row of W theta = F, and theta follows from linear least
squares (M. Gautier, Ph. Poignet, "Extended Kalman filtering and weighted least squares dynamic identification of
robot", Control Engineering Practice 9, 2001; for the EMPS axis: Janot, Gautier, Brunot 2019).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.signal
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from friction_fmus.errors import ExcitationError, FitError, RecordError
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.estimate import (
    Estimate,
    Estimated,
    coloured_covariance,
    correlation_length,
    dependent_columns,
)
from friction_fmus.identification.fit.rests import standstill


@dataclass(frozen=True)
class InverseModelSettings:
    """Settings of the regression of the inverse model.

    The defaults are those of the authors of the EMPS record, except for the border: the bandwidth of the motion is
    20 Hz, the filter cuts off at five times that, and the rows are decimated to 100 Hz, which keeps the motion and
    avoids residuals correlated by the filter.

    Attributes
    ----------
    cutoff : float
        Cut-off frequency of the zero-phase Butterworth filter of the position [Hz].
    order : int
        Order of this filter in each direction.
    border : (float, float), optional
        Times at the beginning and at the end of a record to discard, where filter and differences settle [s]; by
        default `SETTLING` over the cut-off frequency.
    decimation : int
        Decimation factor of the rows. Regressors and force are filtered alike, by an 8th-order zero-phase Chebyshev
        filter at 0.8 of the new Nyquist frequency.
    order_of_differences : {2, 4}
        Order of the central differences for velocity and acceleration: with 2, a mass appears larger by (w Ts)^2 / 3.
    leaves_out_rests : bool
        Whether rows are left out in which the axis stands still: its friction is then whatever the drive gives.
    """

    cutoff: float = 100.0
    order: int = 4
    border: tuple[float, float] | None = None
    decimation: int = 10
    order_of_differences: int = 4
    leaves_out_rests: bool = True

    def rows(self, signal: Array, Ts: float) -> Array:
        """Return a signal without its ends, filtered and decimated.

        Parameters
        ----------
        signal : array, shape (n,) or (n, columns)
            Signal at all samples.
        Ts : float
            Sample time [s].

        Returns
        -------
        array, shape (rows,) or (rows, columns)
            Filtered rows.
        """
        return decimate(self._inside(signal, Ts), self.decimation)

    def times(self, t: Array, Ts: float) -> Array:
        """Return the times of the rows.

        Parameters
        ----------
        t : array, shape (n,)
            Times of all samples [s].
        Ts : float
            Sample time [s].

        Returns
        -------
        array, shape (rows,)
            Times [s].
        """
        inside = self._inside(t, Ts)
        return inside[(len(inside) - 1) % self.decimation :: self.decimation]

    def rows_outside(self, rest: NDArray[np.bool_], Ts: float) -> NDArray[np.bool_] | None:
        """Return the rows whose filters see none of these samples.

        Parameters
        ----------
        rest : array of bool, shape (n,)
            Samples that must not be used.
        Ts : float
            Sample time [s].

        Returns
        -------
        array of bool, shape (rows,), or None
            None if there is no such sample, or if too few rows would be left (`REMAINING`, `ENOUGH`).
        """
        if not rest.any():
            return None
        seen = binary_dilation(rest, iterations=round(2.0 / (self.cutoff * Ts)))
        used: NDArray[np.bool_] = self.times(seen.astype(np.float64), Ts) == 0.0
        enough = float(np.mean(used)) >= REMAINING or np.count_nonzero(used) >= ENOUGH
        return used if enough else None

    def require(self, record: Record, columns: int = 1) -> None:
        """Raise RecordError if a record is too short for the border and for rows of several columns.

        Parameters
        ----------
        record : Record
            Record to be used.
        columns : int
            Number of unknowns.
        """
        first, last = self._discarded(record.Ts)
        _require_length(record, first + last + max(25, (columns + 1) * self.decimation))

    def _inside(self, signal: Array, Ts: float) -> Array:
        first, last = self._discarded(Ts)
        return signal[first : max(len(signal) - last, first)]

    def _discarded(self, Ts: float) -> tuple[int, int]:
        first, last = self.border or (SETTLING / self.cutoff,) * 2
        return round(first / Ts), round(last / Ts)


REMAINING = 0.25  # fraction of the rows that must remain outside rests
ENOUGH = 200  # or their number, however long the axis rests

#: Time in which filter and differences settle, over the period of the cut-off frequency: transients of the slowest pole
#: of order 4 have then decayed to 8e-6.
SETTLING = 4.9

#: Settings with which the values of the EMPS record were published, with differences of second order: only the
#: beginning is discarded, as the axis is in motion there.
PUBLISHED_SETTINGS = InverseModelSettings(border=(0.049, 0.0), order_of_differences=2, leaves_out_rests=False)


ROUNDING = 0.05  # largest acceleration from rounding, relative to that of the motion, both rms
QUARTER = 0.25  # largest cut-off frequency over the sample rate, up to which the differences are accurate
LOWEST = 8.0  # lowest cut-off frequency for a coarse position [Hz]


def default_settings(record: Record) -> InverseModelSettings:
    """Return the filter used for the EMPS record, with at most a quarter of the sample rate as cut-off frequency."""
    # At a tenth of a rate of 100 Hz, the filter would be as long as the motion between two reversals, and the smoothed
    # reversals would be taken for a lower friction at low speeds. A coarse position needs a lower cut-off frequency, as
    # its rounding must not dominate the acceleration.
    rate = 1.0 / record.Ts
    cutoff = min(100.0, QUARTER * rate)
    settings = InverseModelSettings(cutoff=cutoff, decimation=max(1, round(rate / cutoff)))
    if record.q is None or record.quantum <= 0.0 or len(record) <= 3 * settings.order + 1:
        return settings
    while cutoff > LOWEST:
        # white noise of the variance of a rounding behind two derivatives and the low-pass filter of the rows
        edge = 0.4 * cutoff
        rounding = record.quantum / 12.0**0.5 * (2.0 * np.pi * edge) ** 2 * (2.0 * edge / (5.0 * rate)) ** 0.5
        if rounding <= ROUNDING * float(np.std(filtered_motion(record, settings).a)):
            break
        cutoff *= 0.7
        settings = InverseModelSettings(cutoff=cutoff, decimation=max(1, round(rate / cutoff)))
    return settings


@dataclass(frozen=True, eq=False)
class Motion:
    """Filtered motion of an axis."""

    q: Array  # position, shape (n,)
    v: Array  # velocity
    a: Array  # acceleration


@dataclass(frozen=True, eq=False)
class InverseModelFit(Estimated):
    """Result of a least squares fit of the inverse model."""

    parameters: Mapping[str, Estimate]  # M, Fv, Fc, OF
    relative_residual: float  # norm of the residual over the norm of the force, both decimated
    condition: float  # condition number of the decimated regressor matrix with normalised columns
    v: Array  # decimated velocity, shape (rows,)
    friction: Array  # decimated F - M q'', the points of the friction curve with v


def filtered_motion(record: Record, settings: InverseModelSettings | None = None) -> Motion:
    """Return filtered position, velocity and acceleration of a record."""
    settings = default_settings(record) if settings is None else settings
    nyquist = 0.5 / record.Ts
    if not 0.0 < settings.cutoff < nyquist:
        raise RecordError(
            f"The cut-off frequency {settings.cutoff:g} Hz is not between 0 and the Nyquist frequency {nyquist:g} Hz "
            f"of the record {record.name!r}; correct it."
        )
    _require_length(record, 3 * settings.order + 1)
    q = smoothed(record.column("q"), record, settings)
    v = derivative(q, record.Ts, settings.order_of_differences)
    return Motion(q, v, derivative(v, record.Ts, settings.order_of_differences))


def smoothed(signal: Array, record: Record, settings: InverseModelSettings) -> Array:
    """Return a signal of a record, shape (n,), behind the filter of the position."""
    sos = scipy.signal.butter(settings.order, 2.0 * settings.cutoff * record.Ts, output="sos")
    # the reflection of MATLAB's filtfilt, which was used for the published values; the default of scipy is longer
    return np.asarray(scipy.signal.sosfiltfilt(sos, signal, padlen=3 * settings.order), dtype=np.float64)


def derivative(values: Array, Ts: float, order: int = 4) -> Array:
    """Return the central differences of values of shape (n,), of second order near the ends."""
    found = np.asarray(np.gradient(values, Ts), dtype=np.float64)
    if order == 4 and len(values) > 4:
        near, far = values[3:-1] - values[1:-3], values[4:] - values[:-4]
        found[2:-2] = (8.0 * near - far) / (12.0 * Ts)
    return found


def identify_inverse_model(record: Record, settings: InverseModelSettings | None = None) -> InverseModelFit:
    """Identify M, Fv, Fc and OF of equation (1) by least squares."""
    # Method of Janot, Gautier, Brunot 2019. With `PUBLISHED_SETTINGS`, those of the script `Script_IDIM_LS.m` published
    # with the record, the result agrees with their values in all printed digits. The sign is taken from the filtered
    # velocity at the full rate. The 20 Hz in their text are the bandwidth of the motion, not the rate of the rows:
    # decimation to 20 Hz would give M = 94.66 kg. Their standard errors assume uncorrelated residuals.
    settings = default_settings(record) if settings is None else settings
    motion = filtered_motion(record, settings)
    columns = {"M": motion.a, "Fv": motion.v, "Fc": np.sign(motion.v), "OF": np.ones_like(motion.v)}
    return _linear_fit(record, motion, columns, settings)


COLUMNS = 8  # columns that are filtered at a time, as the filter makes several copies of the whole signal


def decimate(signal: Array, factor: int) -> Array:
    """Decimate a signal behind a zero-phase low-pass filter; the last sample is kept."""
    # Chebyshev, type I, order 8, 0.05 dB ripple, edge at 0.8 of the new Nyquist frequency, forward and backward with a
    # reflection of 24 samples, as in MATLAB's decimate
    if factor == 1:
        return signal
    if signal.ndim > 1 and signal.shape[1] > COLUMNS:
        parts = range(0, signal.shape[1], COLUMNS)
        return np.hstack([decimate(signal[:, begin : begin + COLUMNS], factor) for begin in parts])
    smooth = np.asarray(scipy.signal.sosfiltfilt(_low_pass(factor), signal, axis=0, padlen=24), dtype=np.float64)
    first = (len(signal) - 1) % factor
    return smooth[first::factor]


@cache
def _low_pass(factor: int) -> Array:
    """Return the sections of the filter of `decimate`."""
    return np.asarray(scipy.signal.cheby1(8, 0.05, 0.8 / factor, output="sos"))


def _linear_fit(
    record: Record, motion: Motion, columns: Mapping[str, Array], settings: InverseModelSettings
) -> InverseModelFit:
    """Return the least-squares fit of the force on the columns."""
    if settings.decimation < 1 or min(settings.border or (0.0,)) < 0.0:
        raise FitError(
            f"The decimation is {settings.decimation} and the border {settings.border}; they must be at least 1 and 0."
        )
    settings.require(record, len(columns))
    names = list(columns)
    used = settings.rows_outside(standstill(record), record.Ts) if settings.leaves_out_rests else None
    kept = slice(None) if used is None else used
    W = settings.rows(np.column_stack(list(columns.values())), record.Ts)[kept]
    force = settings.rows(record.force_at_samples(), record.Ts)[kept]

    length = np.linalg.norm(W, axis=0)
    if np.any(length == 0.0):
        raise ExcitationError(
            f"The record {record.name!r} contains no excitation for {names[int(np.argmin(length))]}; record a motion "
            "with accelerations in both directions and several speeds."
        )
    U, singular, right = np.linalg.svd(W / length, full_matrices=False)
    if mixed := dependent_columns(singular, right, names):
        raise ExcitationError(
            f"The record {record.name!r} does not allow {' and '.join(mixed)} to be separated; record a motion with "
            "accelerations in both directions and several speeds."
        )
    theta = right.T @ ((right @ (W.T @ force / length)) / singular**2) / length
    residual = force - W @ theta
    back = right.T / singular / length[:, None]
    covariance = coloured_covariance(back, U, residual, [len(residual)], correlation_length(residual))

    errors = np.sqrt(np.diag(covariance))
    units = {"M": record.units.inertia, "Fv": record.units.viscous}
    parameters = {
        name: Estimate(name, float(value), float(error), units.get(name, record.units.force))
        for name, value, error in zip(names, theta, errors, strict=True)
    }
    return InverseModelFit(
        parameters,
        relative_residual=float(np.linalg.norm(residual) / np.linalg.norm(force)),
        condition=float(singular[0] / singular[-1]),
        v=settings.rows(motion.v, record.Ts)[kept],
        friction=force - theta[names.index("M")] * W[:, names.index("M")],
    )


def _require_length(record: Record, samples: int) -> None:
    if len(record) <= samples:
        raise RecordError(
            f"The record {record.name!r} has {len(record)} samples at {1.0 / record.Ts:.6g} Hz, but the filters need "
            f"more than {samples}; log a longer motion with several reversals, or choose a longer window."
        )
