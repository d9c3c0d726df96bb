"""Conditions on communication steps, sample times and the stepping order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from friction_fmus import conditions
from friction_fmus.doctor.axis import Axis, Finding
from friction_fmus.doctor.find import values_of
from harness import Experiment, System
from harness.system.graph import stepping_order


def examine_steps(system: System, experiment: Experiment, axes: Sequence[Axis]) -> Iterator[Finding]:
    """Yield the conditions on the communication step and on delayed outputs, including those that hold."""
    yield from _samples(system, experiment)
    yield from _late(system, experiment)
    for axis in axes:
        yield from _contacts(system, experiment, axis)


def _samples(system: System, experiment: Experiment) -> Iterator[Finding]:
    for name, part in system.parts.items():
        Ts = values_of(system, part).get("Ts")
        if part.sampled and Ts is not None and Ts > 0.0:
            yield Finding((name,), conditions.sample_step(Ts, part.every * experiment.step))


def _late(system: System, experiment: Experiment) -> Iterator[Finding]:
    """Yield the delay between a sampled part and the next part in the stepping order.

    Connections with a specified delay are skipped, as are the inputs u_prev and f_prev, which expect the value of the
    previous sample.
    """
    order = list(experiment.order) or stepping_order(system.parts, system.wires)
    place = {name: index for index, name in enumerate(order)}
    reported: set[tuple[str, str]] = set()
    for wire in system.wires:
        (source, _), (target, port) = wire.ends
        one, other = system.parts[source], system.parts[target]
        if not one.sampled or wire.delay or port.endswith("_prev") or (source, target) in reported:
            continue
        reported.add((source, target))
        implicit = experiment.master in ("newton", "adaptive") and not other.sampled
        late = experiment.master == "jacobi" or (not implicit and place[source] > place[target])
        Ts = values_of(system, one).get("Ts", one.every * experiment.step)
        yield Finding((source, target), conditions.output_delay(experiment.step if late else 0.0, Ts, source, target))


def _contacts(system: System, experiment: Experiment, axis: Axis) -> Iterator[Finding]:
    """Yield the condition on the step if mass and contact are separate parts coupled by held values."""
    contact, friction = axis.contact, axis.friction
    if contact is None or friction is None or friction == axis.plant or not contact.stiffness:
        return
    if experiment.extrapolation:  # the limit is only valid for held values
        return
    step = experiment.step * max(system.parts[name].every for name in (axis.plant, friction))
    damping = contact.damping + contact.viscous
    condition = conditions.contact_step(experiment.master, step, axis.m, contact.stiffness, damping)
    yield Finding((axis.plant, friction), condition)
