"""Panasonic MINAS A5 and A6, and Omron G5 with the same function: a torque for each direction of the command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import RATED, Target

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import IdentifiedAxis

PANASONIC = (
    "Panasonic, MINAS A5 series, Operating Instructions, Friction torque compensation, p. 5-351",
    "https://manualarchiveguide.com/manuals/Panasonic-MINAS-A5-series-Operating-Instructions-Manual-5431344?page=265",
)
OMRON = (
    "Omron, OMNUC G5 series with EtherCAT, User's Manual, Friction Torque Compensation Function, p. 11-27",
    "https://easymanua.ls/omron/r88d-kn20f-ect-r/manual?p=414",
)
NAMES = (
    ("Pr6.07 torque command additional value", "3607 hex Torque Command Value Offset"),
    ("Pr6.08 positive direction torque compensation value", "3608 hex Forward Direction Torque Offset"),
    ("Pr6.09 negative direction torque compensation value", "3609 hex Reverse Direction Torque Offset"),
)


def write(axis: IdentifiedAxis, folder: Path, rated: str = "") -> list[Path]:
    """Write the sheet."""
    from friction_fmus.export.axis_fit import AGAINST, AxisFit
    from friction_fmus.export.drive_sheet import Row, Sheet, Source, lost, rated_force, rounded, text, write_sheet

    fit, percent, u = AxisFit(axis), rated_force(axis, rated) / 100.0, axis.words
    forward, backward = fit.fit(fit.coulomb, axis.offset, AGAINST)
    rows, p = [], []
    for force, (one, other) in zip((axis.offset, forward, -backward), NAMES, strict=True):
        p.append(rounded(force / percent, 1.0, -100.0, 100.0, one))
        rows.append(Row(one, text(p[-1], 1.0), "%", "MINAS", Source(*PANASONIC)))
        rows.append(Row(other, text(p[-1], 1.0), "%", "Omron G5", Source(*OMRON)))
    force = percent * (p[0] + fit.coulomb @ [p[1], -p[2]])
    notes = [
        f"Percent of the rated {u.force}, {100.0 * percent:.4g} {u.N} at the axis.",
        "All values are added to the torque command, so that the one of the negative direction is negative.",
        "A direction is held until the next command direction.",
        *lost(axis),
    ]
    return write_sheet(Sheet("Panasonic MINAS A5 and A6, Omron G5", rows, force, notes), fit, folder, "minas")


TARGET = Target("a sheet for Panasonic MINAS A5 and A6, and Omron G5", "axis", write, options=(RATED,))
