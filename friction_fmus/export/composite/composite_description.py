"""modelDescription.xml, terminals, dependencies and documentation of a composite FMU (FMI 2.0.5, section 2.2)."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lxml import etree

from friction_fmus.export.composite.composite_interface import CompositeVariable, PartCode, reinitialised, states
from friction_fmus.fmi.html_page import page, row, table
from friction_fmus.fmi.model_description import (
    add_general,
    add_interface,
    add_unit,
    add_unknowns,
    add_variable,
    finite,
    icon_root,
)
from harness.errors import BuildError
from harness.parts.fmu import FmuPart
from harness.parts.part import Part
from harness.system.assembly import Assembly
from harness.system.experiment import Experiment
from harness.system.graph import instantaneous
from harness.system.wire import Wire, split_name
from harness.units import BaseUnit, parse_unit
from harness.values import STRUCTURED


def step_dependencies(system: Assembly, variables: Sequence[CompositeVariable]) -> dict[str, list[int]]:
    """Return for each output and derivative the indices of the inputs and states on which it depends directly."""
    # States count if the FMU is for model exchange too, and samples if it is nothing but sampled.
    sampled = all(v.variability == "discrete" for v in variables if v.causality == "output")
    inside = [wire for wire in system.wires if wire.ends[0][0] in system.parts]
    outside = [wire for wire in system.wires if wire not in inside and not wire.delay]
    prompt = [wire for wire in outside if sampled or not system.parts[wire.ends[1][0]].sampled]
    drivers = _drivers([*instantaneous(system.parts, inside), *prompt])
    held = {v.state for v in variables if v.state}
    knowns = {v.inner: i for i, v in enumerate(variables, start=1) if v.causality == "input" or v.name in held}
    parts = {name: part for name, part in system.parts.items() if sampled or not part.sampled}
    stated = {name: _direct(part, exchanges=bool(held)) for name, part in parts.items()}
    return {
        v.name: sorted(knowns[name] for name in _reached(v.inner, stated, drivers) if name in knowns)
        for v in variables
        if v.causality == "output" or v.state
    }


def _direct(part: Part, *, exchanges: bool) -> Mapping[str, Iterable[str]]:
    """Return the inputs on which each output depends, and for model exchange also the states, and the derivatives."""
    if not exchanges or not isinstance(part, FmuPart):
        return part.dependencies
    description = part.archive.description
    everything = [port.name for port in part.inputs] + list(states(part).values())
    return {
        unknown.variable.name: everything if unknown.dependencies is None else [v.name for v in unknown.dependencies]
        for unknown in (*description.outputs, *description.derivatives)
    }


def start_dependencies(system: Assembly, variables: Sequence[CompositeVariable]) -> dict[str, list[int] | None]:
    """Return for each calculated variable the indices of those on which its start value depends; None: on all."""
    drivers = _drivers(system.wires)
    knowns = {v.inner: i for i, v in enumerate(variables, start=1) if v.causality == "input" or v.initial == "exact"}
    fmus = {name: part for name, part in system.parts.items() if isinstance(part, FmuPart)}
    unknowns = {name: part.archive.description.initialUnknowns for name, part in fmus.items()}
    if any(unknown.dependencies is None for listed in unknowns.values() for unknown in listed):
        return {v.name: None for v in variables}
    stated = {
        name: {unknown.variable.name: [known.name for known in unknown.dependencies] for unknown in listed}
        for name, listed in unknowns.items()
    }
    return {
        v.name: sorted(knowns[name] for name in _reached(v.inner, stated, drivers) if name in knowns)
        for v in variables
        if v.initial == "calculated"
    }


def _drivers(wires: Iterable[Wire]) -> Mapping[str, str]:
    return {wire.target: wire.source for wire in wires}


def _reached(output: str, stated: Mapping[str, Mapping[str, Iterable[str]]], drivers: Mapping[str, str]) -> set[str]:
    """Return all variables on which an output depends: as its part states, or through connections."""
    found: set[str] = set()
    pending = [output]
    while pending:
        owner, own = split_name(pending.pop())
        for name in (f"{owner}.{port}" for port in stated.get(owner, {}).get(own, ())):
            if name not in found:
                found.add(name)
                if name in drivers:
                    found.add(drivers[name])  # an input of the FMU, or an output of a part
                    pending.append(drivers[name])
    return found


PAGE = "documentation/index.html"


def documentation(
    system: Assembly,
    identifier: str,
    summary: str,
    codes: Mapping[str, PartCode],
    variables: Sequence[CompositeVariable],
) -> dict[str, bytes]:
    """Return the files by their place in the FMU."""
    found: dict[str, bytes] = {}
    for name, code in {code.folder: (name, code) for name, code in codes.items()}.values():
        part = system.parts[name]
        assert isinstance(part, FmuPart)
        licences = [name for name in sorted(part.archive.names) if re.match("documentation/licenses/.*[^/]$", name)]
        for member, text in part.archive.read(*licences).items():
            found[f"documentation/licenses/{code.folder}-{Path(member).name}"] = text
    texts = dict.fromkeys(found.values())
    found["documentation/licenses/license.txt"] = b"\n".join(texts) or b"The parts of this FMU state no licence.\n"
    found[PAGE] = _page(system, identifier, summary, variables).encode()
    return found


def _page(system: Assembly, identifier: str, summary: str, variables: Sequence[CompositeVariable]) -> str:
    parts = "".join(
        row(name, part.archive.description.modelName, part.archive.description.description or "")
        for name, part in system.parts.items()
        if isinstance(part, FmuPart)
    )
    connections = "".join(row(wire.source, wire.target, _map(wire)) for wire in system.wires)
    listed = "".join(
        row(v.name, v.causality, v.port.unit or "", "" if v.start is None else f"{v.start:g}", v.port.description)
        for v in variables
    )
    tables = [
        ("Parts", "FMUs whose sources this FMU contains", ("name", "model", "description"), parts),
        ("Connections", "Values that parts exchange", ("source", "target", "conversion"), connections),
        ("Variables", "Variables and their start values", ("name", "causality", "unit", "start", "meaning"), listed),
    ]
    shown = "".join(
        f"<h2>{title}</h2>\n{table(caption, heads, f'<tbody>{body}</tbody>')}"
        for title, caption, heads, body in tables
        if body
    )
    body = f"<p>The FMU solves the loops of its parts.</p>\n{shown}"
    return page(identifier, "composite", summary, body, '<a href="licenses/license.txt">Licences</a> of the parts.')


def _map(wire: Wire) -> str:
    texts = [f"gain {wire.gain:g}"] if wire.gain != 1.0 else []
    texts += [f"offset {wire.offset:g}"] if wire.offset != 0.0 else []
    texts += [f"delay of {wire.delay} steps"] if wire.delay else []
    texts += [] if wire.initial is None else [f"{wire.initial:g} until then"]
    return ", ".join(texts)


TERMINALS = "terminalsAndIcons"
MEMBER = f"{TERMINALS}/terminalsAndIcons.xml"


def composite_terminals(system: Assembly, variables: Sequence[CompositeVariable]) -> bytes:
    """Return the XML file."""
    shown = {variable.name for variable in variables if variable.causality in ("input", "output")}
    root = icon_root()
    listed = etree.SubElement(root, "Terminals")
    for name, part in system.parts.items():
        for terminal in _terminals(part) if isinstance(part, FmuPart) else ():
            members = [(f"{name}.{member.get('variableName')}", member) for member in terminal.iterfind("*")]
            if not members or not all(variable in shown for variable, _ in members):
                continue
            attributes = {str(key): str(value) for key, value in terminal.attrib.items()}
            element = etree.SubElement(listed, "Terminal", attributes | {"name": f"{name}.{terminal.get('name')}"})
            for variable, member in members:
                own = {str(key): str(value) for key, value in member.attrib.items()}
                etree.SubElement(element, "TerminalMemberVariable", own | {"variableName": variable})
    if len(listed) == 0:
        root.remove(listed)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _terminals(part: FmuPart) -> Iterator[etree._Element]:
    """Yield the terminals of an FMU without graphics."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    roots = (etree.fromstring(data, parser) for data in part.archive.read(MEMBER).values())
    for terminal in (each for root in roots for each in root.iterfind("Terminals/Terminal")):
        for graphics in terminal.findall("TerminalGraphicalRepresentation"):
            terminal.remove(graphics)
        if all(child.tag == "TerminalMemberVariable" for child in terminal):
            yield terminal


