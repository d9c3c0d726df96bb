"""Identification as a least-squares problem: coordinates of the search, residuals and Jacobian."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from friction_fmus.errors import FitError, did_you_mean
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.axis_terms import LIMITS, TERMS, VALUES, force_beside, relative_load, sizes_of
from friction_fmus.identification.fit.contact_model import ContactModel, DataTraits
from friction_fmus.identification.fit.simulation_data import PreparedSegment, inertia_guess
from harness import Drive, PartError, StartValueError

DIFFERENCE = 1e-4  # step of the finite differences, in coordinates of the search
STRIDE, LONG = 4, 2000  # stride of the samples in a preliminary search, and the fewest samples for one
TIE = 0.01  # residual for a distance of 1 from the anchor, over the magnitude of the signal

JAMS = 1e-3  # part of the drive force that friction leaves, below which it counts as this

#: Tolerance of the solvers of the blocks; it must be much smaller than the step of the finite differences.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class Coordinate:
    """Unknown of the search, scaled to a magnitude of 1."""

    name: str  # name of the value
    scale: float  # magnitude of the value; the coordinate is x = log(value / scale) or x = value / scale
    start: float
    lower: float = -math.inf
    upper: float = math.inf
    """Start value and bounds of the value."""
    log: bool = False  # whether the coordinate is logarithmic, as for values that must not be zero
    segment: int | None = None  # index of the record whose initial state it is; None if all records share it

    def value(self, x: float) -> float:
        """Return the value at the coordinate x."""
        value = self.scale * (math.exp(min(x, 300.0)) if self.log else x)
        return min(max(value, self.lower), self.upper)

    def at(self, value: float) -> float:
        """Return the coordinate of a value; minus infinity for 0 on a logarithmic scale."""
        if not self.log:
            return value / self.scale
        return math.log(value / self.scale) if value > 0.0 else -math.inf


class Regressor(Protocol):
    """Regression of the residual on further, linear unknowns."""

    def project(self, residual: Array, /) -> Array:
        """Return what remains of a residual of shape (n,) or (n, columns), followed by the unknowns."""


#: Function of the coordinates' values that returns the parameters of the block, including M and OF.
Assemble = Callable[[Mapping[str, float]], dict[str, float]]

#: Function of the parameters and the coordinates' values of one record that returns initial states of the block.
States = Callable[[Mapping[str, float], Mapping[str, float]], dict[str, float]]


@dataclass(eq=False)
class Problem:
    """Residuals of a block over several records."""

    drive: Drive  # loaded block
    segments: Sequence[PreparedSegment]  # prepared records
    coordinates: Sequence[Coordinate]  # coordinates shared by all records first, then the others
    assemble: Assemble
    states: States
    """Functions that return parameters and initial states of the block."""
    constants: Mapping[str, float | int | bool]  # other start values
    simulations: int = field(default=0)  # number of simulations so far
    regressor: Regressor | None = None  # linear unknowns, which are eliminated from the residual (variable projection)
    anchor: Array | None = None
    """Point to which weak springs tie the coordinates, so that those which the record does not determine stay there."""
    model: ContactModel | None = None
    """The block, if something acts beside it: viscous friction with the value Fv, or `TERMS`."""
    predicts_drive: bool = True  # whether a transmitted force is the predicted drive force instead of the measured one

    def __post_init__(self) -> None:
        total = np.concatenate([segment.measured for segment in self.segments])
        self.size = float(np.sqrt(np.mean(np.square(total)))) or 1.0
        self.count = len(total)

    def thinned(self) -> Problem | None:
        """Return the problem with every fourth sample; None unless records are long and inputs piecewise linear."""
        long = all(len(p.measured) >= LONG and p.between == "linear" and p.filter is None for p in self.segments)
        return replace(self, segments=[p.thinned(STRIDE) for p in self.segments], simulations=0) if long else None

    @property
    def shared(self) -> list[Coordinate]:
        """Coordinates shared by all records."""
        return [c for c in self.coordinates if c.segment is None]

    def values(self, x: Array, segment: int | None) -> dict[str, float]:
        """Return the values of the shared coordinates (None), or of those of one segment."""
        return {c.name: c.value(float(at)) for c, at in zip(self.coordinates, x, strict=True) if c.segment == segment}

    def simulate(self, x: Array, index: int) -> Array:
        """Return the predicted signal of one segment."""
        given = {**self.constants, **self.assemble(self.values(x, None))}
        force = self.force(x, index)
        numbers = {name: float(value) for name, value in given.items()}
        segment = self.segments[index]
        beside = force_beside(numbers, segment) if segment.a is not None else 0.0
        found: Array = segment.predicted(force + beside, numbers.get("M", 0.0), numbers.get("OF", 0.0))
        return found / numbers.get("gain", 1.0)

    def force(self, x: Array, index: int) -> Array:
        """Return the friction force along one segment."""
        segment, parameters = self.segments[index], self.assemble(self.values(x, None))
        start = {**self.constants, **parameters, **self.states(parameters, self.values(x, index))}
        viscous = self.model is not None and self.model.viscous
        terms = VALUES - self.model.parameters.keys() if self.model is not None else VALUES
        beside = {"M", "OF", "OF_rate", *(("Fv",) if viscous else ()), *terms}
        self.simulations += 1
        own = {name: value for name, value in start.items() if name not in beside}
        if self.model is not None and not terms.isdisjoint(start):
            numbers = {name: float(value) for name, value in start.items()}
            if self.model.transmits:
                segment = replace(segment, inputs={**segment.inputs, "F_t": numbers.get("gain", 1.0) * segment.drive})
            of_axis = {name: value for name, value in numbers.items() if name in beside}
            load = relative_load(of_axis, segment, self.model.level(numbers))
            if load is not None:
                Fn0 = own["Fn0"] = numbers.get("Fn0", 1.0)
                segment = replace(segment, inputs={**segment.inputs, "Fn": Fn0 * load})
        force: Array = segment.run(self.drive, ["F"], own, TOLERANCE)[:, 0]
        if self.predicts_drive and "F_t" in segment.inputs:
            force = self._transmitted(force, start, own, segment)
        return force + float(start["Fv"]) * segment.inputs["v"] if viscous else force

    def _transmitted(
        self, force: Array, given: Mapping[str, float], own: Mapping[str, float], segment: PreparedSegment
    ) -> Array:
        """Return the friction under the drive force that the model predicts, from that under the measured one."""
        # The measured force would predict itself: a friction as large as the drive force fits every record.
        assert segment.a is not None
        measured, still = segment.inputs["F_t"], {**segment.inputs, "F_t": np.zeros(len(force))}
        alone: Array = replace(segment, inputs=still).run(self.drive, ["F"], own, TOLERANCE)[:, 0]
        share = (force - alone) / np.where(measured == 0.0, np.inf, measured)
        numbers = {name: float(value) for name, value in given.items()}
        needed = force_beside(numbers, segment) + numbers.get("OF", 0.0) + numbers.get("M", 0.0) * segment.a
        return alone + share * (alone + needed) / np.maximum(1.0 - share, JAMS)

    def error(self, x: Array, index: int) -> Array:
        """Return the error of one segment over the size of the signal; infinite if the block rejects the values."""
        measured = self.segments[index].measured
        try:
            return (self.simulate(x, index) - measured) / self.size
        except (PartError, StartValueError):
            return np.full(len(measured), np.inf)

    def residual(self, x: Array) -> Array:
        """Return the errors of all segments, what remains of them after the regression, and the pull of the anchor."""
        pull = np.zeros(0) if self.anchor is None else TIE * (x - self.anchor)
        return np.concatenate([self._projected(self.errors(x)), pull])

    def errors(self, x: Array) -> Array:
        """Return the errors of all segments, concatenated."""
        return np.concatenate([self.error(x, index) for index in range(len(self.segments))])

    def _projected(self, errors: Array) -> Array:
        if self.regressor is None:
            return errors
        if not np.all(np.isfinite(errors)):
            return np.full_like(self.regressor.project(np.zeros_like(errors)), np.inf)
        return self.regressor.project(errors)

    def jacobian(self, x: Array, centre: Array | None = None) -> Array:
        """Return the Jacobian by forward differences, or backward differences at an upper bound."""
        # a projected residual does not tell the errors
        centre = self.errors(x) if centre is None or self.regressor is not None else centre
        ends = np.cumsum([0, *(len(segment.measured) for segment in self.segments)])
        J = np.zeros((len(centre), len(x)))
        for i, c in enumerate(self.coordinates):
            step = DIFFERENCE if x[i] + DIFFERENCE <= c.at(c.upper) else -DIFFERENCE
            moved = np.array(x)
            moved[i] += step
            for index in range(len(self.segments)) if c.segment is None else [c.segment]:
                rows = slice(ends[index], ends[index + 1])
                change = (self.error(moved, index) - centre[rows]) / step
                J[rows, i] = change if np.all(np.isfinite(change)) else 0.0
        return np.concatenate(
            [self._projected(J), np.zeros((0, len(x))) if self.anchor is None else TIE * np.eye(len(x))]
        )

    def start(self) -> Array:
        """Return the start point of the search."""
        return np.array([c.at(c.start) for c in self.coordinates])

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds of the coordinates."""
        return np.array([c.at(c.lower) for c in self.coordinates]), np.array([c.at(c.upper) for c in self.coordinates])


