"""Systems in .ssp archives, read and written (SSP 1.0 and 2.0)."""

import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from lxml import etree

from harness.errors import SystemFileError
from harness.parts.flat_description import Array, element_names
from harness.parts.fmu import FmuPart
from harness.parts.part import Port, StartValue
from harness.ssp.annotations import annotate, read_experiment, read_part, write_experiment, write_part, write_step
from harness.ssp.bindings import Binding, bound_values, read_bindings
from harness.ssp.flatten import Network
from harness.ssp.package import (
    SPACES,
    SSD,
    SSD_NAME,
    TOOL,
    Package,
    TemporaryFolder,
    known_unit,
    member_name,
    parse_document,
    read_units,
    set_text,
    sub,
    to_bytes,
    write_package,
    write_units,
)
from harness.ssp.ssv import Parameter, ParameterSet, is_single, ssv_element
from harness.ssp.structure import FMU_TYPE, Endpoint, Structure, read_structure, scalars, split
from harness.ssp.structure import Path as SystemPath
from harness.system.assembly import Assembly, resize_parts, start_values
from harness.system.system_file import SystemDescription
from harness.system.wire import Wire, split_name, stated_starts, wire_map
from harness.units import BaseUnit, units_agree

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


#: Types that SSP 1.0 has under this or an older name.
_OLD = ("Float64", "Int32", "Boolean", "String", "Enumeration")


def arrays_of(part: FmuPart) -> dict[str, Array]:
    """Return the variable of FMI 3.0 for each of its elements; none for an FMI 2.0 FMU."""
    flat = part.archive.flat
    return {} if flat is None else {name: array for array in flat.arrays for name in flat.elements_of[array.name]}


def indices(element: str) -> str:
    """Return the indices of an element such as ``k[1,2]`` as SSP 2.0 writes them."""
    return element[element.rindex("[") + 1 : -1].replace(",", " ")


def grouped(wires: Sequence[Wire], arrays: Mapping[str, Array]) -> Iterator[tuple[Wire, bool]]:
    """Return the connections, and whether one stands for all those between two arrays of the same shape."""
    elements: dict[tuple[str, str], list[str]] = {}
    for dotted, array in arrays.items():
        elements.setdefault((split_name(dotted)[0], array.name), []).append(dotted)
    k = 0
    while k < len(wires):
        wire = wires[k]
        ends = [(end, arrays[end]) for end in (wire.source, wire.target) if end in arrays]
        if len(ends) == 2 and ends[0][1].shape == ends[1][1].shape:
            names = [elements[split_name(end)[0], array.name] for end, array in ends]
            run = wires[k : k + len(names[0])]
            if [(each.source, each.target) for each in run] == list(zip(*names, strict=True)) and all(
                replace(each, source=wire.source, target=wire.target) == wire for each in run
            ):
                yield wire, True
                k += len(run)
                continue
        yield wire, False
        k += 1


def start_parameters(
    part: FmuPart, start: Mapping[str, StartValue], arrays: Mapping[str, Array]
) -> tuple[dict[str, Parameter], dict[str, tuple[int, ...]]]:
    """Return the start values with type and unit of their variables, and the shapes of the arrays."""
    # An array is always given as a whole, as an importer sets it as a whole.
    ports = {port.name: port for port in (*part.inputs, *part.parameters)}
    parameters: dict[str, Parameter] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    for name in start:
        array = arrays.get(name)
        if name in parameters:  # part of an array
            continue
        names = [name] if array is None else list(element_names(array.name, array.shape))
        values = {each: start.get(each, ports[each].start) for each in names}
        missing = next((each for each, value in values.items() if value is None), None)
        if missing is not None:
            raise SystemFileError(f"{part.name}.{missing} has no start value: give one for each element of the array")
        if array is not None and array.shape:
            shapes[array.name] = array.shape
        kind = _stated_type(array, values)
        parameters |= {
            each: _parameter(part.name, ports[each], value, kind) for each, value in values.items() if value is not None
        }
    return parameters, shapes


