"""Parameters of an axis for a drive without a target of its own."""

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
    from friction_fmus.export.axis_fit import AGAINST, AxisFit
    from friction_fmus.export.drive_sheet import Row, lost, text, write_sheet
    from harness.storage.files import atomic_path, make_folder

    fit, u, written = AxisFit(axis), axis.words, []
    columns = np.column_stack([fit.coulomb, np.abs(fit.coulomb) * fit.motion.rd[:, None]])
    known = axis.offset - fit.along
    p = np.array([float(text(value)) for value in fit.fit(columns, known, AGAINST)])
    fed = None if axis.loop is None else axis.loop.whole.start.get("servo.m")
    rows = [Row(f"moved {u.mass}", text(axis.mass), u.kg, "")] if axis.mass else []
    rows += [Row("acceleration feedforward", text(float(fed)), u.kg, "times the reference acceleration")] if fed else []
    rows.append(Row(f"constant {u.force}", text(axis.offset), u.N, "always"))
    sides, speed = ("forward", "backward"), "times the reference velocity"
    for i, side in enumerate(sides):
        rows.append(Row(f"Coulomb friction {side}", text(p[i]), u.N, "in the direction of the reference velocity"))
        rows.append(Row(f"viscous friction {side}", text(p[2 + i]), u.Ns_m, speed))
    friction = find(axis.model).about.friction
    if friction is not None:
        contact = friction.contact(axis.parameters)
        for side, level in zip(sides, contact.levels, strict=True):
            if level.Fs > level.Fc:
                rows.append(Row(f"static friction {side}", text(level.Fs), u.N, "for information"))
        if contact.stiffness:
            distance = text(contact.levels[0].Fs / contact.stiffness)
            rows.append(Row("presliding displacement", distance, u.m, "for information"))
    if axis.position is not None:
        make_folder(folder)
        table, path = axis.position, folder / "generic-position.csv"
        at = table.grid.begin + table.grid.spacing * np.arange(float(table.grid.nodes))
        both = [sign * np.array(table.friction) - table.cogging for sign in (1.0, -1.0)]
        heading = f"position [{u.m}],{u.force} forward [{u.N}],{u.force} backward [{u.N}]"
        with atomic_path(path) as temporary:
            np.savetxt(temporary, np.column_stack([at, *both]), "%.6g", ",", header=heading, comments="")
        rows.append(Row(f"{u.force} over position", path.name, u.N, "at the reference position"))
        written.append(path)
    notes = ["A direction is held while the reference stands.", *lost(axis, {"viscous", "position"})]
    return write_sheet(fit, folder, "generic", "a drive", rows, columns @ p + known, notes) + written


TARGET = Target("a sheet with the parameters of an axis", "axis", write)