@dataclass(frozen=True)
class Texts:
    """What the description says of the FMU beside its variables."""

    identifier: str
    guid: str
    """Model identifier and GUID."""
    summary: str  # one line on the system
    made: str  # time stamp
    sources: tuple[str, ...]  # the files to compile
    exchanges: bool  # whether the FMU is for model exchange too


def composite_description(
    texts: Texts,
    parts: Mapping[str, Part],
    variables: Sequence[CompositeVariable],
    dependencies: Mapping[str, Sequence[int]],
    initial: Mapping[str, Sequence[int] | None],
    experiment: Experiment,
) -> bytes:
    """Return the XML file."""
    fmus = [part for part in parts.values() if isinstance(part, FmuPart)]
    root = etree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=texts.identifier,
        guid=texts.guid,
        description=texts.summary,
        version="1.0",
        generationTool=f"friction-fmus {version('friction-fmus')}",
        generationDateAndTime=texts.made,
        variableNamingConvention="structured" if all(STRUCTURED.fullmatch(v.name) for v in variables) else "flat",
    )
    for name in ("author", "copyright", "license"):
        stated = dict.fromkeys(str(getattr(fmu.archive.description, name) or "") for fmu in fmus)
        text = "; ".join(filter(None, stated))
        if text:
            root.set(name, text)
    if texts.exchanges:
        root.set("numberOfEventIndicators", str(sum(int(f.archive.description.numberOfEventIndicators) for f in fmus)))
        add_interface(root, "ModelExchange", texts.identifier, exchange_capabilities(fmus), texts.sources)
    add_interface(root, "CoSimulation", texts.identifier, capabilities(parts), texts.sources)
    _units(root, fmus, variables)
    types = _types(root, variables)
    times = {"startTime": experiment.start, "stopTime": experiment.stop, "stepSize": experiment.step}
    if experiment.tolerance:
        times["tolerance"] = experiment.tolerance
    add_general(root, times)
    listed = etree.SubElement(root, "ModelVariables")
    places = {variable.name: i for i, variable in enumerate(variables, start=1)}
    jumps = {fmu.path: reinitialised(fmu) for fmu in {fmu.path: fmu for fmu in fmus if texts.exchanges}.values()}
    jumping = {f"{fmu.name}.{state}" for fmu in fmus for state in jumps.get(fmu.path, ())}
    for reference, variable in enumerate(variables):
        _variable(listed, variable, reference, types, places, variable.inner in jumping)
    structure = etree.SubElement(root, "ModelStructure")
    outputs = [(i, v) for i, v in enumerate(variables, start=1) if v.causality == "output"]
    add_unknowns(structure, "Outputs", ((i, dependencies[v.name]) for i, v in outputs))
    shown = {v.inner: v for v in variables if v.state}
    derivatives = [shown[name] for fmu in fmus for own in states(fmu) if (name := f"{fmu.name}.{own}") in shown]
    held = {v.state for v in derivatives}
    add_unknowns(structure, "Derivatives", ((places[v.name], dependencies[v.name]) for v in derivatives))
    unset = [
        v for v in variables if v.initial == "calculated" and (v.causality == "output" or v.state or v.name in held)
    ]
    add_unknowns(structure, "InitialUnknowns", ((places[v.name], initial[v.name]) for v in unset))
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def exchange_capabilities(fmus: Sequence[FmuPart]) -> dict[str, str]:
    """Return the capability flags of model exchange: those that all parts have."""
    flags = [fmu.archive.description.modelExchange for fmu in fmus]
    return {
        "completedIntegratorStepNotNeeded": _flag(all(each.completedIntegratorStepNotNeeded for each in flags)),
        **_of_both(flags),
    }


