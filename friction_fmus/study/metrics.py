"""How far a simulated closed loop is from the measured one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friction_fmus.identification import Array, FitError, Record

#: Samples left out where tracking errors are compared: the axis begins off its reference, which is no friction.
START_UP = 100


@dataclass(frozen=True)
class Agreement:
    """Distance of a simulated closed loop from the record.

    Attributes
    ----------
    position_rms_um : float
        Root mean square of simulated minus measured position [um].
    force_percent : float
        Root mean square of simulated minus measured force, in percent of that of the measured force.
    """

    position_rms_um: float
    force_percent: float


def rms(signal: Array) -> float:
    """Root mean square of a signal of shape (n,), in its unit."""
    return float(np.sqrt(np.mean(np.square(signal))))


def agreement(record: Record, q: Array, force: Array) -> Agreement:
    """Compare a simulation with the record.

    Parameters
    ----------
    record : Record
        The measurement, positions in m.
    q : array, shape (n,)
        Simulated position at the instants of the record [m].
    force : array, shape (n,)
        Simulated drive force, commanded at the instants of the record [N].

    Returns
    -------
    Agreement

    Raises
    ------
    FitError
        The simulation does not have the length of the record.
    """
    if not len(q) == len(force) == len(record):
        raise FitError(
            f"The simulation has {len(q)} positions and {len(force)} forces, the record {record.name!r} has "
            f"{len(record)} samples; simulate the instants of the record."
        )
    return Agreement(
        position_rms_um=1e6 * rms(q - record.column("q")),
        force_percent=100.0 * rms(force - record.column("force")) / rms(record.column("force")),
    )


def tracking_rms_um(reference: Array, q: Array) -> float:
    """Root mean square of reference minus position [um] once started, both of shape (n,) and in m."""
    return 1e6 * rms((reference - q)[START_UP:])
