"""FMI 2.0."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import Target

if TYPE_CHECKING:
    from friction_fmus.export.source_fmu import Compiling, SourceFmu
    from harness.compiling.platforms import Platform


def write(source: SourceFmu, path: Path, platforms: Sequence[Platform], compiling: Compiling | None = None) -> None:
    """Write the FMU with libraries for the platforms."""
    from friction_fmus.export.source_fmu import libraries, write_fmu
    from harness.compiling.platforms import compiled, linked
    from harness.compiling.toolchain import included
    from harness.storage.zip_file import zipped

    if tuple(platforms) in source.platforms:
        write_fmu(source.content, path)
        return
    units = {unit: included(unit, source.files) for unit in source.units}

    def library(platform: Platform) -> bytes:
        if len(units) == 1:
            return compiled(platform, source.files, source.identifier)
        return linked(platform, units, source.identifier, source.quiet)

    made = {name: data for name, data in source.members.items() if not name.startswith("binaries/")}
    made |= libraries(source.identifier, platforms, library, compiling)
    write_fmu(zipped(made, source.made), path)


TARGET = Target("an FMU of FMI 2.0", "fmu", write, ".fmu")
