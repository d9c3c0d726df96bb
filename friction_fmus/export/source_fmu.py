"""An FMU of FMI 2.0 with its C files: what targets make of a block or a system."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

from lxml import etree

from harness.compiling.platforms import Platform
from harness.storage.files import atomic_path, make_folder

Compiling = Callable[[str, int], None]
"""Called before each platform is compiled, with its name and the number of completed platforms."""


@dataclass(frozen=True)
class SourceFmu:
    """The FMU, with description, documentation and pictures."""

    identifier: str
    content: bytes
    platforms: Collection[tuple[Platform, ...]] = ()
    """For which its libraries are complete."""
    quiet: Collection[str] = ()
    """C files of other tools, which are compiled without warnings."""

    @cached_property
    def members(self) -> dict[str, bytes]:
        """The files of the archive."""
        with ZipFile(BytesIO(self.content)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}

    @cached_property
    def description(self) -> etree._Element:
        """The root of modelDescription.xml."""
        return etree.fromstring(self.members["modelDescription.xml"])

    @property
    def made(self) -> str:
        """The time at which it was made."""
        return str(self.description.get("generationDateAndTime"))

    @property
    def units(self) -> tuple[str, ...]:
        """The C files to compile."""
        return tuple(str(file.get("name")) for file in self.description.iterfind("CoSimulation/SourceFiles/File"))

    @cached_property
    def files(self) -> dict[str, str]:
        """The text of each C file."""
        found = {name: data for name, data in self.members.items() if name.startswith("sources/")}
        return {name.removeprefix("sources/"): data.decode() for name, data in found.items()}


def libraries(
    identifier: str,
    platforms: Sequence[Platform],
    compile_for: Callable[[Platform], bytes],
    compiling: Compiling | None,
) -> dict[str, bytes]:
    """Return the libraries of an FMU by their places in its archive."""
    found = {}
    for number, platform in enumerate(platforms):
        if compiling:
            compiling(platform.folder, number)
        found[f"binaries/{platform.folder}/{identifier}{platform.suffix}"] = compile_for(platform)
    return found


def write_fmu(content: bytes, path: Path) -> None:
    """Write an FMU completely or not at all, and create its folder if needed."""
    make_folder(path.parent)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
