"""Parameters of the axis for a drive without a target of its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import IdentifiedAxis


def write(axis: IdentifiedAxis, folder: Path) -> list[Path]:
    """Write the sheet and, if there is one, the table over position."""
    import numpy as np

    from friction_fmus.blocks.catalogue import find
    from friction_fmus.export.axis_fit import AxisFit
    from friction_fmus.export.drive_sheet import Row, Sheet, digits, write_sheet
    from harness.storage.files import atomic_path, make_folder

    fit, u = AxisFit(axis), axis.words
    forward, rd = fit.direction > 0.0, fit.motion.rd
    along = 0.0 if axis.position is None else axis.position.force(fit.motion.r, rd)
    columns = np.column_stack([part * each for each in (fit.direction, rd) for part in (forward, ~forward)])
    known = axis.offset - along
    p = np.array([float(digits(value)) for value in fit.fit(columns, known, (0.0, np.inf))])
    Fc, Fc_back, Fv, Fv_back = p
    rows = [Row(u.mass, digits(axis.mass), u.kg)] if axis.mass else []
    if axis.loop is not None and (fed := axis.loop.whole.start.get("servo.m")):
        rows.append(Row("acceleration feedforward", digits(float(fed)), u.kg, "factor of the reference acceleration"))
    always, sign, speed = "constant", "in the direction of the reference velocity", "factor of the reference velocity"
    rows += [
        Row(f"constant {u.force}", digits(axis.offset), u.N, always),
        Row("Coulomb friction, forward", digits(Fc), u.N, sign),
        Row("Coulomb friction, backward", digits(Fc_back), u.N, sign),
        Row("viscous friction, forward", digits(Fv), u.Ns_m, speed),
        Row("viscous friction, backward", digits(Fv_back), u.Ns_m, speed),
    ]
    notes = ["A direction is held while the reference stands."]
    friction = find(axis.model).about.in_loop.friction
    if friction is not None:
        contact = friction.contact(axis.parameters)
        for name, level in zip(("forward", "backward"), contact.levels, strict=True):
            rows.append(Row(f"static friction, {name}", digits(level.Fs), u.N, "for information"))
        if contact.stiffness:
            rows.append(
                Row("presliding distance", digits(contact.levels[0].Fs / contact.stiffness), u.m, "for information")
            )
    make_folder(folder)
    written = []
    if axis.position is not None:
        table, path = axis.position, folder / "generic-position.csv"
        at = table.grid.begin + table.grid.spacing * np.arange(float(table.grid.nodes))
        forward_force, backward_force = (sign * np.array(table.friction) - table.cogging for sign in (1.0, -1.0))
        heading = f"position [{u.m}],{u.force} forward [{u.N}],{u.force} backward [{u.N}]"
        with atomic_path(path) as temporary:
            both = np.column_stack([at, forward_force, backward_force])
            np.savetxt(temporary, both, "%.6g", ",", header=heading, comments="")
        rows.append(Row(f"{u.force} over position", path.name, u.N, "added at the reference position"))
        written.append(path)
    return write_sheet(Sheet("a drive", rows, columns @ p + known, notes), fit, folder, "generic") + written


TARGET = Target("a sheet with the parameters of the axis", "axis", write)