INITIAL_LIMIT = 3.0  # largest magnitude of an initial state over its magnitude in steady sliding

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

    coordinates: tuple[Coordinate, ...]  # coordinates shared by all records first, then the others
    assemble: Assemble
    states: States
    """Functions that return parameters and initial states, see `Problem`."""
    constants: Mapping[str, float | int | bool]  # other start values of the block
    units: Mapping[str, str]  # units of the values returned by `assemble` and `states`


def check_constraints(model: ContactModel, signal: str, constraints: Constraints, terms: Sequence[str] = ()) -> None:
    """Validate the user's constraints."""
    known = {*model.parameters, "OF", *(("M",) if signal == "force" else ()), *(("Fv",) if model.viscous else ())}
    known |= {name for term in terms for name in TERMS[term]}
    for kind, names in (("fixed", constraints.fixed), ("bounds", constraints.bounds), ("start", constraints.start)):
        for name in names:
            if name not in known:
                raise FitError(
                    f"{kind} contains {name!r}, which is not a parameter of {model.name}{did_you_mean(name, known)}; "
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


def coordinate(model: ContactModel, name: str, traits: DataTraits, constraints: Constraints) -> Coordinate:
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
    segments: Sequence[PreparedSegment],
    traits: DataTraits,
    constraints: Constraints,
    viscous: bool,
    terms: Sequence[str] = (),
) -> list[Coordinate]:
    """Return the coordinates of mass, force offset (if motion is both ways), viscous friction and terms."""
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
    sizes = sizes_of(segments, traits.level)
    for name in (name for term in terms for name in TERMS[term] if name not in constraints.fixed):
        gain, coefficient = name == "gain", name.startswith("a")
        lower, upper = constraints.bounds.get(name, LIMITS.get(name, (-math.inf, math.inf)))
        value = constraints.start.get(name, 1.0 if gain else 0.5 * sizes[name] if coefficient else 0.0)
        scale = max(abs(value), sizes[name])
        found.append(Coordinate(name, scale, min(max(value, lower), upper), lower, upper, log=gain))
    return found


def advice(model: ContactModel, name: str) -> str:
    """Return what to measure to identify a parameter or an initial state."""
    fit = model.fit_of(name)
    return fit.measure if fit else "sliding in both directions at the start of the record"
