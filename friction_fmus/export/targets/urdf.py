"""A joint in URDF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.identified_axis import IdentifiedAxis


def write(axis: IdentifiedAxis, folder: Path, file: str = "joint.urdf", turning: str = "continuous") -> list[Path]:
    """Write a file; `turning` is the type of a rotary joint in it."""
    from friction_fmus.axis.simulator_joint import coulomb_law, write_form

    return write_form(axis, folder / file, coulomb_law(axis), turning if axis.rotary else "prismatic")


TARGET = Target("a joint in URDF", "axis", write)
