"""FMI 2.0."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from friction_fmus.export.targets import SourceFmu, Target, write_file

if TYPE_CHECKING:
    from harness.compiling.platforms import Platform


def write(source: SourceFmu, path: Path) -> None:
    """Write the FMU with libraries for the platforms."""
    from harness.compiling.platforms import compiled, linked
    from harness.compiling.toolchain import included
    from harness.storage.zip_file import zipped

    def library(platform: Platform) -> bytes:
        if len(source.units) == 1:
            return compiled(platform, source.files, source.identifier)
        units = {unit: included(unit, source.files) for unit in source.units}
        return linked(platform, units, source.identifier, source.quiet)

    content = source.content
    if tuple(source.platforms) not in source.complete:
        made = {name: data for name, data in source.members.items() if not name.startswith("binaries/")}
        content = zipped(made | source.libraries(library, source.platforms), source.made)
    write_file(content, path)


TARGET = Target("an FMI 2.0 FMU", "fmu", write, ".fmu")
