"""Search for the axes of a system: masses, the friction on them, and the laws that drive them."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, replace
from typing import NamedTuple

from friction_fmus import conditions
from friction_fmus.blocks.arithmetic import evaluate
from friction_fmus.blocks.axis_units import words_of
from friction_fmus.blocks.catalogue import listing
from friction_fmus.blocks.contact import AxisFriction
from friction_fmus.blocks.loop_role import InLoop, Plant
from friction_fmus.conditions import cogging_slope
from friction_fmus.conditions.chain import Biquad
from friction_fmus.doctor.examined_axis import ActiveLaw, Axis, LoopFinding, Shaper, SignalPath, Values
from friction_fmus.doctor.roles import known_blocks, law_of
from harness import Experiment, FmuPart, Part, System, Wire
from harness.errors import StartValueError
from harness.masters import find_master
from harness.system.graph import stepping_order
from harness.system.wire import wire_map


def axes(system: System) -> list[Axis]:
    """Return the axes of a system, one for each mass with a known block.

    Parameters
    ----------
    system : System
        System to search.

    Returns
    -------
    list of Axis
        Axes with their friction and laws.

    Raises
    ------
    HarnessError
        If an FMU cannot be read.
    """
    known = known_blocks()
    models = {name: model_of(part) or "" for name, part in system.parts.items()}
    parts = {name: KnownPart(model, known.get(model, InLoop())) for name, model in models.items()}
    drivers = {wire.ends[1]: wire for wire in system.wires}
    among = Searched(system, parts, drivers)
    return [_axis(among, name, part.block.plant) for name, part in parts.items() if part.block.plant is not None]


def unknown_parts(system: System) -> list[str]:
    """Return the parts that the doctor ignores because their block is not known; signal sources are not listed.

    Parameters
    ----------
    system : System
        System to search.

    Returns
    -------
    list of str
        Names of the parts.
    """
    signals = {f"{block.summary} ({block.source})" for block in listing().values() if block.kind == "signal"}
    unknown = [part for part in system.parts.values() if model_of(part) is None]
    return [
        part.name
        for part in unknown
        if not isinstance(part, FmuPart) or part.archive.description.description not in signals
    ]


def model_of(part: Part) -> str | None:
    """Return the known block of a part, by model name, model identifier or, for a renamed FMU, its description."""
    if not isinstance(part, FmuPart):
        return None
    known = known_blocks()
    archive = part.archive
    for name in (part.model, archive.interface.modelIdentifier):
        if name in known:
            return str(name)
    texts = {f"{block.summary} ({block.source})": name for name, block in listing().items() if name in known}
    return texts.get(archive.description.description)


def values_of(system: System, part: Part) -> Values:
    """Return the start values of the parameters of a part and of its unconnected inputs."""
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
                f"start value {value!r} of {part.name}.{name} is not a number from {least:g} to {most:g}: change it"
            )
        values[name] = float(value)
    return values


def _limits(part: Part) -> Mapping[str, tuple[float, float]]:
    """Return the ranges stated in the model description of an FMU."""
    if not isinstance(part, FmuPart):
        return {}
    variables = part.archive.description.modelVariables
    return {v.name: (float(v.min or -math.inf), float(v.max or math.inf)) for v in variables if v.min or v.max}


def gain_of(system: System, wire: Wire) -> float:
    """Return the ratio of the value at the target to the value at the source, including unit conversion."""
    (source, output), (target, port) = wire.ends
    given = next(p for p in system.parts[source].outputs if p.name == output)
    taken = next(p for p in system.parts[target].inputs if p.name == port)
    return wire_map(wire, given, taken)[0]


class KnownPart(NamedTuple):
    """Block of a part and its role in a loop; both empty if the block is not known."""

    model: str
    block: InLoop


class Searched(NamedTuple):
    """A system, what is known of its parts, and the wire at each input."""

    system: System
    parts: Mapping[str, KnownPart]
    drivers: Mapping[tuple[str, str], Wire]

    def values(self, part: str) -> Values:
        """Return the start values of a part, see `values_of`."""
        return values_of(self.system, self.system.parts[part])


def _axis(among: Searched, name: str, plant: Plant) -> Axis:
    p = among.values(name)
    friction, contact, at_load = _contact(among, name, plant)
    laws = tuple(_laws(among, name, plant))
    damping, stiffness = (p.get(key, 0.0) for key in (plant.damping, plant.stiffness))
    return Axis(
        name,
        float(evaluate(plant.mass, p)),
        damping,
        stiffness,
        friction,
        contact,
        laws,
        flexible=_flexible(plant, p),
        at_load=at_load,
        cogging=_cogging(among, name, plant),
        belt=p.get(plant.belt),
        support=p.get(plant.support),
        shapers=tuple(_shapers(among, laws)),
        words=words_of(any(port.unit in ("rad", "rad/s") for port in among.system.parts[name].outputs)),
    )


def _flexible(plant: Plant, p: Values) -> tuple[float, float, float, float] | None:
    """Return m1, m2, k and d of motor and load; None for a single mass."""
    if not plant.flexible:
        return None
    m1, m2, k, d = (p[name] for name in plant.flexible)
    return m1, m2, k, d


def _contact(among: Searched, name: str, plant: Plant) -> tuple[str | None, AxisFriction | None, bool]:
    """Return the friction on a mass at the initial normal force, and whether all of it acts on the load.

    Of motor and load, it is the sum of both, which are in motion together; the part is that of the motor. Friction
    whose normal force comes from another part is left out, as its level changes.
    """
    found: list[tuple[str, AxisFriction, bool]] = []
    wired = [(among.drivers[name, port], port) for port in plant.friction if (name, port) in among.drivers]
    for part, port in [(wire.ends[0][0], port) for wire, port in wired] or [(name, "")]:
        friction = among.parts[part].block.friction
        if friction is not None and (part, "Fn") not in among.drivers:
            p = among.values(part)
            load = p["Fn"] / p["Fn0"] if "Fn" in p and p.get("Fn0") else 1.0
            found.append((part, friction.contact(p).loaded(max(load, 0.0)), port.endswith("2")))
    if not found:
        return None, None, False
    part, contact, at_load = found[0]
    for _, other, _ in found[1:]:
        contact = contact.beside(other)
    return part, contact, at_load


def _cogging(among: Searched, name: str, plant: Plant) -> tuple[str, float] | None:
    """Return a part whose force on the mass depends on position, and the largest slope of this force."""
    for port in plant.forces:
        wire = among.drivers.get((name, port))
        part = wire.ends[0][0] if wire else ""
        cogging = among.parts[part].block.cogging if wire else None
        if wire is not None and cogging is not None and cogging.pitch:
            p = among.values(part)
            harmonics = [
                [value for name, value in p.items() if name.startswith(f"{key}[")]
                for key in (cogging.amplitude, cogging.phase)
            ]
            return part, gain_of(among.system, wire) * cogging_slope(p[cogging.pitch], *harmonics)
    return None


def _shapers(among: Searched, laws: Iterable[ActiveLaw]) -> Iterator[Shaper]:
    """Yield the prefilters connected to the reference inputs of laws."""
    seen: set[str] = set()
    for used in laws:
        wires = [among.drivers[used.part, port] for port in ("r", "rd") if (used.part, port) in among.drivers]
        for part in [wire.ends[0][0] for wire in wires]:
            model, block = among.parts[part]
            if part not in seen and block.law is not None and block.law.shapes and used.law.gains is not None:
                seen.add(part)
                yield Shaper(part, model, among.values(part))


def _laws(among: Searched, plant: str, names: Plant) -> Iterator[ActiveLaw]:
    """Yield the laws upstream of a plant's force inputs, through inputs f of laws and all inputs of other parts."""
    waiting = [
        (among.drivers[plant, port], 1.0, SignalPath()) for port in names.forces if (plant, port) in among.drivers
    ]
    seen: set[str] = set()
    while waiting:
        wire, beyond, path = waiting.pop(0)
        part = wire.ends[0][0]
        to_force = beyond * gain_of(among.system, wire)
        model, block = among.parts[part]
        if part in seen or block.plant or block.friction or block.cogging:
            continue
        seen.add(part)
        law, values = law_of(model), among.values(part)
        if law is not None:
            path = _limited(path, to_force, values.get("u_min", -math.inf), values.get("u_max", math.inf))
            x, v, measured = _measured(among, plant, part, path)
            yield ActiveLaw(part, law, values, to_force, x, v, measured)
            if law.amplifies is not None:
                path = replace(path, amplified=path.amplified * law.amplifies(values))
        elif block.drive is not None:
            low, high, lag, delay = (float(evaluate(text, values)) for text in astuple(block.drive))
            path = _limited(path, to_force, low, high)
            path = replace(path, tau=path.tau + lag, delay=path.delay + delay)
        elif block.biquad is not None:
            low, own = _filter(block.biquad, values)
            to_force, path = to_force * low, replace(path, notch=(*path.notch, own))
        inputs = [port.name for port in among.system.parts[part].inputs if law is None or port.name == "f"]
        waiting += [(among.drivers[part, port], to_force, path) for port in inputs if (part, port) in among.drivers]


