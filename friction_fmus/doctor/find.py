"""Finds the axes of a system: masses, the friction on them, and the laws that drive them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from friction_fmus.catalogue import catalogue
from friction_fmus.doctor.axis import Axis, Contact, Plant, Used, Values
from friction_fmus.doctor.tables import FRICTION, LAWS, PLANTS
from harness import FmuPart, Part, System, Wire, open_archive
from harness.wire import wire_map


def axes(system: System) -> list[Axis]:
    """The axes of a system that the tables know.

    Raises
    ------
    HarnessError
        If an FMU can no longer be read.
    """
    models = {name: model_of(part) for name, part in system.parts.items()}
    drivers = {wire.ends[1]: wire for wire in system.wires}
    masses = [(name, PLANTS[model]) for name, model in models.items() if model is not None and model in PLANTS]
    return [_axis(system, models, drivers, name, plant) for name, plant in masses]


def model_of(part: Part) -> str | None:
    """Which row of the tables a part is: by its model, its model identifier, or, if it was renamed, its description."""
    if not isinstance(part, FmuPart):
        return None
    known = {*PLANTS, *FRICTION, *LAWS}
    description = open_archive(part.path).description
    for name in (part.model, description.coSimulation.modelIdentifier):
        if name in known:
            return str(name)
    texts = {f"{block.summary} ({block.source})": name for name, block in catalogue().items() if name in known}
    return texts.get(description.description)


def values_of(system: System, part: Part) -> Values:
    """Start values of the parameters of a part, and of its inputs that have no wire."""
    wired = {wire.target for wire in system.wires}
    ports = [*part.parameters, *(port for port in part.inputs if f"{part.name}.{port.name}" not in wired)]
    given = {port.name: system.start.get(f"{part.name}.{port.name}", port.start) for port in ports}
    return {name: float(value) for name, value in given.items() if value is not None and not isinstance(value, str)}


def gain_of(system: System, wire: Wire) -> float:
    """Number at the target over number at the source, with the conversion of units."""
    (source, output), (target, port) = wire.ends
    ends = (
        next(p for p in system.parts[source].outputs if p.name == output),
        next(p for p in system.parts[target].inputs if p.name == port),
    )
    return wire_map(wire, *ends)[0]


Drivers = Mapping[tuple[str, str], Wire]


def _axis(system: System, models: Mapping[str, str | None], drivers: Drivers, name: str, plant: Plant) -> Axis:
    p = values_of(system, system.parts[name])
    friction, contact = _contact(system, models, drivers, name, plant)
    laws = _laws(system, models, drivers, name, plant)
    damping, stiffness = (p.get(key, 0.0) for key in (plant.damping, plant.stiffness))
    return Axis(name, plant.mass(p), damping, stiffness, friction, contact, tuple(laws))


def _contact(
    system: System, models: Mapping[str, str | None], drivers: Drivers, name: str, plant: Plant
) -> tuple[str | None, Contact | None]:
    """The friction on a mass, at the normal force that it has at the start."""
    wire = drivers.get((name, plant.friction))
    part = wire.ends[0][0] if wire else name
    model = models[part]
    if model is None or model not in FRICTION:
        return None, None
    p = values_of(system, system.parts[part])
    load = p["Fn"] / p["Fn0"] if "Fn" in p and p.get("Fn0") else 1.0
    return part, FRICTION[model](p).loaded(max(load, 0.0))


def _laws(
    system: System, models: Mapping[str, str | None], drivers: Drivers, plant: str, names: Plant
) -> Iterator[Used]:
    """The laws upstream of the forces on a plant: through the input f of laws, through all inputs of other parts."""
    waiting = [(drivers[plant, port], 1.0) for port in names.forces if (plant, port) in drivers]
    seen: set[str] = set()
    while waiting:
        wire, beyond = waiting.pop(0)
        part = wire.ends[0][0]
        to_force = beyond * gain_of(system, wire)
        model = models[part]
        if part in seen or model in PLANTS or model in FRICTION:
            continue
        seen.add(part)
        law = LAWS.get(model or "")
        if law is not None:
            x, v = (_measured(system, drivers, plant, (part, port)) for port in ("x", "v"))
            yield Used(part, law, values_of(system, system.parts[part]), to_force, x, v)
        inputs = [port.name for port in system.parts[part].inputs if law is None or port.name == "f"]
        waiting += [(drivers[part, port], to_force) for port in inputs if (part, port) in drivers]


def _measured(system: System, drivers: Drivers, plant: str, port: tuple[str, str]) -> float:
    """Gain of a measurement that comes straight from the plant; a sensor in between is taken for exact."""
    wire = drivers.get(port)
    return gain_of(system, wire) if wire is not None and wire.ends[0][0] == plant else 1.0
