"""The identified axis as one FMU: the machine alone, and with servo and compensator."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from friction_fmus.study.records import WrittenFile
from harness import System
from harness.system.wire import split_name

MACHINE: Final = ("axis", "friction", "position")
"""Parts of the machine."""


def export_composites(folder: Path, whole: System) -> tuple[WrittenFile, ...]:
    """Write ``axis.fmu`` and ``servo_axis.fmu``, which solve the loop of mass and friction inside."""
    parts = [part for name, part in whole.parts.items() if name in MACHINE]
    wires = [wire for wire in whole.wires if {end[0] for end in wire.ends} <= set(MACHINE)]
    start = {name: value for name, value in whole.start.items() if split_name(name)[0] in MACHINE}
    machine = System(parts, wires, {**start, "axis.F_drive": 0.0}, whole.experiment, "axis")
    machine.to_fmu(folder / "axis.fmu", inputs=["axis.F_drive"])
    references = sorted({wire.source for wire in whole.wires if split_name(wire.source)[0] == "reference"})
    whole.to_fmu(folder / "servo_axis.fmu", inputs=references)
    inputs = ", ".join(f"`{name}`" for name in references)
    return (
        WrittenFile(
            f"{folder.name}/axis.fmu",
            "The axis with the identified friction as one FMU for any simulator at any step; connect the drive to "
            "`axis.F_drive`",
        ),
        WrittenFile(
            f"{folder.name}/servo_axis.fmu",
            f"The same with servo and compensator; connect the reference to {inputs}",
        ),
    )
