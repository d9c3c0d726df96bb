"""Residual of the inverse model on data other than the fitted ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friction_fmus.errors import FrictionError
from friction_fmus.identification import InverseModelFit, Record, filtered_motion
from friction_fmus.identification.fit.idim import default_settings
from friction_fmus.study.records import Fit


def inverse_residual(fit: InverseModelFit, records: Sequence[Record]) -> Fit | None:
    """Return the residual of the drive force of an inverse model, filtered and decimated as in its fit."""
    M, Fv, Fc, OF = (fit.parameters[name].value for name in ("M", "Fv", "Fc", "OF"))
    errors, forces = [], []
    for record in records:
        settings = default_settings(record)
        try:
            settings.require(record)
            motion = filtered_motion(record, settings)
        except FrictionError:
            continue
        predicted = M * motion.a + Fv * motion.v + Fc * np.sign(motion.v) + OF
        rows = np.column_stack([predicted, record.force_at_samples()])
        model, force = settings.rows(rows, record.Ts).T
        errors.append(model - force)
        forces.append(force)
    if not errors:
        return None
    error, size = (float(np.sqrt(np.mean(np.square(np.concatenate(parts))))) for parts in (errors, forces))
    return Fit(error, 100.0 * error / size, "force", records[0].units.force) if size > 0.0 else None
