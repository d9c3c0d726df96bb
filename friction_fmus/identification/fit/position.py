"""Force over position beside a friction model: choice of the table, and its fit together with the parameters.

The force of a table is linear in its values at the nodes. For given parameters of the friction model, the values follow
from linear least squares, so that the search runs over the parameters only (variable projection; G. Golub, V. Pereyra,
1973).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.fft
import scipy.linalg
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from friction_fmus.axis.position_map import Grid, PositionMap
from friction_fmus.identification.data.record import Array
from friction_fmus.identification.fit.block_fit import BlockFit, FitData
from friction_fmus.identification.fit.scores import Score, rms
from friction_fmus.identification.fit.search import NEAR, Loss, search
from friction_fmus.identification.fit.simulation_data import PreparedSegment

NODES = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)  # numbers of nodes to try
ROWS_PER_NODE = 4  # smallest number of rows of the regression for each node
BLOCKS = 6  # number of blocks of the cross-validation
HELPS = 2.0 / 3.0  # largest cross-validation error, relative to that without a table, at which a table is used

#: Smallest reduction of the cross-validation error for which a table is used, over the magnitude of the signal: of
#: smaller errors, the last bits of the regression decide.
MATTERS = 0.005

#: Cross-validation errors within this factor of the smallest count as equal; the table with fewer nodes is then used.
ALIKE = 1.05

KEPT = 1_000_000  # largest number of rows times nodes of a regression that is kept for the next model

#: Speeds over the largest one, between which any friction over speed counts as known in the cross-validation.
SPEEDS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)

SIGN = 0.01  # velocity over which the sign is smoothed, over the largest velocity
REGULAR = 1e-6  # weight of the parameters in the regression with their linearised effect, which keeps it regular


@dataclass(frozen=True, eq=False)
class PositionFit:
    """Force over position that was identified together with a friction model."""

    table: PositionMap  # cogging and position-dependent friction
    crossed: float
    crossed_without: float
    """Rms error of the cross-validation over blocks of the training data, with and without the table, in the unit of
    the signal."""
    train_without: Score | None = None
    validation_without: Score | None = None
    """Scores of the model without the table."""


@dataclass(frozen=True, eq=False)
class TableRegressor:
    """Linear regression of the residual of a model on the values of a table."""

    # The values at the nodes add up to zero for cogging and for friction, because their means belong to the offset and
    # to the Coulomb friction of the model. Each value counts as one more sample, with a measured force of 0, so that
    # the table is flat where the record has few samples.

    grid: Grid  # nodes
    v_sign: float  # velocity over which the sign is smoothed [m/s]
    columns: Array  # drive force for a unit of each coefficient, at the rows of the residual

    def __post_init__(self) -> None:
        normal = self.columns.T @ self.columns + np.eye(self.columns.shape[1])
        object.__setattr__(self, "_factor", scipy.linalg.cho_factor(normal, overwrite_a=True))

    def coefficients(self, residual: Array) -> Array:
        """Return the coefficients that reduce a residual of shape (n,) or (n, columns) most."""
        factor = object.__getattribute__(self, "_factor")
        return -scipy.linalg.cho_solve(factor, self.columns.T @ residual)

    def project(self, residual: Array) -> Array:
        """Return the residual that remains, followed by the coefficients, so that their squares add up to the cost."""
        coefficients = self.coefficients(residual)
        return np.concatenate([residual + self.columns @ coefficients, coefficients])

    def table(self, coefficients: Array) -> PositionMap:
        """Return the table for coefficients in the unit of the force."""
        cogging, friction = np.split(coefficients, 2)
        basis = _basis(self.grid.nodes)
        return PositionMap(
            self.grid, tuple((basis @ cogging).tolist()), tuple((basis @ friction).tolist()), self.v_sign
        )


def fit_with_table(fit: BlockFit, data: FitData, loss: Loss) -> tuple[BlockFit, PositionFit] | None:
    """Fit a table together with the parameters of a friction model; None if the table does not help."""
    # The number of nodes is the one with the smallest error in a cross-validation over blocks of the training data
    # (`NODES`, `BLOCKS`, `ALIKE`), in which the effect of the parameters is linearised and friction may be any function
    # of the speed (`SPEEDS`). A table helps if it reduces this error by a third (`HELPS`). Parameters that the record
    # does not determine keep the values of `fit`, see `Problem.anchor`.
    if any(segment.record.q is None for segment in data.segments):
        return None
    with threadpool_limits(1):  # several models may be identified in parallel
        chosen = _choose(fit, data.segments)
    if chosen is None:
        return None
    regressor, crossed, without = chosen
    x = fit.found.x
    coordinates = tuple(replace(c, start=c.value(float(at))) for c, at in zip(fit.setup.coordinates, x, strict=True))
    setup = replace(fit.setup, coordinates=coordinates)
    problem = data.problem(setup)
    problem.simulations = fit.problem.simulations
    problem.regressor, problem.anchor = regressor, x
    found = search(problem, loss, 1, NEAR)
    errors = problem.errors(found.x)
    coefficients = regressor.coefficients(errors)
    of_samples = replace(found, residual=errors + regressor.columns @ coefficients, J=found.J[: problem.count])
    table = regressor.table(coefficients * problem.size)
    return BlockFit(setup, problem, of_samples), PositionFit(table, crossed, without)


def force_on_axis(table: PositionMap | None, segment: PreparedSegment) -> Array:
    """Return the force of a table along a prepared record, shape (n,); 0 without a table."""
    if table is None:
        return np.zeros(len(segment.record))
    return table.force(segment.record.column("q"), segment.inputs["v"])


def _choose(fit: BlockFit, segments: Sequence[PreparedSegment]) -> tuple[TableRegressor, float, float] | None:
    """Return the regression with the best number of nodes, and the cross-validation error with and without it."""
    size = fit.problem.size
    over_speed = np.concatenate([segment.rows(_over_speed(segment)) for segment in segments])
    J = np.hstack([fit.found.J, over_speed])
    residual = fit.found.residual
    scale = np.linalg.norm(J, axis=0)
    J = J / np.where(scale > 0.0, scale, 1.0)
    block = np.arange(len(J)) * BLOCKS // len(J)
    without = crossed(J, np.zeros((len(J), 0)), residual, block)
    tried: list[tuple[float, TableRegressor]] = []
    for nodes in NODES:
        if nodes * ROWS_PER_NODE > len(J):
            break
        regressor = _regressor(segments, nodes)
        tried.append((crossed(J, regressor.columns, residual, block), regressor))
    least = min((error for error, _ in tried), default=np.inf)
    if least > HELPS * without or without - least < MATTERS:
        return None
    error, regressor = next(each for each in tried if each[0] <= ALIKE * least)
    return regressor, error * size, without * size


def _regressor(segments: Sequence[PreparedSegment], nodes: int) -> TableRegressor:
    """Return the regression on a table over the whole travel, or over a turn of an axis that turns further."""
    q = np.concatenate([segment.record.column("q") for segment in segments])
    v_sign = SIGN * max(float(np.max(np.abs(segment.inputs["v"]))) for segment in segments)
    begin, travel = float(np.min(q)), float(np.ptp(q))
    turns = segments[0].record.units.rotary and travel > 2.0 * np.pi
    grid = Grid(0.0, 2.0 * np.pi / nodes, nodes, True) if turns else Grid(begin, travel / (nodes - 1), nodes)
    small = sum(len(segment.measured) for segment in segments) * nodes <= KEPT
    rows = _rows if small else _rows.__wrapped__
    columns = np.concatenate([rows(_Path(segment), grid, v_sign) for segment in segments])
    return TableRegressor(grid, v_sign, columns)


class _Path:
    """Motion of a segment; equal to another one with the same values, so that models share the rows."""

    def __init__(self, segment: PreparedSegment) -> None:
        self.segment = segment
        kept = None if segment.kept is None else segment.kept.tobytes()  # models without presliding ignore rests
        self.values = segment.record.column("q").tobytes(), segment.inputs["v"].tobytes(), segment.filter, kept

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Path) and self.values == other.values

    def __hash__(self) -> int:
        return hash(self.values)


@lru_cache(maxsize=2 * len(NODES))
def _rows(path: _Path, grid: Grid, v_sign: float) -> Array:
    """Return the drive force along a segment for a unit of each coefficient."""
    segment = path.segment
    weights = grid.weights(segment.record.column("q")) @ _basis(grid.nodes)
    direction = np.tanh(segment.inputs["v"] / v_sign)
    # the drive works against both
    return segment.rows(np.column_stack([-weights, direction[:, None] * weights]))


def _over_speed(segment: PreparedSegment) -> Array:
    """Return a force for each of some speeds, between which they vary linearly, shape (n, len(SPEEDS))."""
    # On a record that passes every position at one speed, a table could replace the part of the friction over speed
    # that a model lacks. With these columns beside the model, that does not count as help.
    v = segment.inputs["v"]
    speed = np.abs(v) / max(float(np.max(np.abs(v))), 1e-300)
    return np.column_stack([np.sign(v) * np.interp(speed, SPEEDS, row) for row in np.eye(len(SPEEDS))])


def _basis(nodes: int) -> Array:
    """Return an orthonormal basis of the vectors that add up to zero, shape (nodes, nodes - 1)."""
    cosines: Array = scipy.fft.idct(np.eye(nodes), axis=0, norm="ortho")
    return cosines[:, 1:]


def crossed(J: Array, columns: Array, residual: Array, block: NDArray[np.int64]) -> float:
    """Return the rms error of the residual in blocks that are left out of its regression on both matrices."""
    A = np.hstack([J, columns])
    weight = np.concatenate([np.full(J.shape[1], REGULAR), np.ones(columns.shape[1])])
    parts = [(A[block == b], residual[block == b]) for b in range(BLOCKS)]
    normal = [(a.T @ a, a.T @ r) for a, r in parts]
    total = sum(n for n, _ in normal) + np.diag(weight), sum(g for _, g in normal)
    errors = [
        r - a @ scipy.linalg.solve(total[0] - n, total[1] - g, assume_a="pos")
        for (a, r), (n, g) in zip(parts, normal, strict=True)
    ]
    return rms(np.concatenate(errors))