def _stated_type(array: Array | None, values: Mapping[str, StartValue | None]) -> str:
    """Return the type of FMI 3.0 to state, if there is one."""
    if array is None or array.type in ("Boolean", "String", "Enumeration"):
        return ""
    if array.type == "Float32":
        exact = all(not isinstance(value, (int, float)) or is_single(value) for value in values.values())
        return "Float32" if exact else "Float64"  # the FMU rounds the value, the file keeps it
    return array.type


def _parameter(part: str, port: Port, value: StartValue, kind: str) -> Parameter:
    """Return a start value with the type and the unit of its variable."""
    where = f"start value {value!r} of {part}.{port.name}"
    try:
        if port.type == "String":
            return Parameter(str(value))
        if port.type == "Real" and "Int" not in kind:
            unit = port.unit if known_unit(port.unit, port.base) is not None else None
            return Parameter(float(value), unit, port.base, type=kind)
        number = int(value)
        if number != value:
            raise ValueError(value)
        if port.items:
            return Parameter({number: item for item, number in port.items}[number], item=True)
        return Parameter(bool(number) if port.type == "Boolean" else number, type=kind)
    except (KeyError, OverflowError, ValueError) as error:
        one = f"one of {', '.join(str(number) for _, number in port.items)}" if port.items else f"a {port.type}"
        raise SystemFileError(f"{where} has the wrong type: give {one}") from error


#: Name of the parameter set of every component, as ecos requires one.
SET_NAME = "start"


def write_ssp(system: Assembly, path: Path) -> None:
    """Write an archive; see `System.to_ssp`."""
    resize_parts(system)
    fmus = {name: part for name, part in system.parts.items() if isinstance(part, FmuPart)}
    for name in system.parts:
        if name not in fmus:
            raise SystemFileError(f"part '{name}' cannot be written to {path}: an SSP archive contains FMUs only")
    sources = _sources(fmus)
    members: dict[str, bytes | Path] = {SSD_NAME: to_bytes(_document(system, fmus, sources))}
    members |= {source: fmus[name].path for name, source in sources.items()}
    write_package(path, members)


def _sources(fmus: Mapping[str, FmuPart]) -> dict[str, str]:
    """Return the member of the archive for each part; equal FMUs are packed once."""
    sources: dict[str, str] = {}
    packed: dict[bytes, str] = {}
    for name, part in fmus.items():
        try:
            data = part.path.read_bytes()
        except OSError as error:
            raise SystemFileError(f"cannot read {part.path}: {error.strerror}; build the FMU again") from error
        if data not in packed:
            # some tools do not decode escaped characters of a URI
            stem = re.sub(r"[^A-Za-z0-9_-]", "_", part.path.stem)
            names = (f"resources/{stem}{suffix}.fmu" for suffix in ("", *(f"_{k}" for k in range(2, len(fmus) + 1))))
            packed[data] = next(source for source in names if source not in packed.values())
        sources[name] = packed[data]
    return sources


def _document(system: Assembly, fmus: Mapping[str, FmuPart], sources: Mapping[str, str]) -> etree._Element:
    written = {name: _written(system, part) for name, part in fmus.items()}
    arrays = {name: arrays_of(part) for name, part in fmus.items()}
    stated = (arrays[name][each] for name in fmus for each in written[name] if each in arrays[name])
    two = any(array.shape or array.type not in _OLD for array in stated)  # only SSP 2.0 can state them
    arrays = arrays if two else {name: {} for name in fmus}
    # all namespaces are declared here, as libcosim reads a nested declaration as an attribute
    root = etree.Element(f"{{{SSD}}}SystemStructureDescription", nsmap=dict(SPACES))
    for key, text in {"version": "2.0" if two else "1.0", "name": system.name, "generationTool": TOOL}.items():
        set_text(root, key, text)
    element = sub(root, "ssd:System", name=system.name)
    units: dict[str, BaseUnit] = {}
    if fmus:
        elements = sub(element, "ssd:Elements")
        for name, part in fmus.items():
            # the default type of SSP, stated because OMSimulator opens no component without it
            component = sub(elements, "ssd:Component", name=name, type=FMU_TYPE, source=sources[name])
            _connectors(component, part, written[name], arrays[name], units)
            start = start_values(system.start, part.name)
            if start:
                parameters, shapes = start_parameters(part, start, arrays[name])
                binding = sub(sub(component, "ssd:ParameterBindings"), "ssd:ParameterBinding")
                values = ParameterSet(SET_NAME, parameters, arrays=shapes)
                ssv_element(values, sub(binding, "ssd:ParameterValues"))
            write_part(component, part)
    if system.wires:
        connections = sub(element, "ssd:Connections")
        ports = {f"{name}.{port.name}": port for name, part in fmus.items() for port in (*part.inputs, *part.outputs)}
        dotted = {f"{name}.{each}": array for name in fmus for each, array in arrays[name].items() if array.shape}
        for wire, whole in grouped(system.wires, dotted):
            _connection(connections, wire, ports[wire.source], ports[wire.target], dotted, whole)
    if system.experiment is not None:
        write_step(element, system.experiment)
    write_units(root, "ssd:Units", units)
    if system.experiment is not None:
        write_experiment(root, system.experiment)
    return root


