"""Universal Robots: scales of the viscous and Coulomb compensation of a joint."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import IdentifiedAxis

MANUAL: Final = (
    "Universal Robots, Script manual 5.25.1, direct_torque",
    "https://www.universal-robots.com/manuals/EN/HTML/SW5_25_1/Content/prod-scriptmanual/all_scripts/direct_torque.htm",
)
DEFAULTS: Final = (0.9, 0.8)  # viscous and Coulomb scale of five of the six joints


def write(axis: IdentifiedAxis, folder: Path) -> list[Path]:
    """Write the sheet."""
    import numpy as np

    from friction_fmus.errors import BuildError
    from friction_fmus.export.axis_fit import AGAINST, AxisFit
    from friction_fmus.export.drive_sheet import Row, lost, text, write_sheet
    from friction_fmus.listings import shown

    if not axis.rotary:
        raise BuildError(
            f"{axis.name} is a linear axis; the joints of Universal Robots are rotary. Choose another target."
        )
    fit = AxisFit(axis)
    own, known = np.column_stack([fit.motion.rd, fit.held]), axis.offset - fit.along
    columns = own * fit.least_squares(own, known, AGAINST)
    scales = np.round(fit.fit(columns, known, (0.0, 1.0)), 2)
    both = zip(("viscous_scale", "coulomb_scale"), scales, strict=True)
    rows = [Row(name, text(scale, 0.01), "", "argument of direct_torque", MANUAL) for name, scale in both]
    notes = [
        "The scales refer to the friction model of the robot, which is not documented: they assume that its Coulomb "
        "and viscous friction are those of the joint. Begin with the defaults of the robot.",
        "The robot compensates gravity. The velocity of the compensation is taken as that of the reference.",
        *lost(axis, {"viscous", "position"}),
    ]
    if axis.loop is not None:
        error = shown(fit.tracking(columns @ DEFAULTS + known), "rad")
        notes.append(
            f"With the defaults of most joints, {DEFAULTS[0]} and {DEFAULTS[1]}, the tracking error is {error}."
        )
    force = columns @ scales + known
    return write_sheet(fit, folder, "universal-robots", "Universal Robots", rows, force, notes)


TARGET = Target("a sheet for a joint of Universal Robots", "axis", write)
