"""Systems to .ssp archives."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from lxml import etree

from harness.errors import SystemFileError
from harness.parts.fmu import FmuPart
from harness.parts.part import Port, StartValue
from harness.ssp.annotations import annotate, write_experiment, write_part, write_step
from harness.ssp.document import SPACES, SSD, TOOL, set_text, sub, to_bytes
from harness.ssp.package import SSD_NAME, write_package
from harness.ssp.ssv import Parameter, ParameterSet, ssv_element
from harness.ssp.structure import FMU_TYPE
from harness.ssp.units import known_unit, write_units
from harness.system.assembly import Assembly
from harness.system.wire import Wire, split_name, wire_map
from harness.units import BaseUnit, units_agree

#: Name of the parameter set of every component, as ecos requires one.
SET_NAME = "start"


def write_ssp(system: Assembly, path: Path) -> None:
    """Write an archive; see `System.to_ssp`."""
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
    # all namespaces are declared here, as libcosim reads a nested declaration as an attribute
    root = etree.Element(f"{{{SSD}}}SystemStructureDescription", nsmap=dict(SPACES))
    for key, text in {"version": "1.0", "name": system.name, "generationTool": TOOL}.items():
        set_text(root, key, text)
    element = sub(root, "ssd:System", name=system.name)
    units: dict[str, BaseUnit] = {}
    wired = {end for wire in system.wires for end in (wire.source, wire.target)}
    if fmus:
        elements = sub(element, "ssd:Elements")
        for name, part in fmus.items():
            ends = ((split_name(dotted), value) for dotted, value in system.start.items())
            start = {port: value for (owner, port), value in ends if owner == name}
            # the default type of SSP 1.0, stated because OMSimulator opens no component without it
            component = sub(elements, "ssd:Component", name=name, type=FMU_TYPE, source=sources[name])
            _component(component, part, wired, start, units)
    if system.wires:
        connections = sub(element, "ssd:Connections")
        ports = {f"{name}.{port.name}": port for name, part in fmus.items() for port in (*part.inputs, *part.outputs)}
        for wire in system.wires:
            _connection(connections, wire, ports[wire.source], ports[wire.target])
    if system.experiment is not None:
        write_step(element, system.experiment)
    write_units(root, "ssd:Units", units)
    if system.experiment is not None:
        write_experiment(root, system.experiment)
    return root


def _component(
    element: etree._Element,
    part: FmuPart,
    wired: set[str],
    start: Mapping[str, StartValue],
    units: dict[str, BaseUnit],
) -> None:
    # fmpy sets an input to 0 if it has a connector but no connection
    ports = [
        *((port, "input") for port in part.inputs if f"{part.name}.{port.name}" in wired),
        # libcosim cannot read connectors of enumerations
        *((port, "output") for port in part.outputs if not port.items or f"{part.name}.{port.name}" in wired),
    ]
    if ports:
        connectors = sub(element, "ssd:Connectors")
        for port, kind in ports:
            connector = sub(connectors, "ssd:Connector", name=port.name, kind=kind)
            if not port.items:  # a connector without a type has the type of the variable
                typed = sub(connector, f"ssc:{port.type}")
                unit = _shared_unit(port, units)
                if unit is not None:
                    typed.set("unit", unit)
    if start:
        by_name = {port.name: port for port in (*part.inputs, *part.parameters)}
        parameters = {name: _parameter(part.name, by_name[name], value) for name, value in start.items()}
        binding = sub(sub(element, "ssd:ParameterBindings"), "ssd:ParameterBinding")
        ssv_element(ParameterSet(SET_NAME, parameters), sub(binding, "ssd:ParameterValues"))
    write_part(element, part)


def _shared_unit(port: Port, units: dict[str, BaseUnit]) -> str | None:
    """Return the unit of a port and add it to the units of the file; None if it cannot be defined there."""
    base = known_unit(port.unit, port.base)
    if port.unit is None or base is None or not units.setdefault(port.unit, base).agrees(base):
        return None
    return port.unit


def _parameter(part: str, port: Port, value: StartValue) -> Parameter:
    """Return a start value with the type and the unit of its variable."""
    where = f"start value {value!r} of {part}.{port.name}"
    try:
        if port.type == "String":
            return Parameter(str(value))
        if port.type == "Real":
            unit = port.unit if known_unit(port.unit, port.base) is not None else None
            return Parameter(float(value), unit, port.base)
        number = int(value)
        if number != value:
            raise ValueError(value)
        if port.items:
            return Parameter({number: item for item, number in port.items}[number], item=True)
        return Parameter(bool(number) if port.type == "Boolean" else number)
    except (KeyError, ValueError) as error:
        raise SystemFileError(f"{where} has the wrong type: give {_expected(port)}") from error


def _expected(port: Port) -> str:
    return f"one of {', '.join(str(number) for _, number in port.items)}" if port.items else f"a {port.type}"


def _connection(connections: etree._Element, wire: Wire, output: Port, input_: Port) -> None:
    """Write a connection, including the unit conversion, as most tools do not convert units."""
    converts = units_agree(output.unit, output.base, input_.unit, input_.base) is False
    (start, start_connector), (end, end_connector) = wire.ends
    element = sub(
        connections,
        "ssd:Connection",
        startElement=start,
        startConnector=start_connector,
        endElement=end,
        endConnector=end_connector,
        suppressUnitConversion="true" if converts else None,
    )
    if converts or (wire.gain, wire.offset) != (1.0, 0.0):
        factor, offset = wire_map(wire, output, input_)
        # always both, as ecos uses 0 for a missing factor
        sub(element, "ssc:LinearTransformation", factor=repr(float(factor)), offset=repr(float(offset)))
    settings = {"delay": str(wire.delay)} if wire.delay else {}
    if converts:
        settings |= {"gain": repr(float(wire.gain)), "offset": repr(float(wire.offset))}
    if settings:
        annotate(element, "harness:Wire", **settings)