def capabilities(parts: Mapping[str, Part]) -> dict[str, str]:
    """Return the capability flags: those that all parts have."""
    flags = [part.archive.description.coSimulation for part in parts.values() if isinstance(part, FmuPart)]
    orders = [int(each.maxOutputDerivativeOrder or 0) for each in flags]
    return {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": str(min(1, *orders)),
        **_of_both(flags),
    }


def _of_both(flags: Sequence[Any]) -> dict[str, str]:
    """Return the flags of co-simulation or model exchange; a part may keep data outside of its instances."""
    once = any(each.canBeInstantiatedOnlyOncePerProcess for each in flags)
    return {
        **({"canBeInstantiatedOnlyOncePerProcess": "true"} if once else {}),
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": _flag(all(each.canSerializeFMUstate for each in flags)),
        "providesDirectionalDerivative": _flag(all(each.providesDirectionalDerivative for each in flags)),
    }


def provides_derivatives(parts: Mapping[str, Part]) -> bool:
    """Return whether all parts provide directional derivatives."""
    fmus = [part for part in parts.values() if isinstance(part, FmuPart)]
    return all(part.archive.description.coSimulation.providesDirectionalDerivative for part in fmus)


def _flag(value: bool) -> str:
    return "true" if value else "false"


def _units(root: etree._Element, fmus: Iterable[FmuPart], variables: Sequence[CompositeVariable]) -> None:
    used = dict.fromkeys(variable.port.unit for variable in variables if variable.port.unit)
    stated: dict[str, Any] = {}
    for fmu in fmus:
        for unit in fmu.archive.description.unitDefinitions:
            stated.setdefault(unit.name, unit)
    bases: dict[str, BaseUnit] = {}
    for variable in variables:
        unit = variable.port.unit
        base = variable.port.base or (parse_unit(unit) if unit else None)
        if unit and base is not None and not bases.setdefault(unit, base).agrees(base):
            raise BuildError(
                f"{variable.name} is in {unit} = {base}, but another part defines {unit} = {bases[unit]}: rename one "
                "of the units"
            )
    definitions = etree.SubElement(root, "UnitDefinitions")
    for unit in used:
        displays = stated[unit].displayUnits if unit in stated else ()
        add_unit(definitions, unit, bases.get(unit), [(d.name, float(d.factor), float(d.offset)) for d in displays])


