"""Finds the axes of a system: masses, the friction on them, and the laws that drive them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from friction_fmus.catalogue import catalogue
from friction_fmus.conditions import cogging_slope
from friction_fmus.doctor.axis import Axis, Contact, Path, Plant, Shaper, Used, Values
from friction_fmus.doctor.tables import BETWEEN, FRICTION, LAWS, PLANTS, SENSORS
from harness import FmuPart, Part, System, Wire, open_archive
from harness.errors import StartValueError
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


def unknown_parts(system: System) -> list[str]:
    """Parts that the doctor does not know, and so takes for nothing; sources of signals are none of its business."""
    signals = {f"{block.summary} ({block.source})" for block in catalogue().values() if block.kind == "signal"}
    unknown = [part for part in system.parts.values() if model_of(part) is None]
    return [
        part.name
        for part in unknown
        if not isinstance(part, FmuPart) or open_archive(part.path).description.description not in signals
    ]


def model_of(part: Part) -> str | None:
    """Which row of the tables a part is: by its model, its model identifier, or, if it was renamed, its description."""
    if not isinstance(part, FmuPart):
        return None
    known = {*PLANTS, *FRICTION, *LAWS, *SENSORS, *BETWEEN}
    description = open_archive(part.path).description
    for name in (part.model, description.coSimulation.modelIdentifier):
        if name in known:
            return str(name)
    texts = {f"{block.summary} ({block.source})": name for name, block in catalogue().items() if name in known}
    return texts.get(description.description)


def values_of(system: System, part: Part) -> Values:
    """Start values of the parameters of a part, and of its inputs that have no wire.

    Raises
    ------
    StartValueError
        If one is no number, not finite, or outside the range that the FMU states: a run would be refused as well.
    """
    wired = {wire.target for wire in system.wires}
    ports = [*part.parameters, *(port for port in part.inputs if f"{part.name}.{port.name}" not in wired)]
    given = {port.name: system.start.get(f"{part.name}.{port.name}", port.start) for port in ports}
    numbers = {port.name for port in ports if port.type != "String"}
    limits = _limits(part)
    values = {}
    for name, value in given.items():
        if value is None or name not in numbers:
            continue
        least, most = limits.get(name, (-math.inf, math.inf))
        if isinstance(value, str) or not (math.isfinite(value) and least <= value <= most):
            raise StartValueError(
                f"start value {value!r} of {part.name}.{name} is not a number from {least:g} to {most:g}: give one"
            )
        values[name] = float(value)
    return values


def _limits(part: Part) -> Mapping[str, tuple[float, float]]:
    """The ranges that the XML of an FMU states."""
    if not isinstance(part, FmuPart):
        return {}
    variables = open_archive(part.path).description.modelVariables
    return {v.name: (float(v.min or -math.inf), float(v.max or math.inf)) for v in variables if v.min or v.max}


def gain_of(system: System, wire: Wire) -> float:
    """Number at the target over number at the source, with the conversion of units."""
    (source, output), (target, port) = wire.ends
    ends = (
        next(p for p in system.parts[source].outputs if p.name == output),
        next(p for p in system.parts[target].inputs if p.name == port),
    )
    return wire_map(wire, *ends)[0]


Drivers = Mapping[tuple[str, str], Wire]
Models = Mapping[str, str | None]


def _axis(system: System, models: Models, drivers: Drivers, name: str, plant: Plant) -> Axis:
    p = values_of(system, system.parts[name])
    friction, contact, at_load = _contact(system, models, drivers, name, plant)
    laws = tuple(_laws(system, models, drivers, name, plant))
    damping, stiffness = (p.get(key, 0.0) for key in (plant.damping, plant.stiffness))
    return Axis(
        name,
        plant.mass(p),
        damping,
        stiffness,
        friction,
        contact,
        laws,
        flexible=(p["m1"], p["m2"], p["k"], p["d"]) if plant.flexible else None,
        at_load=at_load,
        cogging=_cogging(system, models, drivers, name, plant),
        belt=p.get("v_belt"),
        shapers=tuple(_shapers(system, models, drivers, laws)),
    )


def _contact(
    system: System, models: Models, drivers: Drivers, name: str, plant: Plant
) -> tuple[str | None, Contact | None, bool]:
    """The friction on a mass, at the normal force that it has at the start, and whether it is that of the load."""
    wired = [(drivers[name, port], port) for port in plant.friction if (name, port) in drivers]
    for part, port in [(wire.ends[0][0], port) for wire, port in wired] or [(name, "")]:
        model = models[part]
        if model is not None and model in FRICTION:
            p = values_of(system, system.parts[part])
            load = p["Fn"] / p["Fn0"] if "Fn" in p and p.get("Fn0") else 1.0
            return part, FRICTION[model](p).loaded(max(load, 0.0)), port.endswith("2")
    return None, None, False


def _cogging(system: System, models: Models, drivers: Drivers, name: str, plant: Plant) -> tuple[str, float] | None:
    """A part whose force on the mass depends on its position, and the largest slope of that."""
    for port in plant.forces:
        wire = drivers.get((name, port))
        part = wire.ends[0][0] if wire else ""
        if wire is not None and models[part] == "Cogging":
            p = values_of(system, system.parts[part])
            harmonics = [[p[f"{key}[{i}]"] for i in range(1, 7)] for key in ("amplitude", "phase")]
            return part, gain_of(system, wire) * cogging_slope(p["pitch"], *harmonics)
    return None


def _shapers(system: System, models: Models, drivers: Drivers, laws: Iterable[Used]) -> Iterator[Shaper]:
    """The prefilters before the references of laws."""
    seen: set[str] = set()
    for used in laws:
        wires = [drivers[used.part, port] for port in ("r", "rd") if (used.part, port) in drivers]
        for part in [wire.ends[0][0] for wire in wires]:
            model = models[part]
            if part not in seen and model in ("Prefilter", "PreviewPrefilter") and used.law.gains is not None:
                seen.add(part)
                yield Shaper(part, model, values_of(system, system.parts[part]))


def _laws(system: System, models: Models, drivers: Drivers, plant: str, names: Plant) -> Iterator[Used]:
    """The laws upstream of the forces on a plant: through the input f of laws, through all inputs of other parts."""
    waiting = [(drivers[plant, port], 1.0, Path()) for port in names.forces if (plant, port) in drivers]
    seen: set[str] = set()
    while waiting:
        wire, beyond, path = waiting.pop(0)
        part = wire.ends[0][0]
        to_force = beyond * gain_of(system, wire)
        model = models[part]
        if part in seen or model in PLANTS or model in FRICTION or model == "Cogging":
            continue
        seen.add(part)
        law, values = LAWS.get(model or ""), values_of(system, system.parts[part])
        if law is not None:
            path = _limited(path, to_force, values.get("u_min", -math.inf), values.get("u_max", math.inf))
            x, v, measured = _measured(system, models, drivers, plant, part, path)
            yield Used(part, law, values, to_force, x, v, measured)
            if law.amplifies is not None:
                path = replace(path, amplified=path.amplified * law.amplifies(values))
        elif model == "Actuator":
            path = _limited(path, to_force, values["F_min"], values["F_max"])
            path = replace(path, tau=path.tau + values["tau"], delay=path.delay + values["delay"])
        inputs = [port.name for port in system.parts[part].inputs if law is None or port.name == "f"]
        waiting += [(drivers[part, port], to_force, path) for port in inputs if (part, port) in drivers]


def _limited(path: Path, to_force: float, low: float, high: float) -> Path:
    """A path behind one more limit, in the unit and sign of the force on the plant."""
    ends = sorted((to_force * low, to_force * high)) if to_force else (0.0, 0.0)
    return replace(path, low=max(path.low, ends[0]), high=min(path.high, ends[1]))


def _measured(
    system: System, models: Models, drivers: Drivers, plant: str, part: str, path: Path
) -> tuple[float, float, Path]:
    """Gains of the measurements of a law, through known sensors, and what these do."""
    x, _, x_port = _traced(system, models, drivers, plant, (part, "x"), path)
    v, path, v_port = _traced(system, models, drivers, plant, (part, "v"), path)
    if not path.sensor:
        path = _traced(system, models, drivers, plant, (part, "x"), path)[1]
    return x, v, replace(path, at_load=(x_port.endswith("2"), v_port.endswith("2")))


def _traced(
    system: System, models: Models, drivers: Drivers, plant: str, port: tuple[str, str], path: Path
) -> tuple[float, Path, str]:
    """Gain from the plant to an input, with the encoders and differentiators in between, and the output it begins at.

    A sensor that is not known is taken for exact.
    """
    gain, wire = 1.0, drivers.get(port)
    while wire is not None:
        (source, output), _ = wire.ends
        gain *= gain_of(system, wire)
        model = models[source]
        if source == plant:
            return gain, path, output
        if model not in SENSORS:
            return 1.0, path, ""
        p = values_of(system, system.parts[source])
        path = replace(path, sensor=path.sensor or source, quantum=max(path.quantum, p.get("q", 0.0)))
        if output == "v_measured" and not path.window:
            path = replace(path, window=1)
        elif model == "Differentiator" and output == "v":
            path = replace(path, window=int(p["window"]), smoothing=p["tau"])
        wire = drivers.get((source, "x"))
    return 1.0, path, ""
