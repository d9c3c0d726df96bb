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
    from friction_fmus.export.drive_sheet import Row, in_percent, lost, text, write_sheet

    fit, opposite = AxisFit(axis), "All values are added to the command: the one of the negative direction is negative."
    forward, backward = fit.fit(fit.coulomb, axis.offset, AGAINST)
    forces = dict(zip((one for one, _ in NAMES), (axis.offset, forward, -backward), strict=True))
    values, p, note = in_percent(axis, rated, forces, 1.0)
    both = list(zip(NAMES, (text(value, 1.0) for value in values), strict=True))
    rows = [Row(one, value, "%", "MINAS", PANASONIC) for (one, _), value in both]
    rows += [Row(other, value, "%", "Omron G5", OMRON) for (_, other), value in both]
    notes = [note, opposite, "A direction is held until the next command direction.", *lost(axis)]
    force = p[0] + fit.coulomb @ [p[1], -p[2]]
    return write_sheet(fit, folder, "minas", "Panasonic MINAS A5 and A6, Omron G5", rows, force, notes)


TARGET = Target("a sheet for Panasonic MINAS A5 and A6, and Omron G5", "axis", write, options=(RATED,))
