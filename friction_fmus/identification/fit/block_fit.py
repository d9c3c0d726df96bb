"""Fit of a friction block to records, with a pool of loaded FMUs."""

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from friction_fmus.blocks.arithmetic import evaluate
from friction_fmus.blocks.axis_units import AxisUnits
from friction_fmus.errors import FitError
from friction_fmus.identification.fit.axis_terms import term_units
from friction_fmus.identification.fit.contact_model import ContactModel, DataTraits
from friction_fmus.identification.fit.least_squares import (
    INITIAL_LIMIT,
    Constraints,
    Coordinate,
    Problem,
    Setup,
    constants_of,
    coordinate,
    surroundings,
)
from friction_fmus.identification.fit.search import Loss, SearchResult, search
from friction_fmus.identification.fit.simulation_data import PreparedSegment
from harness import Drive, FmuPart


@dataclass(frozen=True, eq=False)
class FitData:
    """Friction block, and the records to which it is fitted."""

    model: ContactModel  # friction block
    drive: Drive  # loaded block
    segments: Sequence[PreparedSegment]  # prepared records
    traits: DataTraits  # rough properties of the friction, for start values
    constraints: Constraints  # fixed values, bounds and start values given by the user
    units: AxisUnits  # units of the axis
    Fn0: float | None  # normal force at which the parameters are valid [N]; None if it was not measured
    terms: tuple[str, ...] = ()  # what acts beside the block, of `TERMS`

    def problem(self, setup: Setup) -> Problem:
        """Return the least-squares problem of a setup."""
        parts = setup.coordinates, setup.assemble, setup.states, setup.constants
        return Problem(self.drive, self.segments, *parts, model=self.model)


@dataclass(frozen=True, eq=False)
class BlockFit:
    """Result of a method of identification."""

    setup: Setup  # coordinates of the search, and their conversion to parameters
    problem: Problem  # least-squares problem
    found: SearchResult  # solution of the problem


def fit_scalars(data: FitData, loss: Loss, starts: int | None) -> BlockFit:
    """Fit a block with scalar parameters."""
    setup = scalar_setup(data)
    problem = data.problem(setup)
    known = all(c.name in data.constraints.start or c.name == "OF" for c in problem.shared)
    starts = starts or (1 if known else 3)
    if data.model.transmits:  # first under the measured force, with fewer local minima
        rough = search(replace(problem, predicts_drive=False), loss, starts).x
        found = [replace(c, start=c.value(float(x))) for c, x in zip(problem.coordinates, rough, strict=True)]
        problem, starts = replace(problem, coordinates=found), 1
    return BlockFit(setup, problem, search(problem, loss, starts))


def scalar_setup(data: FitData) -> Setup:
    """Return the setup of a search for a block with scalar parameters."""
    model, segments, traits, constraints = data.model, data.segments, data.traits, data.constraints
    Fn0 = data.Fn0
    names = model.identified(constraints.named, constraints.fixed)
    coordinates = [coordinate(model, name, traits, constraints) for name in names]
    coordinates += surroundings(segments, traits, constraints, model.viscous, data.terms)
    if not coordinates:
        raise FitError(f"All parameters of {model.name} are fixed; leave at least one to be identified.")
    state = model.initial_state
    if state is not None:
        coordinates += [
            Coordinate(state, 1.0, _initial_guess(segment, traits, Fn0), -INITIAL_LIMIT, INITIAL_LIMIT, segment=index)
            for index, segment in enumerate(segments)
        ]
    constants = constants_of(model, constraints, Fn0)
    defaults = {name: p.start for name, p in model.parameters.items()} | {k: float(v) for k, v in constants.items()}

    def states(parameters: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
        if state is None:
            return {}
        return {state: values[state] * float(evaluate(model.identified_by.size, {**defaults, **parameters}))}

    unit = units_of(model, data.units)
    if state is not None:
        unit[state] = model.states[state]
    return Setup(tuple(coordinates), dict, states, constants, unit)


def units_of(model: ContactModel, units: AxisUnits) -> dict[str, str]:
    """Return the units of the parameters of a block and of what acts beside it."""
    beside = {"M": units.inertia, "OF": units.force} | ({"Fv": units.viscous} if model.viscous else {})
    return {name: p.unit for name, p in model.parameters.items()} | beside | term_units(units)


def _initial_guess(segment: PreparedSegment, traits: DataTraits, Fn0: float | None) -> float:
    """Return the first measured force over the force in sliding."""
    force = float(np.median(segment.measured[:3])) * (Fn0 or 1.0)
    return min(max(force / traits.level, -1.0), 1.0)


_IDLE: dict[Path, Drive] = {}
_LOCK = threading.Lock()


@contextmanager
def driven(path: Path) -> Iterator[Drive]:
    """Provide a drive of an FMU for exclusive use; the last one of each FMU stays loaded."""
    with _LOCK:
        drive = _IDLE.pop(path, None)
    drive = drive or Drive(FmuPart(path.stem, path))
    try:
        yield drive
    finally:
        with _LOCK:
            before = _IDLE.pop(path, None)
            _IDLE[path] = drive
        if before is not None:
            before.close()
