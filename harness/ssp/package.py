"""The .ssp archive (SSP 1.0, chapter 3)."""

from __future__ import annotations

import io
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from types import MappingProxyType, TracebackType
from typing import Final, Self
from urllib.parse import unquote, urlsplit

import fmpy
from lxml import etree

from harness.errors import SystemFileError, UnitError
from harness.storage.files import ScratchFolder, atomic_path, make_folder
from harness.storage.zip_file import (
    ZipError,
    find_outside,
    is_bomb,
    open_file,
    open_unchecked,
    open_zip,
    read_zip,
    size_of,
    unpacked_size,
)
from harness.units import BASE_SYMBOLS, LONGEST_UNIT, BaseUnit, conversion, parse_unit, stated_unit

SSD: Final = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC: Final = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV: Final = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM: Final = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"

# libcosim and ecos expect exactly these prefixes instead of the namespaces
SPACES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "ssd": SSD,
        "ssc": SSC,
        "ssv": SSV,
        "ssm": SSM,
        "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
        "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
        "harness": "urn:friction-fmus:harness",
    }
)

#: Element with the size of one dimension of an array, in SSP 2.0.
DIMENSION: Final = f"{{{SSC}}}Dimension"

#: Generating tool stated in written files.
TOOL: Final = "harness"

_ROOTS: Final = MappingProxyType({SSD: "SystemStructureDescription", SSV: "ParameterSet", SSM: "ParameterMapping"})
#: Folder of the schemas by version.
_FOLDERS: Final = MappingProxyType(
    {"1.0": Path(fmpy.__file__).parent / "ssp" / "schema", "2.0": Path(__file__).parent / "schema"}
)


def parse_document(data: bytes, space: str, where: str) -> etree._Element:
    """Parse and validate a document."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        raise SystemFileError(f"{where} is not XML: {' '.join(error.msg.split())}; export it again") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise SystemFileError(f"{where} has a DOCTYPE with its own definitions: remove it")
    return check_element(root, space, where)


def check_element(element: etree._Element, space: str, where: str) -> etree._Element:
    """Validate an element inside another document; see `parse_document`."""
    expected = f"{{{space}}}{_ROOTS[space]}"
    if element.tag != expected:
        raise SystemFileError(f"{where} starts with {element.tag}: give one that starts with {expected}")
    version = element.get("version", "")
    known = next((folder for folder in _FOLDERS if version.startswith(folder[:2])), None)
    if version and known is None:
        raise SystemFileError(f"{where} is of version {version}: export it as SSP 1.0 or 2.0")
    known = known or "1.0"
    try:
        _schema(space, known).assertValid(element)
    except etree.DocumentInvalid as error:
        reason = " ".join(str(error).split())
        raise SystemFileError(f"{where} is not valid SSP {known}: {reason}; correct it there") from error
    return element


def sub(parent: etree._Element, tag: str, **attributes: str | None) -> etree._Element:
    """Append an element ``prefix:name``; attributes that are None are omitted."""
    prefix, name = tag.split(":")
    element = etree.SubElement(parent, f"{{{SPACES[prefix]}}}{name}")
    for key, value in attributes.items():
        if value is not None:
            set_text(element, key, value)
    return element


def set_text(element: etree._Element, key: str, value: str) -> None:
    """Set an attribute; see `sub`."""
    try:
        element.set(key, value)
    except ValueError as error:
        raise SystemFileError(f"the text {value!r} cannot be written to XML: remove its control characters") from error


def to_bytes(root: etree._Element) -> bytes:
    """Return the document as UTF-8; the same content gives the same bytes."""
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


@cache
def _schema(space: str, version: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(_FOLDERS[version] / f"{PurePosixPath(space).name}.xsd"))


#: Member that describes the system.
SSD_NAME: Final = "SystemStructure.ssd"


class Package:
    """An archive opened for reading."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._archive = open_file("SSP", path, SystemFileError)
        self._size = size_of(self._archive)
        self._unpacked: dict[str, int] = {}
        if SSD_NAME not in self._archive.namelist():
            self._archive.close()
            raise SystemFileError(f"{path} is not an SSP: it has no {SSD_NAME}; export it again")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._archive.close()

    def read(self, member: str, where: str) -> bytes:
        """Return the content of a member."""
        return _read(self._archive, member, where)

    def referenced(self, element: etree._Element, component: etree._Element | None, where: str) -> tuple[bytes, str]:
        """Return content and name of the file in the attribute ``source`` of an element."""
        source = member_name(element.get("source"), where)
        if element.get("sourceBase", "SSD") == "SSD":
            return self.read(source, where), f"{source} in {self.path}"
        if component is None:
            raise SystemFileError(f"{where} names a file in a component but belongs to a system: move the file")
        fmu = self._read_fmu(member_name(component.get("source"), where), where)
        try:
            with open_zip(io.BytesIO(fmu), self._size) as archive:
                return _read(archive, source, where), f"{source} in an FMU of {self.path}"
        except ZipError as fault:
            raise SystemFileError(f"{where} names a file in an FMU, but {fault}") from fault

    def _read_fmu(self, member: str, where: str) -> bytes:
        """Return the content of an FMU; the unpacked size of all FMUs has the same limit as the SSP itself."""
        data = self.read(member, where)
        try:
            with open_unchecked(io.BytesIO(data)) as archive:
                self._unpacked[member] = unpacked_size(archive.infolist())
        except ZipError:
            return data  # opening it will report the error
        total = sum(self._unpacked.values())
        if is_bomb(total, self._size):
            raise SystemFileError(
                f"the FMUs in the {self._size} bytes of {self.path} unpack to {total} or more; do not use this file"
            )
        return data

    def unpack(self, member: str, folder: Path, where: str) -> Path:
        """Write a member to its path below a folder and return the resulting path."""
        data, target = self._read_fmu(member, where), folder / member
        make_folder(target.parent)
        with atomic_path(target) as temporary:
            temporary.write_bytes(data)
        return target


