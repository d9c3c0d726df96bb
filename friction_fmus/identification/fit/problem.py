"""Identification as a least-squares problem: coordinates of the search, residuals and Jacobian."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.simulation_data import PreparedSegment
from harness import Drive, PartError, StartValueError

#: Step of the finite differences, in coordinates of the search.
DIFFERENCE = 1e-4

#: Stride of the samples in a preliminary search, and number of samples from which on it is used.
STRIDE, LONG = 4, 2000

#: Residual for a distance of 1 from the anchor, over the magnitude of the signal.
TIE = 0.01

#: Tolerance of the solvers of the blocks; it must be much smaller than the step of the finite differences.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class Coordinate:
    """Unknown of the search, scaled to a magnitude of 1."""

    name: str
    """Name of the value."""
    scale: float
    """Magnitude of the value; the coordinate is x = log(value / scale) or x = value / scale."""
    start: float
    lower: float = -math.inf
    upper: float = math.inf
    """Start value and bounds of the value."""
    log: bool = False
    """Whether the coordinate is logarithmic, as for values that must not be zero."""
    segment: int | None = None
    """Index of the record whose initial state it is; None if all records share it."""

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

    drive: Drive
    """Loaded block."""
    segments: Sequence[PreparedSegment]
    """Prepared records."""
    coordinates: Sequence[Coordinate]
    """Coordinates shared by all records first, then the others."""
    assemble: Assemble
    states: States
    """Functions that return parameters and initial states of the block."""
    constants: Mapping[str, float | int | bool]
    """Other start values."""
    simulations: int = field(default=0)
    """Number of simulations so far."""
    regressor: Regressor | None = None
    """Linear unknowns, which are eliminated from the residual (variable projection)."""
    anchor: Array | None = None
    """Point to which weak springs tie the coordinates, so that those which the record does not determine stay there."""
    viscous: bool = False
    """Whether the value Fv is the coefficient of a viscous friction beside the block."""

    def __post_init__(self) -> None:
        """Compute the magnitude of the signal."""
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
        return self.segments[index].predicted(force, float(given.get("M", 0.0)), float(given.get("OF", 0.0)))

    def force(self, x: Array, index: int) -> Array:
        """Return the friction force along one segment."""
        segment, parameters = self.segments[index], self.assemble(self.values(x, None))
        start = {**self.constants, **parameters, **self.states(parameters, self.values(x, index))}
        beside = ("M", "OF", "OF_rate", *(("Fv",) if self.viscous else ()))
        self.simulations += 1
        own = {name: value for name, value in start.items() if name not in beside}
        force: Array = segment.run(self.drive, ["F"], own, TOLERANCE)[:, 0]
        return force + float(start["Fv"]) * segment.inputs["v"] if self.viscous else force

    def error(self, x: Array, index: int) -> Array:
        """Return predicted minus measured signal of one segment over the magnitude of the signal.

        The result is infinite if the block rejects the values; the search then takes a smaller step.
        """
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
