"""FMU files: all checks before an FMU is unpacked and loaded."""

import math
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from itertools import chain
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any, Final

import fmpy
from lxml import etree

from harness.errors import FmuError
from harness.parts.flat_description import Flat, flatten
from harness.parts.part import Port, PortType, StartValue
from harness.storage.files import reason
from harness.storage.zip_file import ZipError, open_file, open_zip, read_zip
from harness.units import BaseUnit, stated_unit

_MOST_INDICATORS: Final = 1_000_000
_TRAITS: Final = ("VendorAnnotations/Tool[@name='harness']/Part", "Annotations/Annotation[@type='harness']/Part")
"""Where FMI 2.0 and 3.0 FMUs declare traits."""


@dataclass(frozen=True)
class Archive:
    """A checked FMU file."""

    path: Path  # the FMU
    description: Any  # the parsed modelDescription.xml
    ports: Mapping[str, Port]  # all variables by name, as ports
    variables: Mapping[str, Any]  # all variables by name, with value reference, causality, variability and initial
    root: etree._Element  # the root of modelDescription.xml, with what fmpy does not read
    names: tuple[str, ...]  # all members
    flat: Flat | None = None  # for FMI 3.0: its arrays and clocks; description and variables are in terms of FMI 2.0

    @property
    def traits(self) -> frozenset[str]:
        """What its annotation for the harness declares: "strict", "samplesInSteps"."""
        return _traits(self.root)

    def read(self, *names: str) -> dict[str, bytes]:
        """Return the contents of those of these members that there are."""
        with open_zip(self.path) as archive:
            return {name: read_zip(archive, name) for name in names if name in self.names}

    @property
    def platform(self) -> str:
        """Folder of the binaries for this machine."""
        return str(fmpy.platform if self.flat is None else fmpy.platform_tuple)

    @property
    def exchange(self) -> bool:
        """Whether the FMU offers model exchange only."""
        return self.description.coSimulation is None

    @property
    def interface(self) -> Any:
        """Model identifier and capabilities of the interface that is used."""
        return self.description.modelExchange if self.exchange else self.description.coSimulation

    def feedthrough(self) -> tuple[dict[str, frozenset[str]], frozenset[str]]:
        """Return the direct feedthrough of each output, and the outputs without such a declaration."""
        inputs = frozenset(name for name, variable in self.variables.items() if variable.causality == "input")
        stated = {
            unknown.variable.name: inputs & {variable.name for variable in unknown.dependencies}
            for unknown in self.description.outputs
            if unknown.dependencies is not None
        }
        outputs = [name for name, variable in self.variables.items() if variable.causality == "output"]
        return {name: stated.get(name, inputs) for name in outputs}, frozenset(outputs) - stated.keys()

    def integrals(self) -> dict[str, str]:
        """Return the states whose time derivatives depend on one variable only, by the name of this variable."""
        return {
            unknown.dependencies[0].name: unknown.variable.derivative.name
            for unknown in self.description.derivatives
            if len(unknown.dependencies or ()) == 1 and unknown.variable.derivative is not None
        }


def open_archive(path: Path, sizes: Mapping[str, int] = MappingProxyType({})) -> Archive:
    """Check an FMU file and read its model description without unpacking it.

    Parameters
    ----------
    path : Path
        The FMU.
    sizes : mapping of str to int
        Values of structural parameters of FMI 3.0, in place of their start values.

    Returns
    -------
    Archive
        The model description and the variables.

    Raises
    ------
    FmuError
        If the file is missing, is not a zip archive or not an FMI 2.0 or 3.0 FMU, has no binary for this
        platform, has members that are unsafe to unpack (see `harness.storage.zip_file`), or has a DOCTYPE in its XML.
    """
    state = path.stat() if path.is_file() else None
    key = state and (state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns)
    return _opened(path, tuple(sizes.items()), key)


@lru_cache(maxsize=64)
def _opened(path: Path, sizes: tuple[tuple[str, int], ...], state: tuple[int, ...] | None) -> Archive:
    """Return the archive in a state of its file, so that each is read once."""
    members, data = _read_members(path)
    root = _root(path, data)
    description, flat = _read_description(path, data, dict(sizes), ticks="samplesInSteps" not in _traits(root))
    archive = Archive(
        path=path,
        description=description,
        ports=_ports(path, description),
        variables={variable.name: variable for variable in description.modelVariables},
        root=root,
        names=tuple(members),
        flat=flat,
    )
    _check_binary(path, archive.platform, archive.interface.modelIdentifier, members)
    return archive


def _read_members(path: Path) -> tuple[list[str], bytes]:
    """Return the names of the members, and modelDescription.xml."""
    with open_file("FMU", path, FmuError) as archive:
        if "modelDescription.xml" not in archive.namelist():
            raise FmuError(f"{path} is not an FMU: it has no modelDescription.xml; export it again as FMI 2.0")
        try:
            return archive.namelist(), read_zip(archive, "modelDescription.xml")
        except ZipError as error:
            raise FmuError(f"cannot read modelDescription.xml of {path}: {error}") from error