class TemporaryFolder:
    """A folder that is removed with the last reference to this object."""

    def __init__(self) -> None:
        folder = ScratchFolder()
        self.path = Path(folder.name)
        weakref.finalize(self, folder.cleanup)


def member_name(source: str | None, where: str) -> str:
    """Return the member of the archive that a relative URI names."""
    parts = urlsplit(source or "")
    name = str(PurePosixPath(unquote(parts.path)))
    if parts.scheme or parts.netloc or parts.query or parts.fragment or not parts.path or find_outside([name]):
        raise SystemFileError(f"{where} names '{source}', which is not a file in the archive: add the file to it")
    return name


def write_package(path: Path, members: dict[str, bytes | Path]) -> None:
    """Write an archive; the same members give the same bytes."""
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in members.items():
            entry = zipfile.ZipInfo(name)  # dated 1980, for identical bytes
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            # an FMU is already compressed
            entry.compress_type = zipfile.ZIP_STORED if isinstance(content, Path) else zipfile.ZIP_DEFLATED
            archive.writestr(entry, content.read_bytes() if isinstance(content, Path) else content)


def _read(archive: zipfile.ZipFile, member: str, where: str) -> bytes:
    try:
        return read_zip(archive, member)
    except KeyError as error:
        raise SystemFileError(f"{where} names '{member}', which is not in the archive: add the file to it") from error
    except ZipError as fault:
        raise SystemFileError(f"cannot read what {where} names: {fault}") from fault


def read_units(root: etree._Element, tag: str) -> dict[str, BaseUnit]:
    """Return the units that a document defines in its element ``tag`` (``ssd:Units`` or ``ssv:Units``), by name."""
    units = {}
    for unit in root.iterfind(f"{tag}/ssc:Unit", SPACES):
        base = unit.find("ssc:BaseUnit", SPACES)
        assert base is not None  # the document is valid
        try:
            exponents = [int(base.get(symbol, "0")) for symbol in BASE_SYMBOLS]
            stated = stated_unit(exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
        except ValueError as error:
            name = unit.get("name", "")[:LONGEST_UNIT]
            raise UnitError(f"the unit '{name}' is malformed ({error}): correct it in {tag}") from error
        units[unit.get("name", "")] = stated
    return units


def write_units(parent: etree._Element, tag: str, units: Mapping[str, BaseUnit]) -> None:
    """Append the element ``tag`` with these units, sorted by name, unless there are none."""
    if not units:
        return
    element = sub(parent, tag)
    for name, unit in sorted(units.items()):
        powers = {symbol: str(power) for symbol, power in zip(BASE_SYMBOLS, unit.exponents, strict=True) if power}
        base = sub(sub(element, "ssc:Unit", name=name), "ssc:BaseUnit", **powers)
        if unit.factor != 1.0:
            base.set("factor", repr(unit.factor))
        if unit.offset != 0.0:
            base.set("offset", repr(unit.offset))


def known_unit(name: str | None, base: BaseUnit | None) -> BaseUnit | None:
    """Return the unit with this name, as defined or else derived from the name; None if it is unknown."""
    return base or (None if name is None else parse_unit(name))


def converted(source: BaseUnit, target: BaseUnit, where: str) -> tuple[float, float]:
    """Return factor and offset that convert a number from one unit to another."""
    numbers = conversion(source, target)
    if numbers is None:
        raise UnitError(
            f"{where} joins [{source}] and [{target}], which measure different quantities: correct the units"
        )
    return numbers


@dataclass(frozen=True)
class Signal:
    """A value along a chain of connections: gain * (source value in the current unit) + offset."""

    source: BaseUnit | None  # the first known unit of the chain
    unit: BaseUnit | None  # the current unit
    gain: float = 1.0  # factor of the connections so far, without unit conversion
    offset: float = 0.0  # their offset

    def passed(self, unit: BaseUnit | None, factor: float, offset: float, suppress: bool, where: str) -> Signal:
        """Return the signal after a connection: first converted, then transformed, as SSP 1.0 requires."""
        gain, rest = self.gain, self.offset
        if self.unit is not None and unit is not None:
            k, c = converted(self.unit, unit, where)
            if suppress:
                gain, rest = gain / k, rest - gain * c / k
            else:
                rest = k * rest + c * (1.0 - gain)
        return Signal(self.source or unit, unit or self.unit, factor * gain, factor * rest + offset)

    def number(self, where: str) -> tuple[float, float]:
        """Return gain and offset from the number at the source to the number here, including unit conversion."""
        if self.source is None or self.unit is None:
            return self.gain, self.offset
        k, c = converted(self.source, self.unit, where)
        return self.gain * k, self.gain * c + self.offset
