"""Residual of an identified friction model over velocity, position and direction, learned by least squares."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from friction_fmus.blocks.axis_units import domain_of
from friction_fmus.errors import FitError
from friction_fmus.export.block_fmu import build
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.scores import rms
from friction_fmus.identification.identification_result import Identification, known_force, simulated
from friction_fmus.lawkit.quantities import POSITIONS, SPEEDS

BLOCK = "FrictionResidual"  # law that adds the residual to the force of a model
BLOCKS = 6  # number of blocks of the cross-validation

RIDGES = tuple(float(ridge) for ridge in np.geomspace(1e-4, 1e2, 7))
"""Ridge parameters to try, over the mean square of the columns."""

HELPS = 0.98  # largest cross-validation error, relative to that without a residual, at which a residual is used


@dataclass(frozen=True)
class ResidualTable:
    """Residual of a friction model: parameters of the law `FrictionResidual`.

    Attributes
    ----------
    v_max : float
        Largest speed; the others are `SPEEDS` times it [m/s].
    x_begin, spacing : float
        First position, and distance of the positions [m].
    forward, backward : tuple of float
        Friction to add at each speed and position, position by position for each speed [N].
    R_max : float
        Largest residual [N].
    only_adds : bool
        Whether the residual never assists the motion.
    """

    v_max: float
    x_begin: float
    spacing: float
    forward: tuple[float, ...]
    backward: tuple[float, ...]
    R_max: float
    only_adds: bool = False

    def start_values(self) -> dict[str, float | bool]:
        """Return the start values of `FrictionResidual`.

        Returns
        -------
        dict of str to float or bool
            Values by variable.
        """
        vectors = {"forward": self.forward, "backward": self.backward}
        elements = {f"{name}[{i}]": each for name, values in vectors.items() for i, each in enumerate(values, 1)}
        rest = {name: vars(self)[name] for name in ("v_max", "x_begin", "spacing", "R_max", "only_adds")}
        return {**elements, **rest}

    def total(self, F_model: Array, x: Array, v: Array) -> Array:
        """Return the force of a model with the residual, as `FrictionResidual` does.

        Parameters
        ----------
        F_model, x, v : array, shape (n,)
            Force of the model [N], position [m] and velocity [m/s].

        Returns
        -------
        array, shape (n,)
            Force [N].
        """
        weights = np.array([*self.forward, *self.backward])
        along = np.clip(np.sign(v) * (columns(self.v_max, self.x_begin, self.spacing, x, v) @ weights), *self._limits)
        way = np.sign(v)
        total: Array = F_model + way * np.maximum(along, -np.maximum(way * F_model, 0.0))
        return total

    def to_fmu(self, folder: Path, name: str = BLOCK, rotary: bool = False) -> Path:
        """Build the FMU with this table in a folder.

        Parameters
        ----------
        folder : Path
            Folder of the FMU.
        name : str
            Model identifier.
        rotary : bool
            Whether the axis has angles and torques.

        Returns
        -------
        Path
            The FMU.

        Raises
        ------
        BuildError
            If the FMU cannot be built.
        """
        return build(BLOCK, folder, self.start_values(), name, domain=domain_of(rotary))

    @property
    def _limits(self) -> tuple[float, float]:
        return (0.0 if self.only_adds else -self.R_max), self.R_max


@dataclass(frozen=True)
class LearnedResidual:
    """Residual learned from the training data of an identification.

    Attributes
    ----------
    table : ResidualTable
        The residual.
    crossed, crossed_without : float
        Rms error of the cross-validation over blocks of the training data, with and without the residual, in the unit
        of the signal.
    train, train_without, validation, validation_without : float
        Rms errors with the residual, limits included, and without; NaN without validation data.
    ridge : float
        Ridge parameter over the mean square of the columns.
    over_position : bool
        Whether the residual depends on position.
    """

    table: ResidualTable
    crossed: float
    crossed_without: float
    train: float
    train_without: float
    validation: float
    validation_without: float
    ridge: float
    over_position: bool


def columns(v_max: float, x_begin: float, spacing: float, x: Array, v: Array) -> Array:
    """Return the force for a unit of each value of the table, shape (n, values), forward before backward."""
    nodes = np.array([0.0, *SPEEDS])
    along_speed = np.interp(np.abs(v) / v_max, nodes, np.arange(nodes.size))
    along_x = np.clip((x - x_begin) / spacing, 0.0, POSITIONS - 1.0)
    of_speed = np.maximum(1.0 - np.abs(along_speed[:, None] - np.arange(1, nodes.size)), 0.0)
    of_x = np.maximum(1.0 - np.abs(along_x[:, None] - np.arange(POSITIONS)), 0.0)
    table = (of_speed[:, :, None] * of_x[:, None, :]).reshape(len(x), -1)
    return np.hstack([np.where(v[:, None] > 0.0, table, 0.0), np.where(v[:, None] < 0.0, -table, 0.0)])


def learn_residual(
    result: Identification, validation: Record | Sequence[Record] | None = None, *, only_adds: bool = False
) -> LearnedResidual | None:
    """Learn the residual of an identified model from its training data.

    Parameters
    ----------
    result : Identification
        Friction model identified from friction or drive force along a measured motion.
    validation : Record or sequence of Record, optional
        Data on which the errors with and without the residual are reported; they have no influence on it.
    only_adds : bool
        Whether the residual may never assist the motion, so that the sum is passive with every passive model.

    Returns
    -------
    LearnedResidual or None
        None if no table reduces the cross-validation error by 2 % or more.

    Raises
    ------
    FitError
        If the model was fitted to positions.

    Notes
    -----
    The values follow from least squares with a ridge, over blocks of the training data in cross-validation: the ridge
    (`RIDGES`), and whether the table depends on position, are those with the smallest error on blocks that are left
    out. `FrictionResidual` limits the residual; the reported errors contain these limits.
    """
    if result.signal == "q":
        raise FitError(
            f"learn_residual: {result.model} was fitted to positions, not to a force; identify it by another method."
        )
    parts = [_Part(result, record) for record in result.records]
    v, x = (np.concatenate(values) for values in zip(*((part.v, part.x) for part in parts), strict=True))
    v_max = float(np.max(np.abs(v)))
    x_begin = float(x.min())
    spacing = float(np.ptp(x)) / (POSITIONS - 1) or 1.0
    A = np.vstack([part.rows(columns(v_max, x_begin, spacing, part.x, part.v)) for part in parts])
    target = np.concatenate([part.measured - part.predicted(part.F) for part in parts])
    same = np.kron(np.eye(2 * len(SPEEDS)), np.ones((POSITIONS, 1)))  # one value for all positions
    without = rms(target)
    tried = [
        (_crossed(A @ shape, target, ridge), ridge, shape) for shape in (same, np.eye(A.shape[1])) for ridge in RIDGES
    ]
    crossed, ridge, shape = min(tried, key=lambda each: each[0])
    if crossed > HELPS * without:
        return None
    weights = shape @ _ridge(A @ shape, target, ridge)
    forward, backward = np.split(weights, 2)
    table = ResidualTable(
        v_max,
        x_begin,
        spacing,
        tuple(forward.tolist()),
        tuple(backward.tolist()),
        float(np.abs(weights).max()),
        only_adds,
    )
    records = (validation,) if isinstance(validation, Record) else tuple(validation or ())
    checked = [_Part(result, record) for record in records]
    return LearnedResidual(
        table=table,
        crossed=crossed,
        crossed_without=without,
        train=_error(parts, table),
        train_without=_error(parts, None),
        validation=_error(checked, table),
        validation_without=_error(checked, None),
        ridge=ridge,
        over_position=shape is not same,
    )


class _Part:
    """A record with the force of the identified model along its motion."""

    def __init__(self, result: Identification, record: Record) -> None:
        self.segment, self.F = simulated(result, record, fit=True)
        self.v = self.segment.inputs["v"]
        self.x = self.segment.x if record.q is None else record.column("q")
        self.measured = self.segment.measured
        self._values = result.values()
        self._known = self.segment.rows(known_force(result, self.segment))

    def predicted(self, F: Array) -> Array:
        """Return the signal for a friction force."""
        values = self._values
        return self.segment.predicted(F, values.get("M", 0.0), values.get("OF", 0.0)) - self._known

    def rows(self, forces: Array) -> Array:
        """Return the signals of friction forces, shape (n, columns)."""
        return forces / self.segment.per[:, None] if self.segment.per is not None else self.segment.rows(forces)


def _error(parts: Sequence[_Part], table: ResidualTable | None) -> float:
    """Return the rms error with or without a residual; NaN without data."""
    if not parts:
        return float("nan")
    forces = [part.F if table is None else table.total(part.F, part.x, part.v) for part in parts]
    return rms(np.concatenate([part.measured - part.predicted(F) for part, F in zip(parts, forces, strict=True)]))


def _ridge(A: Array, target: Array, ridge: float) -> Array:
    normal = A.T @ A
    weight = max(ridge * float(np.mean(np.diag(normal))), np.finfo(float).tiny)
    return np.asarray(np.linalg.solve(normal + weight * np.eye(len(normal)), A.T @ target))


def _crossed(A: Array, target: Array, ridge: float) -> float:
    """Return the rms error on blocks that are left out of the regression."""
    block = np.arange(len(A)) * BLOCKS // len(A)
    errors = [
        target[block == b] - A[block == b] @ _ridge(A[block != b], target[block != b], ridge) for b in range(BLOCKS)
    ]
    return rms(np.concatenate(errors))
