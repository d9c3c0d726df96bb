"""Targets, one file each: ``some_name.py`` defines ``TARGET``, a `Target` that is called ``some-name``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from friction_fmus.errors import BuildError
from harness.storage.files import atomic_path, make_folder

if TYPE_CHECKING:
    from lxml import etree

    from harness.compiling.platforms import Platform

Compiling = Callable[[str, int], None]  # called before each platform: its name, and the number of those done


@dataclass(frozen=True)
class SourceFmu:
    """An FMI 2.0 FMU with its C files, description, documentation and pictures: a block or a system."""

    identifier: str
    content: bytes
    platforms: Sequence[Platform] = ()
    """For which libraries are wanted."""
    compiling: Compiling | None = None
    complete: Collection[tuple[Platform, ...]] = ()
    """Platforms for which the content has all libraries."""
    quiet: Collection[str] = ()  # C files of other tools, which are compiled without warnings

    @cached_property
    def members(self) -> dict[str, bytes]:
        """The files of the archive."""
        from zipfile import ZipFile

        with ZipFile(BytesIO(self.content)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}

    @cached_property
    def description(self) -> etree._Element:
        """The root of modelDescription.xml."""
        from lxml import etree

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

    def libraries(self, compiled: Callable[[Platform], bytes], platforms: Sequence[Platform]) -> dict[str, bytes]:
        """Return the libraries for platforms by their places in an FMU."""
        found = {}
        for number, platform in enumerate(platforms):
            if self.compiling:
                self.compiling(platform.folder, number)
            found[f"binaries/{platform.folder}/{self.identifier}{platform.suffix}"] = compiled(platform)
        return found


def write_file(content: bytes | str, path: Path) -> None:
    """Write a file completely or not at all, text with line ends ``\\n``, and create its folder if needed."""
    make_folder(path.parent)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


@dataclass(frozen=True)
class Option:
    """An option that only some targets have; without choices or a name of its value, it is either given or not."""

    name: str
    help: str
    choices: tuple[str, ...] = ()
    metavar: str = ""


RATED: Final = Option("rated", "rated force or torque of the motor at the axis, such as '2.4 N.m'", metavar="VALUE")


@dataclass(frozen=True)
class Target:
    """A form in which something is written. Its module must load fast: `write` imports what it needs."""

    summary: str  # what is written, for the help of the command line
    takes: Literal["fmu", "law", "axis", "library"]
    """Of what: of a `SourceFmu`, of the name or file of a law or loop, of an `IdentifiedAxis`, or of all models."""
    write: Callable[..., Any]
    """``write(source, path, **options)`` writes to a path completely or not at all;
    ``write(model, folder, start=..., prefix=..., **options)`` writes a law and returns the paths;
    ``write(axis, folder, **options)`` writes an axis and returns the paths;
    ``write(folder)`` writes a library and returns its path."""
    ending: str = ""  # end of the name of what is written of a `SourceFmu`
    options: tuple[Option, ...] = ()
    platform: str = ""  # platform that stands for this target alone
    remark: Callable[[], str] = str  # returns what a user should know after it was written


DEFAULT: Final = {"fmu": "fmi2", "law": "c"}  # target of what is written without a choice


@cache
def targets(takes: str) -> Mapping[str, Target]:
    """Return the targets that take something, by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    found = {name.replace("_", "-"): importlib.import_module(f"{__name__}.{name}").TARGET for name in names}
    return {name: target for name, target in found.items() if target.takes == takes}


def choose_target(
    takes: str, name: str, options: Mapping[str, Any], platforms: Collection[str] = ()
) -> tuple[Target, dict[str, Any]]:
    """Return the target with a name, or the one for which a platform stands, and its options that are given."""
    known = targets(takes)
    if name not in known:
        raise BuildError(f"there is no target {name!r}: give one of {', '.join(known)}")
    for own, target in known.items():
        if target.platform in platforms:
            makes = f"the platform {target.platform} makes {target.summary}"
            if len(set(platforms)) > 1:
                raise BuildError(f"{makes}, not an FMU: build it without other platforms")
            if name not in (own, DEFAULT[takes]):
                raise BuildError(f"{makes}: build it without {name}")
            name = own
    having = {other: {option.name for option in each.options} for other, each in known.items()}
    for option, value in options.items():
        others = " or ".join(other for other, has in having.items() if option in has)
        if option not in having[name] and (value is not False or not others):
            remedy = f"choose the target {others}, or leave it out" if others else "leave it out"
            raise BuildError(f"the target {name} has no option {option}: {remedy}")
    return known[name], {option: value for option, value in options.items() if option in having[name]}
