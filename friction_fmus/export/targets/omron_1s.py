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


def write(axis: IdentifiedAxis, folder: Path, rated: str = "") -> list[Path]:
    """Write the sheet."""
    import numpy as np

    from friction_fmus.export.axis_fit import AGAINST, AxisFit
    from friction_fmus.export.drive_sheet import Row, Sheet, Source, lost, rated_force, rounded, text, write_sheet

    fit, percent, u = AxisFit(axis), rated_force(axis, rated) / 100.0, axis.words
    columns = np.column_stack([fit.coulomb, fit.motion.rd])
    forward, backward, viscous = fit.fit(columns, axis.offset, AGAINST)
    names = "02 Unbalanced Load Compensation", "03 Positive Dynamic Friction", "04 Negative Dynamic Friction"
    values = axis.offset, forward, -backward
    p = [rounded(force / percent, 0.1, -100.0, 100.0, each) for force, each in zip(values, names, strict=True)]
    viscous, source, where = float(text(viscous)), Source(*MANUAL), "object 3310 hex, Torque Compensation"
    rows = [Row("01 Viscous Friction Coefficient", text(viscous), u.Ns_m, where, source)]
    rows += [Row(name, text(value, 0.1), "%", where, source) for name, value in zip(names, p, strict=True)]
    force = percent * (p[0] + fit.coulomb @ [p[1], -p[2]]) + viscous * fit.motion.rd
    notes = [
        f"Percent of the rated {u.force}, {100.0 * percent:.4g} {u.N} at the axis.",
        "Units and ranges of the object are on p. 9-43 of the manual: convert to them. A torque of the negative "
        "direction is negative here.",
        "The viscous coefficient acts in two-degree-of-freedom control only. Its value is that of the axis: times "
        "(way per radian of the motor)^2 for a motor behind a gear or screw.",
        "Load Characteristic Estimation (3B80 hex) must not update these values.",
        *lost(axis, {"viscous"}),
    ]
    return write_sheet(Sheet("Omron 1S", rows, force, notes), fit, folder, "omron-1s")


TARGET = Target("a sheet for Omron 1S", "axis", write, options=(RATED,))