def _limited(path: SignalPath, to_force: float, low: float, high: float) -> SignalPath:
    """Return a path with one more limit, converted to the unit and sign of the force on the plant."""
    ends = sorted((to_force * low, to_force * high)) if to_force else (0.0, 0.0)
    return replace(path, low=max(path.low, ends[0]), high=min(path.high, ends[1]))


def _measured(among: Searched, plant: str, part: str, path: SignalPath) -> tuple[float, float, SignalPath]:
    """Return the gains of the measured position and velocity of a law, and the path with the sensors in between."""
    x, of_x, x_port = _traced(among, plant, (part, "x"), path)
    v, of_v, v_port = _traced(among, plant, (part, "v"), path)
    path = replace(of_v if of_v.sensor else of_x, lowpass=of_v.lowpass, position=of_x.lowpass)
    return x, v, replace(path, at_load=(x_port.endswith("2"), v_port.endswith("2")))


def _filter(names: Iterable[str], p: Values) -> tuple[float, Biquad]:
    """Return the gain of a filter at frequency 0, and the filter without this gain unless it is 0."""
    f, zeta, low, band, high = (p[name] for name in names)
    f, gain = (f, low or 1.0) if 0.0 < f * p["Ts"] < 0.5 else (0.0, 1.0)
    return gain, (f, zeta, low / gain, band / gain, high / gain)


