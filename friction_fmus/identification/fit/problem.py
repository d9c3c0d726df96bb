"""A friction block and records as a least squares problem: coordinates of the search, residuals, Jacobian."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.simulation_data import Piece
from harness import Drive, PartError, StartValueError

#: Step of the differences, in coordinates of the search.
DIFFERENCE = 1e-4

#: Every so many samples are enough to come near to the end of a search, if a record has at least so many.
STRIDE, LONG = 4, 2000

#: Tolerance of the blocks' own solvers [-]; it must stay well below the step of the differences.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class Coordinate:
    """One unknown of the search, of the size 1.

    Attributes
    ----------
    name : str
        Name of the value.
    scale : float
        Its size; the start of the search is x = 0 (logarithm) or value / scale.
    start, lower, upper : float
        Of the value.
    log : bool
        Whether the search goes along its logarithm, as it does where zero is not allowed.
    piece : int or None
        The record whose initial state it is; None: all records share it.
    """

    name: str
    scale: float
    start: float
    lower: float = -math.inf
    upper: float = math.inf
    log: bool = False
    piece: int | None = None

    def value(self, x: float) -> float:
        """The value at x."""
        value = self.scale * (math.exp(min(x, 300.0)) if self.log else x)
        return min(max(value, self.lower), self.upper)

    def at(self, value: float) -> float:
        """The x of a value; minus infinity for 0 on a logarithm."""
        if not self.log:
            return value / self.scale
        return math.log(value / self.scale) if value > 0.0 else -math.inf


#: From values of the coordinates to parameters of the block, M and OF included.
Assemble = Callable[[Mapping[str, float]], dict[str, float]]

#: From parameters and values of the coordinates of one record to initial states of the block.
States = Callable[[Mapping[str, float], Mapping[str, float]], dict[str, float]]


@dataclass(eq=False)
class Problem:
    """Residuals of a block over several records.

    Attributes
    ----------
    drive : Drive
        The block.
    pieces : sequence of Piece
        The records.
    coordinates : sequence of Coordinate
        Those that all records share first, then the others.
    assemble, states : callable
        From values to what the block is started with.
    constants : mapping of str to float
        Other start values.
    simulations : int
        Runs so far.
    """

    drive: Drive
    pieces: Sequence[Piece]
    coordinates: Sequence[Coordinate]
    assemble: Assemble
    states: States
    constants: Mapping[str, float | int | bool]
    simulations: int = field(default=0)

    def __post_init__(self) -> None:
        """Find the size of the signal."""
        total = np.concatenate([piece.measured for piece in self.pieces])
        self.size = float(np.sqrt(np.mean(np.square(total)))) or 1.0
        self.count = len(total)

    def thinned(self) -> Problem | None:
        """The same on every fourth sample, where the records are long and driven on straight lines; else None."""
        long = all(len(p.measured) >= LONG and p.between == "linear" and p.filter is None for p in self.pieces)
        return replace(self, pieces=[p.thinned(STRIDE) for p in self.pieces], simulations=0) if long else None

    @property
    def shared(self) -> list[Coordinate]:
        """The coordinates that are the same for all records."""
        return [c for c in self.coordinates if c.piece is None]

    def values(self, x: Array, piece: int | None) -> dict[str, float]:
        """Values of the coordinates that all share, or of those of one piece."""
        return {c.name: c.value(float(at)) for c, at in zip(self.coordinates, x, strict=True) if c.piece == piece}

    def simulate(self, x: Array, index: int) -> Array:
        """The predicted signal of one piece."""
        given = {**self.constants, **self.assemble(self.values(x, None))}
        force = self.force(x, index)
        return self.pieces[index].predicted(force, float(given.get("M", 0.0)), float(given.get("OF", 0.0)))

    def force(self, x: Array, index: int) -> Array:
        """The friction force along one piece."""
        piece, parameters = self.pieces[index], self.assemble(self.values(x, None))
        start = {**self.constants, **parameters, **self.states(parameters, self.values(x, index))}
        start = {name: value for name, value in start.items() if name not in ("M", "OF")}
        self.simulations += 1
        force: Array = piece.run(self.drive, ["F"], start, TOLERANCE)[:, 0]
        return force

    def error(self, x: Array, index: int) -> Array:
        """Predicted minus measured of one piece, in parts of the size of the signal; infinite where the block refuses
        the values, which a search takes as a step too far."""
        measured = self.pieces[index].measured
        try:
            return (self.simulate(x, index) - measured) / self.size
        except (PartError, StartValueError):
            return np.full(len(measured), np.inf)

    def residual(self, x: Array) -> Array:
        """All errors, piece after piece."""
        return np.concatenate([self.error(x, index) for index in range(len(self.pieces))])

    def jacobian(self, x: Array, centre: Array | None = None) -> Array:
        """Differences forwards, or backwards where a bound is in the way."""
        centre = self.residual(x) if centre is None else centre
        ends = np.cumsum([0, *(len(piece.measured) for piece in self.pieces)])
        J = np.zeros((len(centre), len(x)))
        for i, c in enumerate(self.coordinates):
            step = DIFFERENCE if x[i] + DIFFERENCE <= c.at(c.upper) else -DIFFERENCE
            moved = np.array(x)
            moved[i] += step
            for index in range(len(self.pieces)) if c.piece is None else [c.piece]:
                rows = slice(ends[index], ends[index + 1])
                change = (self.error(moved, index) - centre[rows]) / step
                J[rows, i] = change if np.all(np.isfinite(change)) else 0.0
        return J

    def start(self) -> Array:
        """Where the search begins."""
        return np.array([c.at(c.start) for c in self.coordinates])

    def bounds(self) -> tuple[Array, Array]:
        """Of the search."""
        return np.array([c.at(c.lower) for c in self.coordinates]), np.array([c.at(c.upper) for c in self.coordinates])
