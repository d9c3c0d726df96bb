"""The C sources of the parts: taken from their FMUs, each FMU in a folder of its own with its own function prefix."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Final

from lxml import etree

from harness.compiling.platforms import Platform, assembly
from harness.compiling.toolchain import included
from harness.errors import BuildError
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.storage.zip_file import open_zip, read_zip

_TEXTS: Final = (".c", ".h", ".inc")

WRAPPER: Final = """\
/* The FMU {identifier}, with the function prefix {prefix}, also if the header defines none. */
{renames}#undef FMI2_OVERRIDE_FUNCTION_PREFIX
#include "fmi2Functions.h"
#undef fmi2FullName
#define fmi2FullName(name) {prefix}##name
#include "{file}"
"""

_WRITABLE: Final = re.compile(
    r'^\s*\.(?:data|bss|comm|lcomm|zerofill|section\s+"?(?:\.data(?!\.rel\.ro)|\.bss|\.tbss|\.tls|__DATA,__(?!const)))\b',
    re.M,
)
"""Assembly of data that a program can change."""


@dataclass(frozen=True)
class PartCode:
    """The sources of an FMU, which several parts may use."""

    folder: str
    """Folder of the sources, which distinguishes this FMU from others in the composite."""
    prefix: str
    """Prefix of its functions."""
    identifier: str
    guid: str
    """Model identifier and GUID."""
    files: Mapping[str, str]
    """Text of each source file."""
    compiled: tuple[str, ...]
    """The files to compile."""
    own: bool
    """Whether this project has generated the FMU; warnings of the compiler are errors then."""
    single: bool
    """Whether each part needs its own copy of the code, because the FMU keeps data outside of its instances."""
    symbols: tuple[str, ...] = ()
    """Symbols that get the prefix, as other parts may define symbols of the same name."""

    @property
    def sources(self) -> dict[str, str]:
        """All files by path, with a wrapper for each compiled one."""
        return self.wrappers | {f"{self.folder}/{name}": text for name, text in self.files.items()}

    @property
    def wrappers(self) -> dict[str, str]:
        """The files to compile: each includes a source file of the FMU."""
        found = {}
        renames = "".join(f"#define {symbol} {self.prefix}{symbol}\n" for symbol in self.symbols)
        for number, name in enumerate(self.compiled, start=1):
            suffix = f"_{number}" if len(self.compiled) > 1 else ""
            found[f"part_{self.folder}{suffix}.c"] = WRAPPER.format(
                identifier=self.identifier, prefix=self.prefix, file=f"{self.folder}/{name}", renames=renames
            )
        return found


def part_codes(parts: Mapping[str, Part], name: str, platforms: Sequence[Platform]) -> dict[str, PartCode]:
    """Return the sources of each part that is an FMU; parts with equal FMUs share them if they can."""
    codes: dict[str, PartCode] = {}
    given_of: dict[Path, tuple[str, str, dict[str, str], tuple[str, ...], bool, bool]] = {}
    owners: dict[str, tuple[str, str]] = {}
    for part in parts.values():
        if isinstance(part, FmuPart):
            given = given_of.get(part.path) or given_of.setdefault(part.path, _read(part))
            same = (each for each in codes.values() if (each.guid, each.files, each.compiled) == given[1:4])
            code = next(same, None)
            if code is None or code.single:
                taken = {each.folder for each in codes.values()}
                folder = next(
                    folder for k in range(len(taken) + 1) if (folder := given[0] + f"_{k + 1}" * (k > 0)) not in taken
                )
                code = PartCode(folder, f"{name}_{folder}_", *given)
                if not (code.own and len(code.compiled) == 1):  # a block of this project has only functions of FMI
                    code = _apart(code, part.name, platforms, owners)
            codes[part.name] = code
    return codes


def _apart(code: PartCode, part: str, platforms: Sequence[Platform], owners: dict[str, tuple[str, str]]) -> PartCode:
    """Return the code with a prefix for each symbol that other code could define as well.

    The linker takes one of two weak or common symbols without a message, and the parts then share it.
    """
    targets = dict.fromkeys((None, *(target for platform in platforms for target in platform.targets)))
    symbols, writes = _defined(code, part, targets)
    code = replace(code, symbols=tuple(sorted(symbols)), single=code.single or writes)
    for symbol in sorted(_defined(code, part, targets)[0] | {f"{code.prefix}{each}" for each in symbols}):
        known = not symbol.startswith("__") or any(symbol in text for text in code.files.values())
        other, folder = owners.setdefault(symbol, (part, code.folder))
        if known and folder != code.folder:
            raise BuildError(
                f"'{other}' and '{part}' both define the symbol {symbol}, so that they would share it: declare it "
                "static or rename it in the sources of one of them"
            )
    return code


def _defined(code: PartCode, part: str, targets: Iterable[str | None]) -> tuple[set[str], bool]:
    """Return the symbols without prefix that other files can see, and whether the code keeps data in static memory."""
    symbols, writes = set[str](), False
    files = code.sources
    for target in targets:
        for unit in code.wrappers:
            try:
                text = assembly(target, unit, included(unit, files))
            except BuildError as error:
                machine = f" for {target}" if target else ""
                raise BuildError(f"the FMU of '{part}' cannot be a part of a composite{machine}: {error}") from error
            symbols |= _symbols(text, "macos" in (target or sys.platform.replace("darwin", "macos")))
            writes = writes or _WRITABLE.search(text) is not None
    return {symbol for symbol in symbols if not symbol.startswith(code.prefix)}, writes


def _symbols(text: str, underscores: bool) -> set[str]:
    """Return the symbols that assembly defines and other files can see."""
    name = r'"?([^\s",#;@]+)'
    seen = set(re.findall(rf"^\s*\.(?:globl|weak|comm)\s+{name}", text, re.M))
    local = set(re.findall(rf"^\s*\.local\s+{name}", text, re.M))
    placed = set(re.findall(rf'^{name}"?:', text, re.M))
    placed |= set(re.findall(rf"^\s*\.(?:comm\s+|zerofill\s+[^,]+,[^,]+,){name}", text, re.M))
    found = (symbol.removeprefix("_") if underscores else symbol for symbol in seen & placed - local)
    return {symbol for symbol in found if symbol.replace("$", "_").isidentifier()}


def _read(part: FmuPart) -> tuple[str, str, dict[str, str], tuple[str, ...], bool, bool]:
    """Return identifier, GUID, sources, the files to compile, and whether the FMU is ours and used once only."""
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
        once = simulation.get("canBeInstantiatedOnlyOncePerProcess") in ("true", "1")
        return str(simulation.get("modelIdentifier")), str(root.get("guid")), files, listed, part.strict, once


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
