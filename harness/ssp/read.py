"""Systems from .ssp archives."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

from harness.errors import SystemFileError
from harness.parts.fmu import FmuPart
from harness.ssp.annotations import read_experiment, read_part
from harness.ssp.bindings import Binding, bound_values, read_bindings
from harness.ssp.flatten import Network
from harness.ssp.package import SSD, SSD_NAME, Package, TemporaryFolder, member_name, parse_document, read_units
from harness.ssp.structure import Endpoint, Structure, read_structure, scalars, split
from harness.ssp.structure import Path as SystemPath
from harness.system.system_file import SystemDescription
from harness.system.wire import stated_starts

_LOG = logging.getLogger("harness")


def read_ssp(path: Path, folder: Path | None) -> SystemDescription:
    """Read an archive; see `System.from_ssp`."""
    with Package(path) as package:
        root = parse_document(package.read(SSD_NAME, str(path)), SSD, f"{SSD_NAME} in {path}")
        structure = read_structure(root, read_units(root, "ssd:Units"), str(path))
        parts = _parts(package, structure, folder)
        bindings = read_bindings(package, structure)
        _resize(parts, bindings, scalars(structure), str(path))
        structure = split(structure, _shapes(parts), str(path))
        network = Network(structure, parts, str(path))
        wires = tuple(network.wires())
        start = {network.name(node): value for node, value in bound_values(bindings, structure, network).items()}
    driven = {wire.target for wire in wires}
    for name in sorted(driven & start.keys()):
        _LOG.info("%s: %s is connected, its start value is ignored", path, name)
        del start[name]
    return SystemDescription(
        parts=tuple(parts.values()),
        wires=wires,
        start=start | stated_starts(parts.values(), driven | start.keys()),
        experiment=read_experiment(root, str(path)),
        name=root.get("name", ""),
    )


def _parts(package: Package, structure: Structure, folder: Path | None) -> dict[SystemPath, FmuPart]:
    """Return a part for each component, with its FMU unpacked."""
    temporary = None
    if folder is None:
        temporary = TemporaryFolder()
        folder = temporary.path
    parts: dict[SystemPath, FmuPart] = {}
    taken: dict[str, str] = {}
    for path, element in structure.components.items():
        # names of parts have no dot, as a dot separates part and variable
        name, shown = "_".join(path).replace(".", "_"), ".".join(path)
        where = f"component '{shown}' in {package.path}"
        if name in taken:
            raise SystemFileError(f"{where} would be called '{name}', like '{taken[name]}': rename one of them")
        taken[name] = shown
        if not element.get("source"):
            raise SystemFileError(f"{where} has no source: add its FMU to the archive")
        fmu = package.unpack(member_name(element.get("source"), where), folder, where)
        part = parts[path] = FmuPart(name, fmu, **read_part(element, where))
        part.keep = temporary
        _check_implementation(element.get("implementation", "any"), part, where)
    return parts


def _resize(parts: Mapping[SystemPath, FmuPart], bindings: Sequence[Binding], structure: Structure, where: str) -> None:
    """Give the arrays of FMI 3.0 the sizes that the parameter bindings state."""
    sizes = {
        Endpoint(path, name)
        for path, part in parts.items()
        if part.archive.flat
        for name in part.archive.flat.structural
    }
    if sizes:
        stated = bound_values(bindings, structure, Network(structure, parts, where), sizes)
        for path, part in parts.items():
            part.resize({node.name: value for node, value in stated.items() if node.path == path})


def _shapes(parts: Mapping[SystemPath, FmuPart]) -> dict[Endpoint, tuple[int, ...]]:
    """Return the shapes of all variables of FMI 3.0."""
    flats = ((path, part.archive.flat) for path, part in parts.items())
    return {
        Endpoint(path, array.name): array.shape for path, flat in flats if flat is not None for array in flat.arrays
    }


def _check_implementation(wanted: str, part: FmuPart, where: str) -> None:
    """Raise a SystemFileError if the component asks for an interface that its FMU does not offer."""
    archive = part.archive
    used = "ModelExchange" if archive.exchange else "CoSimulation"
    if wanted in ("any", used):
        return
    if wanted == "ModelExchange" and (archive.flat.exchange if archive.flat else archive.description.modelExchange):
        _LOG.warning(
            "%s asks for ModelExchange: %s is run by its co-simulation, which has its own solver", where, part.path.name
        )
        return
    raise SystemFileError(
        f"{where} asks for {wanted}, but {part.path.name} only offers {used}: remove the attribute implementation"
    )