def _types(root: etree._Element, variables: Sequence[CompositeVariable]) -> set[str]:
    """Write the types of the Reals and return their names; a name with two meanings is left out."""
    found: dict[str, tuple[str | None, str | None]] = {}
    names = {variable.name for variable in variables}
    for variable in variables:
        if variable.type_name and variable.type_name not in names:
            meaning = (variable.quantity, variable.port.unit)
            found[variable.type_name] = meaning if found.get(variable.type_name, meaning) == meaning else (None, None)
    kept = {name: meaning for name, meaning in found.items() if meaning != (None, None)}
    if kept:
        definitions = etree.SubElement(root, "TypeDefinitions")
        for name, (quantity, unit) in kept.items():
            attributes = {key: text for key, text in (("quantity", quantity), ("unit", unit)) if text}
            etree.SubElement(etree.SubElement(definitions, "SimpleType", name=name), "Real", attributes)
    return set(kept)


def _variable(
    parent: etree._Element,
    variable: CompositeVariable,
    reference: int,
    types: set[str],
    places: Mapping[str, int],
    jumps: bool,
) -> None:
    port = variable.port
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": port.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": variable.initial,
    }
    declared = variable.type_name in types
    typed = {
        "declaredType": variable.type_name if declared else None,
        "quantity": None if declared else variable.quantity or None,
        "unit": port.unit or None,
        "min": finite(port.limits[0]),
        "max": finite(port.limits[1]),
        "nominal": port.nominal if port.type == "Real" and port.nominal != 1.0 else None,
        "start": variable.start,
        "derivative": str(places[variable.state]) if variable.state else None,
        "reinit": "true" if jumps else None,
    }
    add_variable(parent, port.type, {name: text for name, text in attributes.items() if text}, typed)
