"""Inverse dynamic identification by least squares (IDIM-LS).

The force that moves the axis is linear in the parameters,

    F = M q'' + Fv q' + Fc sgn(q') + OF,                                                      (1)

so with the motion from a filtered position one sample is one row of W theta = F, and theta follows from
linear least squares (M. Gautier, Ph. Poignet, "Extended Kalman filtering and weighted least squares dynamic
identification of robot", Control Engineering Practice 9, 2001; for this axis: Janot, Gautier, Brunot 2019).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.signal

from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.errors import ExcitationError, FitError, RecordError
from friction_fmus.identification.fit.estimate import Estimate
from friction_fmus.identification.fit.rank import not_separated


@dataclass(frozen=True)
class InverseModelSettings:
    """How the record becomes a regression.

    The defaults are those the authors of the EMPS record identified it with: the axis is followed up to 20
    Hz, the filter cuts at five times that, and the rows are decimated to 100 Hz so that twice 20 Hz remains
    and the residuals of neighbouring rows are no longer correlated by the filter.

    Attributes
    ----------
    cutoff : float
        Cut-off frequency of the zero-phase Butterworth filter on the position [Hz].
    order : int
        Its order (one way).
    border : int
        Samples left out at the beginning, where differences and filter start [-].
    decimation : int
        One row is kept out of this many, after an 8th-order zero-phase Chebyshev filter at 0.8 of the new
        Nyquist frequency on regressors and force alike, so both sides of the equation see the same filter
        [-].
    """

    cutoff: float = 100.0
    order: int = 4
    border: int = 49
    decimation: int = 10


@dataclass(frozen=True, eq=False)
class Motion:
    """Filtered motion of an axis, all of shape (n,): position, velocity and acceleration."""

    q: Array
    v: Array
    a: Array


@dataclass(frozen=True, eq=False)
class InverseModelFit:
    """Result of a least squares fit of the inverse model.

    Attributes
    ----------
    parameters : mapping of str to Estimate
        M, Fv, Fc, OF (and Fs, vs, delta for the Stribeck form).
    relative_residual : float
        Norm of the residual over norm of the force, both decimated [-].
    condition : float
        Condition number of the decimated regressor matrix with columns of length 1 [-].
    v, friction : array, shape (rows,)
        Decimated velocity, and decimated F - M q'': the data behind the friction curve.
    """

    parameters: Mapping[str, Estimate]
    relative_residual: float
    condition: float
    v: Array
    friction: Array

    def values(self) -> dict[str, float]:
        """Parameter values without their errors."""
        return {name: estimate.value for name, estimate in self.parameters.items()}


def filtered_motion(record: Record, settings: InverseModelSettings | None = None) -> Motion:
    """Position, velocity and acceleration from the measured position.

    Parameters
    ----------
    record : Record
        The record.
    settings : InverseModelSettings, optional
        Cut-off and order of the filter.

    Returns
    -------
    Motion
        Filtered position and its first and second central differences.

    Raises
    ------
    RecordError
        The record is too short for the filter, or the cut-off is not below the Nyquist frequency.

    Notes
    -----
    The reflection at the ends is three times the filter order, as in MATLAB's ``filtfilt`` which the
    published figures were computed with (scipy's own default is three samples longer).
    """
    settings = InverseModelSettings() if settings is None else settings
    nyquist = 0.5 / record.Ts
    if not 0.0 < settings.cutoff < nyquist:
        raise RecordError(
            f"The cut-off {settings.cutoff:g} Hz is not between 0 and the Nyquist frequency {nyquist:g} Hz "
            f"of the record {record.name!r}; lower it."
        )
    sos = scipy.signal.butter(settings.order, settings.cutoff / nyquist, output="sos")
    _require_length(record, 3 * settings.order + 1)
    q = np.asarray(scipy.signal.sosfiltfilt(sos, record.column("q"), padlen=3 * settings.order), dtype=np.float64)
    v = np.gradient(q, record.Ts)
    return Motion(q, v, np.gradient(v, record.Ts))


def identify_inverse_model(record: Record, settings: InverseModelSettings | None = None) -> InverseModelFit:
    """Identify M, Fv, Fc and OF of equation (1) by least squares.

    Parameters
    ----------
    record : Record
        The record; position and force are used, the reference is not.
    settings : InverseModelSettings, optional
        Filters; the defaults are the published ones.

    Returns
    -------
    InverseModelFit
        Parameters M, Fv, Fc, OF in the units of the axis, with standard errors.

    Raises
    ------
    RecordError
        The record is too short for the filters.
    ExcitationError
        The motion does not tell the parameters apart.

    Notes
    -----
    Janot, Gautier, Brunot 2019, with the settings of the script `Script_IDIM_LS.m` that the authors give out
    with the record; it gives their figures to all printed digits. The sign is that of the *filtered*
    velocity, taken at the full rate and before decimation; every regressor column and the force are
    decimated by 10, to 100 Hz, with the same zero-phase filter; the first 49 samples are dropped. The 20 Hz
    that their text speaks of are the bandwidth of the motion and not the rate of the rows: decimation to 20
    Hz would give M 94.66 kg.

    The standard errors are those of ordinary least squares, s sqrt(diag((W'W)^-1)), and hold for uncorrelated
    residuals.
    """
    settings = InverseModelSettings() if settings is None else settings
    motion = filtered_motion(record, settings)
    columns = {
        "M": motion.a,
        "Fv": motion.v,
        "Fc": np.sign(motion.v),
        "OF": np.ones_like(motion.v),
    }
    return _linear_fit(record, motion, columns, settings)[0]


def identify_inverse_stribeck(
    record: Record,
    settings: InverseModelSettings | None = None,
    deltas: Sequence[float] = (1.0, 2.0),
    vs: Iterable[float] | None = None,
) -> InverseModelFit:
    """Stribeck friction from the inverse model: start values for the fit in closed loop.

    Parameters
    ----------
    record : Record
        The record.
    settings : InverseModelSettings, optional
        Filters.
    deltas : sequence of float
        Exponents to try; the best one is kept [-].
    vs : iterable of float, optional
        Stribeck velocities to try, in the velocity unit; by default 25 between 1/200 and 1/2 of the largest
        speed.

    Returns
    -------
    InverseModelFit
        Parameters M, Fv, Fc, Fs, OF with the standard errors at fixed vs and delta, and vs and delta (chosen
        from the grid, standard error nan). Fs may come out below Fc: an axis may strengthen with speed.

    Raises
    ------
    ExcitationError
        No grid point is identifiable.
    FitError
        The grid is empty or not positive.

    Notes
    -----
    The friction Fc + (Fs - Fc) exp(-|v/vs|^delta) is linear in everything but vs and delta, so these two are
    searched on a grid and the others are solved for (variable projection; G. Golub, V. Pereyra, 1973).
    """
    settings = InverseModelSettings() if settings is None else settings
    motion = filtered_motion(record, settings)
    if vs is None:
        top = float(np.max(np.abs(motion.v)))
        vs = np.geomspace(top / 200.0, top / 2.0, 25) if top > 0.0 else [1.0]
    grid = [(float(delta), float(speed)) for delta in deltas for speed in vs]
    if not grid or min(min(pair) for pair in grid) <= 0.0:
        raise FitError("The grid of vs and delta is empty or not positive; give at least one positive value of each.")

    sign = np.sign(motion.v)
    best: tuple[float, InverseModelFit, Array, tuple[float, float]] | None = None
    refused: ExcitationError | None = None
    for delta, speed in grid:
        columns = {
            "M": motion.a,
            "Fv": motion.v,
            "Fc": sign,
            "OF": np.ones_like(motion.v),
            "Fs - Fc": sign * np.exp(-(np.abs(motion.v / speed) ** delta)),
        }
        try:
            fit, covariance = _linear_fit(record, motion, columns, settings)
        except ExcitationError as error:
            refused = error
            continue
        # curves that fit equally well, as all do without a Stribeck effect: the first one, not the last bits, decides
        if best is None or fit.relative_residual < (1.0 - 1e-9) * best[0] - 1e-12:
            best = (fit.relative_residual, fit, covariance, (delta, speed))
    if best is None:
        raise refused if refused is not None else ExcitationError("No grid point could be identified.")

    _, fit, covariance, (delta, speed) = best
    found = fit.parameters
    fs_error = float(np.sqrt(covariance[2, 2] + covariance[4, 4] + 2.0 * covariance[2, 4]))
    units = record.units
    parameters = {name: found[name] for name in ("M", "Fv", "Fc")}
    parameters["Fs"] = Estimate("Fs", found["Fc"].value + found["Fs - Fc"].value, fs_error, units.force)
    parameters["vs"] = Estimate("vs", speed, float("nan"), units.velocity)
    parameters["delta"] = Estimate("delta", delta, float("nan"), "1")
    parameters["OF"] = found["OF"]
    return InverseModelFit(parameters, fit.relative_residual, fit.condition, fit.v, fit.friction)


def decimate(signal: Array, factor: int) -> Array:
    """Keep every `factor`-th sample of a zero-phase low-passed signal, the last sample included.

    Parameters
    ----------
    signal : array, shape (n,) or (n, columns)
        The signal.
    factor : int
        1 leaves the signal as it is.

    Returns
    -------
    array, shape (ceil(n / factor),) or (ceil(n / factor), columns)

    Notes
    -----
    Chebyshev filter of type I, order 8, 0.05 dB ripple, edge at 0.8 of the new Nyquist frequency, run
    forwards and backwards, reflection 24 samples, phase of the kept samples counted from the end: MATLAB's
    ``decimate``.
    """
    if factor == 1:
        return signal
    sos = scipy.signal.cheby1(8, 0.05, 0.8 / factor, output="sos")
    smooth = np.asarray(scipy.signal.sosfiltfilt(sos, signal, axis=0, padlen=24), dtype=np.float64)
    first = (len(signal) - 1) % factor
    return smooth[first::factor]


def _linear_fit(
    record: Record, motion: Motion, columns: Mapping[str, Array], settings: InverseModelSettings
) -> tuple[InverseModelFit, Array]:
    """Least squares of the force on the columns; the fit and the covariance of its parameters."""
    if settings.decimation < 1 or settings.border < 0:
        raise FitError(
            f"The decimation {settings.decimation} must be at least 1 and the border {settings.border} at least 0."
        )
    _require_length(record, settings.border + max(25, (len(columns) + 1) * settings.decimation))
    names = list(columns)
    W = decimate(np.column_stack(list(columns.values()))[settings.border :], settings.decimation)
    force = decimate(record.column("force")[settings.border :], settings.decimation)

    length = np.linalg.norm(W, axis=0)
    if np.any(length == 0.0):
        raise ExcitationError(
            f"The record {record.name!r} does not excite {names[int(np.argmin(length))]} at all; record a "
            "motion with accelerations in both directions and several speeds."
        )
    _, singular, right = np.linalg.svd(W / length, full_matrices=False)
    if mixed := not_separated(singular, right, names):
        raise ExcitationError(
            f"The record {record.name!r} does not tell {' and '.join(mixed)} apart; record a motion with "
            "accelerations in both directions and several speeds."
        )
    theta = right.T @ ((right @ (W.T @ force / length)) / singular**2) / length
    residual = force - W @ theta
    variance = float(residual @ residual) / (len(force) - len(names))
    covariance = variance * (right.T / singular**2) @ right / np.outer(length, length)

    errors = np.sqrt(np.diag(covariance))
    units = {"M": record.units.inertia, "Fv": record.units.viscous}
    parameters = {
        name: Estimate(name, float(value), float(error), units.get(name, record.units.force))
        for name, value, error in zip(names, theta, errors, strict=True)
    }
    fit = InverseModelFit(
        parameters,
        relative_residual=float(np.linalg.norm(residual) / np.linalg.norm(force)),
        condition=float(singular[0] / singular[-1]),
        v=decimate(motion.v[settings.border :], settings.decimation),
        friction=force - theta[names.index("M")] * W[:, names.index("M")],
    )
    return fit, covariance


def _require_length(record: Record, samples: int) -> None:
    if len(record) <= samples:
        raise RecordError(
            f"The record {record.name!r} has {len(record)} samples and the filters need more than "
            f"{samples}; give a longer record or a smaller decimation."
        )