def _traced(among: Searched, plant: str, port: tuple[str, str], path: SignalPath) -> tuple[float, SignalPath, str]:
    """Return the gain from plant to input, the path with its sensors (unknown ones are exact), and the output."""
    gain, wire = 1.0, among.drivers.get(port)
    while wire is not None and len(path.lowpass) <= len(among.parts):  # filters may be connected in a circle
        (source, output), _ = wire.ends
        gain *= gain_of(among.system, wire)
        if source == plant:
            return gain, path, output
        sensor, biquad = among.parts[source].block.sensor, among.parts[source].block.biquad
        if biquad is not None:
            low, own = _filter(biquad, among.values(source))
            gain, path = gain * low, replace(path, lowpass=(*path.lowpass, own))
        elif sensor is not None:
            p = among.values(source)
            quantum = float(evaluate(sensor.quantum, p)) if sensor.quantum else 0.0
            path = replace(path, sensor=path.sensor or source, quantum=max(path.quantum, quantum))
            if output == sensor.velocity and not path.window:
                window, smoothing = evaluate(sensor.window, p), evaluate(sensor.smoothing, p)
                path = replace(path, window=int(window), smoothing=float(smoothing))
        else:
            break
        wire = among.drivers.get((source, "u" if biquad else "x"))
    return 1.0, path, ""


def examine_steps(system: System, experiment: Experiment, axes: Sequence[Axis]) -> Iterator[LoopFinding]:
    """Yield the conditions on the communication step and on delayed outputs, including those that hold."""
    yield from _samples(system, experiment)
    yield from _late(system, experiment)
    for axis in axes:
        yield from _contacts(system, experiment, axis)


def _samples(system: System, experiment: Experiment) -> Iterator[LoopFinding]:
    for name, part in system.parts.items():
        Ts = values_of(system, part).get("Ts")
        if part.sampled and Ts is not None and Ts > 0.0:
            yield LoopFinding((name,), conditions.sample_step(Ts, part.every * experiment.step))


def _late(system: System, experiment: Experiment) -> Iterator[LoopFinding]:
    """Yield the delay between a sampled part and the next part in the stepping order."""
    # Connections with a specified delay are skipped, as are the inputs u_prev and f_prev, which expect the value of the
    # previous sample.
    order = list(experiment.order) or stepping_order(system.parts, system.wires)
    place = {name: index for index, name in enumerate(order)}
    reported: set[tuple[str, str]] = set()
    for wire in system.wires:
        (source, _), (target, port) = wire.ends
        one, other = system.parts[source], system.parts[target]
        if not one.sampled or wire.delay or port.endswith("_prev") or (source, target) in reported:
            continue
        reported.add((source, target))
        master = find_master(experiment.master)
        late = master.together or (place[source] > place[target] and (other.sampled or not master.implicit))
        Ts = values_of(system, one).get("Ts", one.every * experiment.step)
        delay = experiment.step if late else 0.0
        yield LoopFinding((source, target), conditions.output_delay(delay, Ts, source, target))


def _contacts(system: System, experiment: Experiment, axis: Axis) -> Iterator[LoopFinding]:
    """Yield the condition on the step if mass and contact are separate parts coupled by held values."""
    contact, friction = axis.contact, axis.friction
    if contact is None or friction is None or friction == axis.plant or not contact.stiffness:
        return
    if experiment.extrapolation:  # the limit is only valid for held values
        return
    step = experiment.step * max(system.parts[name].every for name in (axis.plant, friction))
    damping = contact.damping + contact.viscous
    condition = conditions.contact_step(experiment.master, step, axis.m, contact.stiffness, damping)
    yield LoopFinding((axis.plant, friction), condition.in_words(axis.words))
