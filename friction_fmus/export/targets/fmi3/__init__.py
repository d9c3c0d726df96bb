"""FMI 3.0, made from FMI 2.0 with its sources; the numbers are the same."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import Option, Target

if TYPE_CHECKING:
    from friction_fmus.export.source_fmu import Compiling, SourceFmu
    from harness.compiling.platforms import Platform


def write(
    source: SourceFmu,
    path: Path,
    platforms: Sequence[Platform],
    compiling: Compiling | None = None,
    *,
    clocks: bool = False,
    arrays: bool = False,
) -> None:
    """Write the FMU with libraries for the platforms."""
    from friction_fmus.export.source_fmu import write_fmu
    from friction_fmus.export.targets.fmi3.fmi3_archive import fmi_3

    write_fmu(fmi_3(source, platforms, compiling, clocks=clocks, arrays=arrays), path)


TARGET = Target(
    "an FMU of FMI 3.0",
    "fmu",
    write,
    ".fmu",
    (
        Option("clocks", "FMI 3.0: sampled blocks have a clock"),
        Option("arrays", "FMI 3.0: vectors are arrays"),
    ),
)
