"""Omron 1S: viscous friction, unbalanced load, and dynamic friction of each direction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import RATED, Target

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import IdentifiedAxis

MANUAL = (
    "Omron, 1S series with EtherCAT, User's Manual I586, Friction Torque Compensation, p. 11-26",
    "https://www.easymanua.ls/omron/r88d-1sn08h-ect/manual?p=726",
)
NAMES = (
    "02 Unbalanced Load Compensation",
    "03 Positive Dynamic Friction Compensation",
    "04 Negative Dynamic Friction Compensation",
)


def write(axis: IdentifiedAxis, folder: Path, rated: str = "") -> list[Path]:
    """Write the sheet."""
    import numpy as np

    from friction_fmus.export.axis_fit import AGAINST, AxisFit
    from friction_fmus.export.drive_sheet import Row, in_percent, lost, text, write_sheet

    fit, where = AxisFit(axis), "object 3310 hex, Torque Compensation"
    forward, backward, Fv = fit.fit(np.column_stack([fit.coulomb, fit.motion.rd]), axis.offset, AGAINST)
    Fv = float(text(Fv))
    values, p, note = in_percent(axis, rated, dict(zip(NAMES, (axis.offset, forward, -backward), strict=True)), 0.1)
    rows = [Row("01 Viscous Friction Coefficient", text(Fv), axis.words.Ns_m, where, MANUAL)]
    rows += [Row(name, text(value, 0.1), "%", where, MANUAL) for name, value in zip(NAMES, values, strict=True)]
    notes = [
        f"{note} That of the negative direction is negative here.",
        "The manual has the units of the object on p. 9-43: convert the values to them, and the viscous coefficient to "
        "the shaft of the motor. It acts in two-degree-of-freedom control only.",
        "Load Characteristic Estimation (3B80 hex) must not update the values.",
        *lost(axis, {"viscous"}),
    ]
    force = p[0] + fit.coulomb @ [p[1], -p[2]] + Fv * fit.motion.rd
    return write_sheet(fit, folder, "omron-1s", "Omron 1S", rows, force, notes)


TARGET = Target("a sheet for Omron 1S", "axis", write, options=(RATED,))
