"""From a block, records and what the user says to the unknowns of a search."""

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
from friction_fmus.identification.fit.simulation_data import Piece, inertia_guess

#: An initial state may exceed the one of steady sliding by this factor.
INITIAL_LIMIT = 3.0

Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Wishes:
    """What the user says of the parameters: values, bounds and start values."""

    fixed: Mapping[str, float]
    bounds: Bounds
    start: Mapping[str, float]

    @property
    def named(self) -> set[str]:
        """Parameters that are to be identified whatever the defaults say."""
        return {*self.bounds, *self.start}


@dataclass(frozen=True)
class Setup:
    """Unknowns of a search and how they become start values of the block.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        The unknowns, those that all records share first.
    assemble, states : callable
        See `Problem`.
    constants : mapping of str to number
        Other start values of the block.
    units : mapping of str to str
        Units of what `assemble` and `states` return.
    """

    coordinates: tuple[Coordinate, ...]
    assemble: Assemble
    states: States
    constants: Mapping[str, float | int | bool]
    units: Mapping[str, str]


def check_wishes(model: ContactModel, signal: str, wishes: Wishes) -> None:
    """Refuse names the block does not have, and values outside its range.

    Raises
    ------
    FitError
        Says which.
    """
    known = {*model.parameters, "OF", *(("M",) if signal == "force" else ())}
    for kind, names in (("fixed", wishes.fixed), ("bounds", wishes.bounds), ("start", wishes.start)):
        for name in names:
            if name not in known:
                raise FitError(
                    f"{kind} names {name!r}, which is no parameter of {model.name}{nearest(name, known)} "
                    f"(`friction-fmus show {model.name}` lists them)."
                )
    if both := set(wishes.fixed) & wishes.named:
        raise FitError(f"{min(both)} is fixed and to be identified at once; leave it out of one of the two.")
    for name, value in {**wishes.fixed, **wishes.start}.items():
        parameter = model.parameters.get(name)
        if not math.isfinite(value) or (parameter and not parameter.lower <= value <= parameter.upper):
            limits = f"[{parameter.lower:g}, {parameter.upper:g}]" if parameter else "the finite numbers"
            raise FitError(f"{name} = {value:g} lies outside {limits}; give a value inside.")
    for name, (low, high) in wishes.bounds.items():
        if not low < high:
            raise FitError(f"The bounds of {name} are {low:g} and {high:g}; give a smaller and a larger number.")
        start = wishes.start.get(name)
        if start is not None and not low <= start <= high:
            raise FitError(f"The start value {start:g} of {name} is outside its bounds {low:g} .. {high:g}; move one.")


def constants_of(model: ContactModel, wishes: Wishes, Fn0: float | None) -> dict[str, float | int | bool]:
    """Start values that are given: what is fixed, and the normal force at which the parameters hold."""
    constants: dict[str, float | int | bool] = {
        name: model.parameters[name].typed(value) if name in model.parameters else value
        for name, value in wishes.fixed.items()
    }
    if Fn0 is not None and model.loaded:
        constants.setdefault("Fn0", Fn0)
    return constants


def scalar_setup(
    model: ContactModel, pieces: Sequence[Piece], traits: Traits, wishes: Wishes, units: AxisUnits, Fn0: float | None
) -> Setup:
    """The unknowns of a block with scalar parameters.

    Raises
    ------
    FitError
        Nothing is left to identify.
    """
    names = model.identified(wishes.named, wishes.fixed)
    coordinates = [coordinate(model, name, traits, wishes) for name in names]
    coordinates += surroundings(pieces, traits, wishes)
    if not coordinates:
        raise FitError(f"All parameters of {model.name} are fixed; leave at least one to be identified.")
    state = model.initial_state
    if state is not None:
        coordinates += [
            Coordinate(state, 1.0, _initial_guess(piece, traits, Fn0), -INITIAL_LIMIT, INITIAL_LIMIT, piece=index)
            for index, piece in enumerate(pieces)
        ]
    constants = constants_of(model, wishes, Fn0)
    defaults = {name: p.start for name, p in model.parameters.items()} | {k: float(v) for k, v in constants.items()}

    def states(parameters: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
        if state is None:
            return {}
        return {state: values[state] * float(evaluate(model.told.size, {**defaults, **parameters}))}

    unit = {name: p.unit for name, p in model.parameters.items()}
    unit |= {"M": units.inertia, "OF": units.force}
    if state is not None:
        unit[state] = units.force if state.startswith("F") else units.position
    return Setup(tuple(coordinates), dict, states, constants, unit)


def coordinate(model: ContactModel, name: str, traits: Traits, wishes: Wishes) -> Coordinate:
    """The unknown of one parameter: on a logarithm if its range excludes zero."""
    parameter = model.parameters[name]
    lower, upper = wishes.bounds.get(name, (parameter.lower, parameter.upper))
    lower, upper = max(lower, parameter.lower), min(upper, parameter.upper)
    fit = model.fit_of(name)
    guess = wishes.start.get(name, traits.value(fit.start) if fit else parameter.start)
    guess = min(max(guess, lower), upper)
    log = parameter.lower > 0.0
    scale = abs(guess) or abs(parameter.start) or 1.0
    return Coordinate(name, scale, guess, lower, upper, log)


def surroundings(pieces: Sequence[Piece], traits: Traits, wishes: Wishes) -> list[Coordinate]:
    """The unknown mass of a drive, and the offset of any force that is measured in both directions."""
    guesses: dict[str, tuple[float, float]] = {}
    if pieces[0].a is not None:
        mass, offset = inertia_guess(pieces)
        a = np.concatenate([piece.a for piece in pieces if piece.a is not None])
        size = float(np.sqrt(np.mean(np.square(a))))
        guesses = {"M": (max(mass, 1e-3 * traits.level / max(size, 1e-300)), 0.0), "OF": (offset, -math.inf)}
    elif any(piece.reciprocating for piece in pieces) or "OF" in wishes.named:
        guesses = {"OF": (0.0, -math.inf)}
    found = []
    for name, (guess, low) in guesses.items():
        # two directions with a level each have room for any offset
        if name in wishes.fixed or (name == "OF" and wishes.fixed.get("asymmetric") and name not in wishes.named):
            continue
        lower, upper = wishes.bounds.get(name, (low, math.inf))
        value = wishes.start.get(name, guess)
        scale = abs(value) if name == "M" and value != 0.0 else max(abs(value), traits.level)
        found.append(Coordinate(name, scale, min(max(value, lower), upper), lower, upper))
    return found


def _initial_guess(piece: Piece, traits: Traits, Fn0: float | None) -> float:
    """The force at the beginning of the record, in parts of that of sliding."""
    force = float(np.median(piece.measured[:3])) * (Fn0 or 1.0)
    return min(max(force / traits.level, -1.0), 1.0)


def advice(model: ContactModel, name: str) -> str:
    """What to measure for a parameter, or for an initial state."""
    fit = model.fit_of(name)
    return fit.measure if fit else "sliding in both directions at the beginning of the record"
