"""Findings about a drive force that contradicts the motion: wrong sign, wrong unit, or no inertia force.

The force is fitted by F = M a + Fv v + Fc sgn(v) + OF, linear least squares without bounds, so that a wrong sign shows
as a negative mass and as friction that drives the axis. Identified masses do not show it: they are positive.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from friction_fmus.identification.data.findings import Finding
from friction_fmus.identification.data.record import Record
from friction_fmus.identification.errors import RecordError
from friction_fmus.identification.fit.models import contact_model
from friction_fmus.identification.fit.scores import independent_samples
from friction_fmus.identification.fit.simulation_data import prepare

MASSES: Final[Mapping[str, tuple[float, float]]] = {"m": (1e-6, 1e7), "rad": (1e-10, 1e7)}
"""Smallest and largest mass [kg] or moment of inertia [kg.m2] of a machine, by unit of the position."""

FORBIDDING: Final = ("wrong-sign", "negative-mass", "driving-friction", "implausible-mass")
"""Findings after which identified parameters cannot be used."""

SIGNIFICANT: Final = 3.0
"""Number of standard errors by which a mass must differ from zero."""

DRIVING: Final = 0.02
"""Power of friction that drives the axis, over the mean power of the force, above which the sign is wrong."""


@dataclass(frozen=True)
class DriveBalance:
    """Least squares of the drive force.

    Attributes
    ----------
    mass, error : float
        Mass and its standard error [kg or kg.m2].
    dissipated : float
        Mean power of viscous and Coulomb friction over the mean magnitude of the power of the force without offset;
        negative if friction drives the axis.
    """

    mass: float
    error: float
    dissipated: float


def drive_balance(records: Sequence[Record]) -> DriveBalance | None:
    """Fit mass and friction to the drive force of some records.

    Parameters
    ----------
    records : sequence of Record
        Motion and drive force.

    Returns
    -------
    DriveBalance or None
        None if a record has no drive force, has a measured friction force, or is too short for the filter.
    """
    rows, forces = [], []
    for record in records:
        if record.force is None or record.friction is not None:
            return None
        try:
            segment = prepare(record, contact_model("Viscous", record.units), "force")
        except RecordError:
            return None
        assert segment.a is not None
        v = segment.inputs["v"]
        rows.append(segment.rows(np.column_stack([segment.a, v, np.sign(v), np.ones_like(v)])))
        forces.append(segment.measured)
    A, F = np.concatenate(rows), np.concatenate(forces)
    length = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    theta = np.linalg.lstsq(A / length, F, rcond=None)[0] / length
    rest = F - A @ theta
    inverse = np.linalg.pinv((A / length).T @ (A / length)) / np.outer(length, length)
    samples = max(independent_samples([rest]) - 4.0, 1.0)
    v = A[:, 1]
    power = float(np.mean(np.abs((F - theta[3]) * v)))
    friction = float(np.mean((theta[1] * v + theta[2] * A[:, 2]) * v))
    error = float(np.sqrt(max(inverse[0, 0], 0.0) * float(rest @ rest) / samples))
    return DriveBalance(float(theta[0]), error, friction / power if power else 0.0)


def contradictions(records: Sequence[Record]) -> tuple[Finding, ...]:
    """Return findings about a drive force that no mass with friction can need for the measured motion.

    Parameters
    ----------
    records : sequence of Record
        Motion and drive force; records without a drive force give no findings.

    Returns
    -------
    tuple of Finding
        At most one of `FORBIDDING` or ``mass-not-identified``.
    """
    balance = drive_balance(records)
    if balance is None:
        return ()
    units = records[0].units
    low, high = MASSES[units.position]
    shown = f"{balance.mass:.3g} ± {balance.error:.2g} {units.inertia}"
    negative = balance.mass < -SIGNIFICANT * balance.error
    driving = balance.dissipated < -DRIVING
    if negative and driving:
        what = f"The drive force has the wrong sign: it fits a mass of {shown}, and friction that drives the axis."
        return (Finding("wrong-sign", what, "Set sign = -1 for the force in [columns]."),)
    if negative:
        what = f"The drive force fits a mass of {shown}, which is negative."
        change = (
            "Check units and times of force and position; a spring or a load that depends on position does the same."
        )
        return (Finding("negative-mass", what, change),)
    if driving:
        what = (
            f"Friction would drive the axis: its power is {100.0 * balance.dissipated:.3g} % of the power of the drive."
        )
        change = "Check the sign of the force, and that force and position are logged in the same sample."
        return (Finding("driving-friction", what, change),)
    if abs(balance.mass) < SIGNIFICANT * balance.error:
        what = f"The record does not determine the mass ({shown})."
        return (Finding("mass-not-identified", what, "Record faster motion, or give the mass."),)
    if not low <= balance.mass <= high:
        what = f"The drive force fits a mass of {shown}; machines have {low:g} to {high:g} {units.inertia}."
        return (Finding("implausible-mass", what, "Correct the unit of the force or of the position."),)
    return ()
