"""Setup of a search: coordinates, start values and bounds from a block, records and the user's constraints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from friction_fmus.blocks.arithmetic import evaluate
from friction_fmus.errors import nearest
from friction_fmus.identification.data.record import AxisUnits
from friction_fmus.identification.errors import FitError
from friction_fmus.identification.fit.models import ContactModel, Traits
from friction_fmus.identification.fit.problem import Assemble, Coordinate, States
from friction_fmus.identification.fit.simulation_data import PreparedSegment, inertia_guess

#: Largest magnitude of an initial state over its magnitude in steady sliding.
INITIAL_LIMIT = 3.0

Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Constraints:
    """Fixed values, bounds and start values of parameters, as given by the user."""

    fixed: Mapping[str, float]
    bounds: Bounds
    start: Mapping[str, float]

    @property
    def named(self) -> set[str]:
        """Parameters with bounds or start values, which are identified even if they are fixed by default."""
        return {*self.bounds, *self.start}


@dataclass(frozen=True)
class Setup:
    """Coordinates of a search, and their conversion to start values of the block."""

    coordinates: tuple[Coordinate, ...]
    """Coordinates shared by all records first, then the others."""
    assemble: Assemble
    states: States
    """Functions that return parameters and initial states, see `Problem`."""
    constants: Mapping[str, float | int | bool]
    """Other start values of the block."""
    units: Mapping[str, str]
    """Units of the values returned by `assemble` and `states`."""


def check_constraints(model: ContactModel, signal: str, constraints: Constraints) -> None:
    """Validate the user's constraints."""
    known = {*model.parameters, "OF", *(("M",) if signal == "force" else ()), *(("Fv",) if model.viscous else ())}
    for kind, names in (("fixed", constraints.fixed), ("bounds", constraints.bounds), ("start", constraints.start)):
        for name in names:
            if name not in known:
                raise FitError(
                    f"{kind} contains {name!r}, which is not a parameter of {model.name}{nearest(name, known)}; "
                    f"`friction-fmus show {model.name}` lists the parameters."
                )
    if both := set(constraints.fixed) & constraints.named:
        raise FitError(f"{min(both)} is fixed and also has bounds or a start value; remove one of the two.")
    for name, value in {**constraints.fixed, **constraints.start}.items():
        parameter = model.parameters.get(name)
        if not math.isfinite(value) or (parameter and not parameter.lower <= value <= parameter.upper):
            limits = f"[{parameter.lower:g}, {parameter.upper:g}]" if parameter else "the finite numbers"
            raise FitError(f"{name} = {value:g} is outside {limits}; use a value inside.")
    for name, (low, high) in constraints.bounds.items():
        if not low < high:
            raise FitError(f"The bounds of {name} are {low:g} and {high:g}; give the lower one first.")
        start = constraints.start.get(name)
        if start is not None and not low <= start <= high:
            raise FitError(
                f"The start value {start:g} of {name} is outside its bounds {low:g} .. {high:g}; change one."
            )


def constants_of(model: ContactModel, constraints: Constraints, Fn0: float | None) -> dict[str, float | int | bool]:
    """Return the fixed parameters, and the normal force at which the parameters are valid."""
    constants: dict[str, float | int | bool] = {
        name: model.parameters[name].typed(value) if name in model.parameters else value
        for name, value in constraints.fixed.items()
    }
    if Fn0 is not None and model.loaded:
        constants.setdefault("Fn0", Fn0)
    return constants


def scalar_setup(
    model: ContactModel,
    segments: Sequence[PreparedSegment],
    traits: Traits,
    constraints: Constraints,
    units: AxisUnits,
    Fn0: float | None,
) -> Setup:
    """Return the setup of a search for a block with scalar parameters."""
    names = model.identified(constraints.named, constraints.fixed)
    coordinates = [coordinate(model, name, traits, constraints) for name in names]
    coordinates += surroundings(segments, traits, constraints, model.viscous)
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

    unit = {name: p.unit for name, p in model.parameters.items()}
    unit |= {"M": units.inertia, "OF": units.force} | ({"Fv": units.viscous} if model.viscous else {})
    if state is not None:
        unit[state] = units.force if state.startswith("F") else units.position
    return Setup(tuple(coordinates), dict, states, constants, unit)


def coordinate(model: ContactModel, name: str, traits: Traits, constraints: Constraints) -> Coordinate:
    """Return the coordinate of a parameter; it is logarithmic if the range of the parameter excludes zero."""
    parameter = model.parameters[name]
    lower, upper = constraints.bounds.get(name, (parameter.lower, parameter.upper))
    lower, upper = max(lower, parameter.lower), min(upper, parameter.upper)
    fit = model.fit_of(name)
    guess = constraints.start.get(name, traits.value(fit.start) if fit else parameter.start)
    guess = min(max(guess, lower), upper)
    log = parameter.lower > 0.0
    scale = abs(guess) or abs(parameter.start) or 1.0
    return Coordinate(name, scale, guess, lower, upper, log)


def surroundings(
    segments: Sequence[PreparedSegment], traits: Traits, constraints: Constraints, viscous: bool
) -> list[Coordinate]:
    """Return the coordinates of the mass of a drive, of the force offset, and of a viscous friction beside the block.

    The offset is identified if motion is in both directions.
    """
    guesses: dict[str, tuple[float, float]] = {}
    if segments[0].a is not None:
        mass, offset = inertia_guess(segments)
        a = np.concatenate([segment.a for segment in segments if segment.a is not None])
        size = float(np.sqrt(np.mean(np.square(a))))
        guesses = {"M": (max(mass, 1e-3 * traits.level / max(size, 1e-300)), 0.0), "OF": (offset, -math.inf)}
    elif any(segment.reciprocating for segment in segments) or "OF" in constraints.named:
        guesses = {"OF": (0.0, -math.inf)}
    if viscous:
        guesses["Fv"] = traits.viscous, 0.0
    found = []
    for name, (guess, low) in guesses.items():
        # with separate parameters for each direction, an offset is not identifiable
        if name in constraints.fixed or (
            name == "OF" and constraints.fixed.get("asymmetric") and name not in constraints.named
        ):
            continue
        lower, upper = constraints.bounds.get(name, (low, math.inf))
        value = constraints.start.get(name, guess)
        scale = abs(value) if name in ("M", "Fv") and value != 0.0 else max(abs(value), traits.level)
        found.append(Coordinate(name, scale, min(max(value, lower), upper), lower, upper))
    return found


def _initial_guess(segment: PreparedSegment, traits: Traits, Fn0: float | None) -> float:
    """Return the first measured force over the force in sliding."""
    force = float(np.median(segment.measured[:3])) * (Fn0 or 1.0)
    return min(max(force / traits.level, -1.0), 1.0)


def advice(model: ContactModel, name: str) -> str:
    """Return what to measure to identify a parameter or an initial state."""
    fit = model.fit_of(name)
    return fit.measure if fit else "sliding in both directions at the start of the record"
