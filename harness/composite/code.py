"""The C sources of the parts: taken from their FMUs, each FMU in a folder of its own with its own function prefix."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from lxml import etree

from harness.errors import BuildError
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.storage.zip_file import open_zip, read_zip

_TEXTS: Final = (".c", ".h", ".inc")

WRAPPER: Final = """\
/* The FMU {identifier}, with the function prefix {prefix}, also if the header defines none. */
#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "fmi2Functions.h"
#undef fmi2FullName
#define fmi2FullName(name) {prefix}##name
#include "{file}"
"""


@dataclass(frozen=True)
class PartCode:
    """The sources of an FMU, which several parts may use.

    Parameters
    ----------
    folder : str
        Folder of the sources, which distinguishes this FMU from others in the composite.
    prefix : str
        Prefix of its functions.
    identifier, guid : str
        Model identifier and GUID.
    files : mapping of str to str
        Text of each source file.
    compiled : tuple of str
        The files to compile.
    own : bool
        Whether this project has generated the FMU; warnings of the compiler are errors then.
    """

    folder: str
    prefix: str
    identifier: str
    guid: str
    files: Mapping[str, str]
    compiled: tuple[str, ...]
    own: bool

    @property
    def sources(self) -> dict[str, str]:
        """All files by path, with a wrapper for each compiled one."""
        return self.wrappers | {f"{self.folder}/{name}": text for name, text in self.files.items()}

    @property
    def wrappers(self) -> dict[str, str]:
        """The files to compile: each includes a source file of the FMU."""
        found = {}
        for number, name in enumerate(self.compiled, start=1):
            suffix = f"_{number}" if len(self.compiled) > 1 else ""
            found[f"part_{self.folder}{suffix}.c"] = WRAPPER.format(
                identifier=self.identifier, prefix=self.prefix, file=f"{self.folder}/{name}"
            )
        return found


def part_codes(parts: Mapping[str, Part], name: str) -> dict[str, PartCode]:
    """Return the sources of each part that is an FMU; parts with equal FMUs share them.

    Parameters
    ----------
    parts : mapping of str to Part
        All parts by name.
    name : str
        Model identifier of the composite, with which all prefixes begin.

    Raises
    ------
    BuildError
        If an FMU carries no sources, or needs files beside them.
    """
    codes: dict[str, PartCode] = {}
    for part in parts.values():
        if isinstance(part, FmuPart):
            identifier, guid, files, compiled = _read(part)
            same = (
                code for code in codes.values() if (code.guid, code.files, code.compiled) == (guid, files, compiled)
            )
            taken = {code.folder for code in codes.values()}
            folder = next(
                folder for k in range(len(taken) + 1) if (folder := identifier + f"_{k + 1}" * (k > 0)) not in taken
            )
            codes[part.name] = next(
                same, PartCode(folder, f"{name}_{folder}_", identifier, guid, files, compiled, part.strict)
            )
    return codes


def _read(part: FmuPart) -> tuple[str, str, dict[str, str], tuple[str, ...]]:
    with open_zip(part.path) as archive:
        members = [member for member in archive.namelist() if not member.endswith("/")]
        root = etree.fromstring(
            read_zip(archive, "modelDescription.xml"), etree.XMLParser(resolve_entities=False, no_network=True)
        )
        version = root.get("fmiVersion")
        if version != "2.0":
            raise BuildError(
                f"'{part.name}' is an FMU of FMI {version}, but a composite FMU is made of FMUs of FMI 2.0: export "
                f"{part.path.name} as FMI 2.0"
            )
        simulation = root.find("CoSimulation")
        assert simulation is not None, "the part has checked its archive"
        listed = tuple(str(file.get("name")) for file in simulation.iterfind("SourceFiles/File"))
        _check(part.name, part.path, members, listed)
        try:
            files = {
                member.removeprefix("sources/"): read_zip(archive, member).decode("utf-8")
                for member in sorted(members)
                if member.startswith("sources/") and PurePosixPath(member).suffix in _TEXTS
            }
        except UnicodeDecodeError as error:
            raise BuildError(f"'{part.name}' has a source that is not a text in UTF-8: convert it") from error
        return str(simulation.get("modelIdentifier")), str(root.get("guid")), files, listed


def _check(name: str, path: Path, members: list[str], listed: tuple[str, ...]) -> None:
    absent = next((file for file in listed if f"sources/{file}" not in members), None)
    if absent is not None:
        raise BuildError(f"'{name}' lists the source {absent}, which {path} does not contain: export it again")
    if not listed:
        raise BuildError(
            f"'{name}' carries no sources, so it cannot be compiled into a composite FMU: export {path.name} with "
            "its sources"
        )
    if any(member.startswith("resources/") for member in members):
        raise BuildError(f"'{name}' needs the resources of {path.name}, which a composite FMU does not contain")
    if not all(re.fullmatch(r"[\w./-]+", file) for file in listed):
        raise BuildError(f"'{name}' has a source file with an unusual name: rename it to letters, digits and _")