def _root(path: Path, data: bytes) -> etree._Element:
    """Return the root of the XML; an FmuError for a DOCTYPE, which can define entities and which no FMU needs."""
    try:
        root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, ValueError) as error:
        raise _unreadable(path, error) from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise FmuError(f"modelDescription.xml of {path} has a DOCTYPE, which is unsafe; do not use this file")
    return root


def _unreadable(path: Path, error: Exception) -> FmuError:
    why = reason(error)
    return FmuError(f"cannot read modelDescription.xml of {path}: {why}; correct it, or give an FMI 2.0 or 3.0 FMU")


def _traits(root: etree._Element) -> frozenset[str]:
    declared = (root.iterfind(place) for place in _TRAITS)
    return frozenset(str(key) for part in chain(*declared) for key, value in part.items() if value == "true")


def parse_value(kind: PortType, text: str) -> StartValue:
    """Return the value of an XML attribute."""
    if kind == "Real":
        return float(text)
    if kind == "Integer":
        return int(text)
    return text.strip() in {"true", "1"} if kind == "Boolean" else text


def parse_description(data: bytes, **checks: bool) -> Any:
    """Return a modelDescription.xml as fmpy reads it, from an archive only."""
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("modelDescription.xml", data)
    return fmpy.read_model_description(content, **checks)


def _read_description(path: Path, data: bytes, sizes: Mapping[str, int], *, ticks: bool) -> tuple[Any, Flat | None]:
    try:
        # not validated: an FMU that other importers run must run here; required entries are checked where they are used
        description = parse_description(data, validate=False)
    except Exception as error:
        raise _unreadable(path, error) from error
    version = str(description.fmiVersion)
    if version.startswith("3."):
        return flatten(path, description, sizes, ticks=ticks)
    if version != "2.0":
        raise FmuError(f"{path} is an FMI {version} FMU: export it as FMI 2.0 or 3.0")
    if description.coSimulation is None and description.modelExchange is None:
        raise FmuError(f"{path} declares neither co-simulation nor model exchange: export it again as FMI 2.0")
    indicators = int(description.numberOfEventIndicators or 0)
    if not 0 <= indicators <= _MOST_INDICATORS:
        raise FmuError(
            f"{path} declares {indicators} event indicators: correct numberOfEventIndicators (0 to {_MOST_INDICATORS})"
        )
    return description, None


def _check_binary(path: Path, platform: str, identifier: str, members: list[str]) -> None:
    needed = f"binaries/{platform}/{identifier}{fmpy.sharedLibraryExtension}"
    if needed in members:
        return
    folders = sorted({PurePosixPath(member).parts[1] for member in members if _is_library(member)})
    others = [member for member in members if member.startswith(f"binaries/{platform}/") and _is_library(member)]
    if others:
        raise FmuError(
            f"{path} has the library {others[0]}, but its modelIdentifier is {identifier!r}: rename one of them"
        )
    remedy = f"use an FMU built for {platform}"
    if any(member.startswith("sources/") and member.endswith(".c") for member in members):
        remedy += ", or build it from the sources that it carries"
    raise FmuError(f"{path} has no binary {needed}, only {', '.join(folders) or 'none at all'}: {remedy}")


def _is_library(member: str) -> bool:
    return member.startswith("binaries/") and PurePosixPath(member).suffix in {".so", ".dll", ".dylib"}


def _ports(path: Path, description: Any) -> dict[str, Port]:
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    ports = {}
    for variable in description.modelVariables:
        try:
            ports[variable.name] = _port(variable, units)
        except (TypeError, ValueError) as error:  # a number is malformed or missing
            raise FmuError(f"variable '{variable.name}' of {path} is malformed: {error}; export it again") from error
    return ports


def _port(variable: Any, units: Mapping[str, Any]) -> Port:
    kind: PortType = "Integer" if variable.type == "Enumeration" else variable.type
    declared = variable.declaredType
    unit = variable.unit or (declared.unit if declared is not None else None)
    base = units.get(unit) if unit else None
    return Port(
        name=variable.name,
        unit=unit,
        type=kind,
        start=None if variable.start is None else parse_value(kind, variable.start),
        description=variable.description or "",
        base=None if base is None else _base_unit(base),
        items=tuple((item.name, int(item.value)) for item in (declared.items if declared is not None else ())),
        limits=(_number(_stated(variable, "min"), -math.inf), _number(_stated(variable, "max"), math.inf)),
        nominal=_size(_number(_stated(variable, "nominal"), 1.0)),
        held=variable.variability == "discrete",
    )


def _stated(variable: Any, attribute: str) -> str | None:
    """Return an attribute of a variable, or else of its type."""
    return getattr(variable, attribute) or getattr(variable.declaredType, attribute, None)


def _number(text: str | None, otherwise: float) -> float:
    """Return a limit or a nominal value; a malformed one does not make the FMU unusable."""
    try:
        number = float(text or otherwise)
    except ValueError:
        return otherwise
    return otherwise if math.isnan(number) else number


def _size(nominal: float) -> float:
    return abs(nominal) if nominal and math.isfinite(nominal) else 1.0


def _base_unit(base: Any) -> BaseUnit:
    exponents = tuple(int(getattr(base, name)) for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad"))
    return stated_unit(exponents, float(base.factor), float(base.offset))
