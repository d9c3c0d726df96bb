"""Prediction of a record by an identified model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from friction_fmus.identification.closed_loop import axis_response
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.block_fit import driven
from friction_fmus.identification.fit.least_squares import INITIAL_LIMIT, Coordinate, Problem
from friction_fmus.identification.fit.models import ContactModel, contact_model, state_sizes
from friction_fmus.identification.fit.position import force_on_axis
from friction_fmus.identification.fit.search import search
from friction_fmus.identification.fit.simulation_data import PreparedSegment, prepare
from friction_fmus.identification.methods.free_run import FREE_RUN, START, free_response

if TYPE_CHECKING:
    from friction_fmus.identification.result import Identification


def predict(result: Identification, record: Record) -> Array:
    """Predict the signal along the motion of a record; see `Identification.predict`."""
    if result.signal == "q":
        return free_response(result, record) if result.method == FREE_RUN else axis_response(result, record)["q"]
    force = result.signal == "force"
    known = (record.force if force else record.friction) is not None
    zero = np.zeros(len(record))
    filled = record if known else replace(record, force=zero) if force else replace(record, friction=zero)
    segment, F = simulated(result, filled, fit=known)
    values = result.values()
    if segment.a is None:
        return segment.predicted(F, 0.0, values.get("OF", 0.0))
    return F + values.get("M", 0.0) * segment.a + values.get("OF", 0.0) - known_force(result, segment)


def compare(result: Identification, record: Record) -> tuple[Array, Array]:
    """Return measured and predicted signal; see `Identification.compare`."""
    if result.signal == "q":
        first = START if result.method == FREE_RUN else 0
        return record.column("q")[first:], predict(result, record)[first:]
    segment, F = simulated(result, record, fit=True)
    values = result.values()
    known = segment.rows(known_force(result, segment))
    return segment.measured, segment.predicted(F, values.get("M", 0.0), values.get("OF", 0.0)) - known


def known_force(result: Identification, segment: PreparedSegment) -> Array:
    """Return the force over position that was identified with the model, along a prepared record; 0 without one."""
    return force_on_axis(None if result.position is None else result.position.table, segment)


def simulated(result: Identification, record: Record, fit: bool) -> tuple[PreparedSegment, Array]:
    """Return the prepared record, and the friction force along its motion with a fitted initial state."""
    contact = contact_model(result.block, record.units)
    segment = prepare(record, contact, result.signal, result.settings)
    coordinates, sizes = _initial(result, contact, segment)
    values = {
        name: contact.parameters[name].typed(value) if name in contact.parameters else value
        for name, value in result.values().items()
    }

    def states(_: Mapping[str, float], parts: Mapping[str, float]) -> dict[str, float]:
        return {name: part * sizes[name] for name, part in parts.items()}

    with driven(contact.path) as drive:
        remaining = segment.measured + segment.rows(known_force(result, segment))
        viscous = "Fv" in values and "Fv" not in contact.parameters
        segments = [replace(segment, measured=remaining)]
        problem = Problem(drive, segments, coordinates, lambda _: {}, states, values, viscous=viscous)
        x = problem.start()
        if coordinates:
            x = search(problem, "linear", 1).x if fit else 0.0 * x
        return segment, problem.force(x, 0)


def _initial(
    result: Identification, contact: ContactModel, segment: PreparedSegment
) -> tuple[tuple[Coordinate, ...], dict[str, float]]:
    """Return the initial states to fit, started from the first measured force, and their sizes in sliding."""
    sizes = {name: size for name, size in state_sizes(contact, result.values()).items() if size > 0.0}
    limit = INITIAL_LIMIT if contact.initial_state else 1.0
    peak = float(np.max(np.abs(segment.measured))) or 1.0
    part = 0.99 * float(np.median(segment.measured[:3])) / peak
    return tuple(Coordinate(name, 1.0, part, -limit, limit, segment=0) for name in sizes), sizes