def _written(system: Assembly, part: FmuPart) -> dict[str, str]:
    """Return the variables that stand in the file: kinds of the connectors, empty for other start values."""
    wired = {end for wire in system.wires for end in (wire.source, wire.target)}
    # fmpy sets an input to 0 if it has a connector but no connection
    kinds = {port.name: "input" for port in part.inputs if f"{part.name}.{port.name}" in wired}
    # libcosim cannot read connectors of enumerations
    kinds |= {port.name: "output" for port in part.outputs if not port.items or f"{part.name}.{port.name}" in wired}
    return kinds | {name: kinds.get(name, "") for name in start_values(system.start, part.name)}


def _connectors(
    element: etree._Element,
    part: FmuPart,
    written: Mapping[str, str],
    arrays: Mapping[str, Array],
    units: dict[str, BaseUnit],
) -> None:
    ports = [port for port in (*part.inputs, *part.outputs) if written.get(port.name)]
    if not ports:
        return
    connectors = sub(element, "ssd:Connectors")
    made = set()
    for port in ports:
        array = arrays.get(port.name)
        name, kind, shape = (port.name, port.type, ()) if array is None else (array.name, array.type, array.shape)
        if name in made:
            continue
        made.add(name)
        connector = sub(connectors, "ssd:Connector", name=name, kind=written[port.name])
        if not port.items:  # a connector without a type has the type of the variable
            typed = sub(connector, f"ssc:{kind}")
            unit = _shared_unit(port, units)
            if unit is not None:
                typed.set("unit", unit)
        for size in shape:
            sub(connector, "ssc:Dimension", size=str(size))


def _shared_unit(port: Port, units: dict[str, BaseUnit]) -> str | None:
    """Return the unit of a port and add it to the units of the file; None if it cannot be defined there."""
    base = known_unit(port.unit, port.base)
    if port.unit is None or base is None or not units.setdefault(port.unit, base).agrees(base):
        return None
    return port.unit


def _connection(
    connections: etree._Element, wire: Wire, output: Port, input_: Port, arrays: Mapping[str, Array], whole: bool
) -> None:
    """Write a connection, including the unit conversion, as most tools do not convert units."""
    converts = units_agree(output.unit, output.base, input_.unit, input_.base) is False
    (start, start_connector), (end, end_connector) = wire.ends
    source, target = arrays.get(wire.source), arrays.get(wire.target)
    element = sub(
        connections,
        "ssd:Connection",
        startElement=start,
        startConnector=start_connector if source is None else source.name,
        startIndices=None if source is None or whole else indices(start_connector),
        endElement=end,
        endConnector=end_connector if target is None else target.name,
        endIndices=None if target is None or whole else indices(end_connector),
        suppressUnitConversion="true" if converts else None,
    )
    if converts or (wire.gain, wire.offset) != (1.0, 0.0):
        factor, offset = wire_map(wire, output, input_)
        # always both, as ecos uses 0 for a missing factor
        sub(element, "ssc:LinearTransformation", factor=repr(float(factor)), offset=repr(float(offset)))
    settings = {"delay": str(wire.delay)} if wire.delay else {}
    if wire.initial is not None:
        settings |= {"initial": repr(float(wire.initial))}
    if converts:
        settings |= {"gain": repr(float(wire.gain)), "offset": repr(float(wire.offset))}
    if settings:
        annotate(element, "harness:Wire", **settings)
